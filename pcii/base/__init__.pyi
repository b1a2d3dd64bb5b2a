from . import command_line as command_line
from .blocks import block_sums as block_sums, box_around as box_around, evenly_chosen as evenly_chosen
from .blocks import on_pixels as on_pixels, sum_of as sum_of, window_sums as window_sums
from .command_line import answer_json as answer_json, complain_of as complain_of
from .command_line import results_folder as results_folder, say as say, say_next as say_next
from .command_line import say_next_page as say_next_page
from .compiled_loops import compiled as compiled, each_in_threads as each_in_threads, helper as helper
from .compiled_loops import shared as shared, threads as threads, use_threads as use_threads
from .errors import InputError as InputError, WorkerLostError as WorkerLostError
from .executor import Executor as Executor, THIS_PROCESS as THIS_PROCESS
from .executor import threads_of_worker as threads_of_worker
from .extensions import MethodRegistry as MethodRegistry, called as called, load_function as load_function
from .extensions import name_of as name_of, package_of as package_of, registered as registered
from .plain_text import in_html as in_html, in_markdown as in_markdown
from .plain_text import is_plain_name as is_plain_name, visible as visible, web_address as web_address
from .progress import Report as Report, Stages as Stages, silent as silent
from .safe_files import json_bytes as json_bytes, locked as locked, named_in_errors as named_in_errors
from .safe_files import new_folder_safely as new_folder_safely, sweep_temporaries as sweep_temporaries
from .safe_files import temporaries_of as temporaries_of, write_bytes_safely as write_bytes_safely
from .safe_files import write_json_safely as write_json_safely
from .short_form import ShortForm as ShortForm, listed as listed, span as span, times as times
from .srgb import LUMINANCE as LUMINANCE, linear_to_srgb as linear_to_srgb, srgb_to_linear as srgb_to_linear
