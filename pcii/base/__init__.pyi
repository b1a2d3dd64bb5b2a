from . import command_line as command_line
from .command_line import answer_json as answer_json, complain_of as complain_of, Report as Report
from .command_line import results_folder as results_folder, say as say, say_next as say_next
from .command_line import say_next_page as say_next_page, silent as silent, Stages as Stages
from .compiled_loops import compiled as compiled, each_in_threads as each_in_threads, helper as helper
from .compiled_loops import shared as shared, threads as threads, use_threads as use_threads
from .executor import Executor as Executor, THIS_PROCESS as THIS_PROCESS
from .executor import threads_of_worker as threads_of_worker
from .extensions import called as called, load_function as load_function, MethodRegistry as MethodRegistry
from .extensions import name_of as name_of, package_of as package_of, registered as registered
from .pixel_arithmetic import block_sums as block_sums, box_around as box_around
from .pixel_arithmetic import evenly_chosen as evenly_chosen, linear_to_srgb as linear_to_srgb
from .pixel_arithmetic import LUMINANCE as LUMINANCE, on_pixels as on_pixels, srgb_to_linear as srgb_to_linear
from .pixel_arithmetic import sum_of as sum_of, window_sums as window_sums
from .plain_text import in_markdown as in_markdown, InputError as InputError, is_plain as is_plain
from .plain_text import listed as listed, ShortForm as ShortForm, span as span, times as times
from .plain_text import visible as visible, WorkerLostError as WorkerLostError
from .safe_files import json_bytes as json_bytes, locked as locked, named_in_errors as named_in_errors
from .safe_files import new_folder_safely as new_folder_safely, sweep_temporaries as sweep_temporaries
from .safe_files import temporaries_of as temporaries_of, write_bytes_safely as write_bytes_safely
from .safe_files import write_json_safely as write_json_safely
