from .first_hits import FirstHits as FirstHits, coverage as coverage
from .first_hits import first_hits_at_centre as first_hits_at_centre, first_hits_of_view as first_hits_of_view
from .truth_file import in_focus as in_focus, traced_for_visibility as traced_for_visibility
from .truth_file import visible_views as visible_views, write_truth as write_truth
