"""A whole collection: begun, made by whoever does the work, and its index written."""

from contextlib import closing
from pathlib import Path

from pcii.base.executor import ALONE, Executor
from pcii.base.progress import Report, silent
from pcii.store.safe_files import named_in_errors
from simgen.collection.collection_folder import Row, begin, write_whole_index
from simgen.collection.dataset_job import DatasetJob
from simgen.collection.series import Series
from simgen.renderer import backend


def generate_collection(
    series: Series, out: Path, executor: Executor = ALONE, report: Report = silent
) -> list[str]:
    """Make all datasets of a series in the folder `out`, or go on with them; faults of those that failed.

    A dataset that cannot be made holds up no other. The index is written at the end, also of work that is
    interrupted. Raises `InputError` for a folder that holds anything else, and what is no fault of a
    single dataset, such as a full disk.
    """
    backend.choose()  # before work is distributed: a missing backend is reported once
    out = out.resolve()
    with named_in_errors(out):
        begin(series, out)
    rows, faults, pieces = dict[int, Row](), list[str](), range(len(series))
    try:
        with closing(executor.run(DatasetJob(series, out), pieces, report)) as work:
            for done in work:
                if done.result is None:
                    faults.append(done.fault)
                else:
                    rows[done.piece] = done.result
                report("datasets", len(rows) + len(faults), len(pieces))
    finally:
        with named_in_errors(out):
            write_whole_index(series, out, rows)
    return faults
