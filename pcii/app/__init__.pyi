from .pipeline import Outcome as Outcome, analyse as analyse
from .report import write_report as write_report
from .results import load_estimates as load_estimates, save_result as save_result
