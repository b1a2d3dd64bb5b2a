from . import comparison as comparison
from .benchmark_scores import BenchmarkHalf as BenchmarkHalf, open_benchmark as open_benchmark
from .benchmark_scores import run_method as run_method, score_submission as score_submission
from .comparison import evaluate as evaluate, Evaluation as Evaluation, find_datasets as find_datasets
from .comparison import identity_of as identity_of, tasks_of as tasks_of
from .evaluation_page import decisive_means as decisive_means, write_evaluation as write_evaluation
from .evaluation_page import write_page as write_page
from .method_names import depth_name as depth_name, named_methods as named_methods, NamedMethod as NamedMethod
from .method_names import read_submission as read_submission, software_of as software_of
from .method_names import Submission as Submission, SUBMISSION as SUBMISSION
from .rows import frame_of as frame_of, read_frame as read_frame, read_rows as read_rows
from .summary import mean_interval as mean_interval, means as means, means_over_scenes as means_over_scenes
from .summary import ranks as ranks, sign_flip_p as sign_flip_p
from .training_examples import examples as examples, Examples as Examples
