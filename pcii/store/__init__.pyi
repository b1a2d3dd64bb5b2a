from . import provenance as provenance
from .collection import BENCHMARK_FIELDS as BENCHMARK_FIELDS, CERTIFICATE as CERTIFICATE
from .collection import check_manifest as check_manifest, Collection as Collection, COLUMNS as COLUMNS
from .collection import CROISSANT as CROISSANT, Half as Half, IN_FRAMES as IN_FRAMES, INDEX as INDEX
from .collection import index_row as index_row, is_collection as is_collection
from .collection import open_collection as open_collection, read_index as read_index, Split as Split
from .collection import write_index as write_index
from .dataset import COUNTS as COUNTS, Dataset as Dataset
from .dataset import nested_name as nested_name, open_dataset as open_dataset, PHOTON_TRUTH as PHOTON_TRUTH
from .dataset import RADIANCE as RADIANCE, radiance_name as radiance_name, sample as sample, SAMPLE as SAMPLE
from .dataset import TRUTH as TRUTH
from .dataset_card import CARD as CARD, LICENCE as LICENCE, Terms as Terms, write_card as write_card
from .dataset_card import write_licence as write_licence
from .dataset_writer import save_dataset as save_dataset, write_counts as write_counts
from .folders import check_free as check_free, check_size as check_size, COLLECTION as COLLECTION
from .folders import COLLECTION_FOLDER as COLLECTION_FOLDER, DATASET_FOLDER as DATASET_FOLDER
from .folders import DatasetManifest as DatasetManifest, entries as entries
from .folders import EVALUATION_FOLDER as EVALUATION_FOLDER, Files as Files, first_fault as first_fault
from .folders import hash_file as hash_file, hash_json as hash_json, list_files as list_files
from .folders import lists_part as lists_part, LOCK as LOCK, MANIFEST as MANIFEST, MARKER as MARKER
from .folders import OPEN as OPEN, read_listed as read_listed, read_manifest as read_manifest
from .folders import read_part as read_part, RESULTS as RESULTS, RESULTS_FOLDER as RESULTS_FOLDER
from .folders import ROWS as ROWS, Text as Text, unlisted_files as unlisted_files, validated as validated
from .provenance import differences as differences, machine as machine, own_software as own_software
from .provenance import PACKAGE as PACKAGE, print_verification as print_verification
from .provenance import software_with as software_with, verify as verify
from .stored_arrays import ARRAYS as ARRAYS, DEPTH_LABELS as DEPTH_LABELS, Label as Label
from .stored_arrays import new_array as new_array, new_group_safely as new_group_safely
from .stored_arrays import pack_arrays as pack_arrays, PHOTON_TRUTH_LABELS as PHOTON_TRUTH_LABELS
from .stored_arrays import read_array as read_array, read_exr as read_exr, SECTIONS_LABELS as SECTIONS_LABELS
from .stored_arrays import SEGMENTED_LABELS as SEGMENTED_LABELS, TRUTH_LABELS as TRUTH_LABELS
from .stored_arrays import write_arrays_safely as write_arrays_safely, write_exr_safely as write_exr_safely
