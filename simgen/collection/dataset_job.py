"""The job of making the datasets of a series, piece by piece; several processes at once share it.

A process makes what is neither finished nor being made by another one: the lock on a dataset ends with the
process that holds it.
"""

from pathlib import Path

from pcii.base.errors import InputError
from pcii.base.progress import silent
from simgen.collection.collection_folder import Row, row_of
from simgen.collection.series import Series
from simgen.dataset.dataset_folder import finished
from simgen.dataset.generation import make
from simgen.dataset.prepared import prepare
from simgen.dataset.reuse import Reuse
from simgen.dataset.software import decisive_versions, other_versions
from simgen.renderer import backend


class DatasetJob:
    """Makes datasets of `series` in the folder `out`; keeps what one has in common with the next."""

    def __init__(self, series: Series, out: Path) -> None:
        self.series, self.out, self.reuse = series, out, Reuse()
        self.versions = decisive_versions()

    def __call__(self, piece: int) -> Row:
        """Make one dataset, unless it is finished; its row of the index.

        Raises `BusyError` if another process is at it, `InputError` if it cannot be made, or if this process
        has other versions of the software than the one that made the job.
        """
        differ = other_versions(self.versions)
        if differ:
            raise InputError(
                f"{self.name(piece)}: the collection is made with other software ({differ}); install that"
            )
        prepared = prepare(self.series.recipe(piece), self.series.recipe_folder)
        folder = self.out / self.series.folder(piece)
        # Sizes show well enough that it is whole: hashes are compared when it is read and verified.
        manifest = finished(folder, prepared.identity, content=False)
        return row_of(self.series, piece, self.out, manifest or make(prepared, folder, silent, self.reuse))

    def name(self, piece: int) -> str:
        """The dataset's folder."""
        return str(self.out / self.series.folder(piece))

    def use_threads(self, count: int) -> None:
        """Let the renderer run on so many threads."""
        backend.use_threads(count)
