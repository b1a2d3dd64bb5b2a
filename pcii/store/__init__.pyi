from . import software as software
from .collection import BENCHMARK_FIELDS as BENCHMARK_FIELDS, CERTIFICATE as CERTIFICATE
from .collection import COLLECTION as COLLECTION, COLLECTION_FOLDER as COLLECTION_FOLDER, COLUMNS as COLUMNS
from .collection import CROISSANT as CROISSANT, Collection as Collection, Half as Half, INDEX as INDEX
from .collection import IN_FRAMES as IN_FRAMES, Split as Split, check_manifest as check_manifest
from .collection import index_row as index_row, is_collection as is_collection
from .collection import open_collection as open_collection, read_collection as read_collection
from .collection import read_index as read_index, write_index as write_index
from .dataset import Dataset as Dataset, SAMPLE as SAMPLE, copy_sample as copy_sample
from .dataset import open_dataset as open_dataset, sample as sample
from .dataset_card import Terms as Terms, write_card as write_card, write_licence as write_licence
from .dataset_layout import ARRAYS as ARRAYS, CARD as CARD, COUNTS as COUNTS, DATASET_FOLDER as DATASET_FOLDER
from .dataset_layout import LICENCE as LICENCE, MANIFEST as MANIFEST, MARKER as MARKER
from .dataset_layout import PHOTON_TRUTH as PHOTON_TRUTH, RADIANCE as RADIANCE, TRUTH as TRUTH
from .dataset_layout import nested_name as nested_name, pack_arrays as pack_arrays
from .dataset_layout import radiance_name as radiance_name, read_exr as read_exr
from .dataset_layout import read_manifest as read_manifest, read_written_manifest as read_written_manifest
from .dataset_layout import write_exr_safely as write_exr_safely, write_manifest as write_manifest
from .dataset_writer import check_depth_range as check_depth_range, save_dataset as save_dataset
from .dataset_writer import write_counts as write_counts, write_photon_truth as write_photon_truth
from .folders import EVALUATION_FOLDER as EVALUATION_FOLDER, Files as Files
from .folders import LARGEST_DOCUMENT_BYTES as LARGEST_DOCUMENT_BYTES, LOCK as LOCK, RESULTS as RESULTS
from .folders import RESULTS_FOLDER as RESULTS_FOLDER, ROWS as ROWS, check_free as check_free
from .folders import check_size as check_size, entries as entries, hash_file as hash_file
from .folders import hash_json as hash_json, list_files as list_files, lists_part as lists_part
from .folders import read_listed as read_listed, read_part as read_part, read_results as read_results
from .folders import read_small as read_small, unlisted_files as unlisted_files
from .manifests import DatasetManifest as DatasetManifest, OPEN as OPEN, Text as Text
from .manifests import first_fault as first_fault, validated as validated
from .software import PACKAGE as PACKAGE, differences as differences, machine as machine
from .software import own_software as own_software, software_with as software_with
from .suggested_depths import depth_range_of as depth_range_of, has_depths as has_depths
from .suggested_depths import planes_of as planes_of
from .verification import print_verification as print_verification, verify as verify
from .zarr_groups import new_array as new_array, new_group_safely as new_group_safely
from .zarr_groups import read_array as read_array, write_arrays_safely as write_arrays_safely
