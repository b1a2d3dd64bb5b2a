from .first_hits import FirstHits as FirstHits, coverage as coverage
from .first_hits import first_hits_at_centre as first_hits_at_centre, first_hits_of_view as first_hits_of_view
from .first_hits import in_focus as in_focus, shape_boxes_mm as shape_boxes_mm
from .first_hits import visible_views as visible_views
from .truth_file import traced_for_visibility as traced_for_visibility, write_truth as write_truth
