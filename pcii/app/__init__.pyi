from .pipeline import Outcome as Outcome, analyse as analyse
from .report import write_report as write_report
from .results import load_estimates as load_estimates, save_depth as save_depth
from .results import save_sections as save_sections, save_segmented as save_segmented
