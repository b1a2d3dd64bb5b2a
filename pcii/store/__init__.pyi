from . import provenance as provenance
from .collection import BENCHMARK_FIELDS as BENCHMARK_FIELDS, CERTIFICATE as CERTIFICATE, COLUMNS as COLUMNS
from .collection import CROISSANT as CROISSANT, Collection as Collection, Half as Half, INDEX as INDEX
from .collection import IN_FRAMES as IN_FRAMES, Split as Split, check_manifest as check_manifest
from .collection import index_row as index_row, is_collection as is_collection
from .collection import open_collection as open_collection, read_index as read_index
from .collection import write_index as write_index
from .dataset import COUNTS as COUNTS, Dataset as Dataset, PHOTON_TRUTH as PHOTON_TRUTH, RADIANCE as RADIANCE
from .dataset import SAMPLE as SAMPLE, TRUTH as TRUTH, copy_sample as copy_sample, nested_name as nested_name
from .dataset import open_dataset as open_dataset, radiance_name as radiance_name, sample as sample
from .dataset_card import CARD as CARD, LICENCE as LICENCE, Terms as Terms, write_card as write_card
from .dataset_card import write_licence as write_licence
from .dataset_writer import save_dataset as save_dataset
from .dataset_writer import write_counts as write_counts
from .folders import Files as Files, check_free as check_free, check_size as check_size, entries as entries
from .folders import hash_file as hash_file, hash_json as hash_json, list_files as list_files
from .folders import lists_part as lists_part, read_listed as read_listed, read_part as read_part
from .folders import unlisted_files as unlisted_files
from .folders import COLLECTION as COLLECTION, COLLECTION_FOLDER as COLLECTION_FOLDER
from .folders import DATASET_FOLDER as DATASET_FOLDER, DatasetManifest as DatasetManifest
from .folders import EVALUATION_FOLDER as EVALUATION_FOLDER
from .folders import LOCK as LOCK, MANIFEST as MANIFEST
from .folders import MARKER as MARKER, OPEN as OPEN, RESULTS as RESULTS, RESULTS_FOLDER as RESULTS_FOLDER
from .folders import ROWS as ROWS, Text as Text, first_fault as first_fault, read_manifest as read_manifest
from .folders import validated as validated
from .provenance import PACKAGE as PACKAGE, differences as differences, machine as machine
from .provenance import own_software as own_software, print_verification as print_verification
from .provenance import software_with as software_with, verify as verify
from .stored_arrays import ARRAYS as ARRAYS, DEPTH_LABELS as DEPTH_LABELS
from .stored_arrays import Label as Label, PHOTON_TRUTH_LABELS as PHOTON_TRUTH_LABELS
from .stored_arrays import SECTIONS_LABELS as SECTIONS_LABELS, SEGMENTED_LABELS as SEGMENTED_LABELS
from .stored_arrays import TRUTH_LABELS as TRUTH_LABELS, new_array as new_array
from .stored_arrays import new_group_safely as new_group_safely, pack_arrays as pack_arrays
from .stored_arrays import read_array as read_array, read_exr as read_exr
from .stored_arrays import write_arrays_safely as write_arrays_safely, write_exr_safely as write_exr_safely
