"""What a dataset of a collection costs beside its light paths: made, found finished, and as a task of Dask.

The smallest datasets there are: 2 x 2 views of 32 x 32 pixels, photon counts alone.
"""

import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.figures import curve, frame
from benchmarks.results import Measured, Row, Size, Study
from benchmarks.timing import median_of
from pcii.base.executor import THIS_PROCESS, Executor
from pcii.store.collection import open_collection
from simgen.dataset.dataset_collection import generate_collection
from simgen.spec.sweeps import load_sweep

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TABLE = "Time of each dataset of a collection"
MADE, FOUND, TASKS, OPENED = "made", "found finished", "found finished, as tasks of Dask", "opened"
OVERRIDES = [
    "grid.rows=2", "grid.cols=2", "grid.height=32", "grid.width=32", "grid.pixel_mm=1.1",
    "products.radiance=none", "products.truth=false", "photons.budget=10",
]  # fmt: skip


SIZES: Mapping[Size, Mapping[str, Any]] = {
    "quick": {"counts": (10, 40), "repeats": 6},
    "full": {"counts": (200, 2000), "repeats": 6},
}


def measure(counts: Sequence[int], repeats: int) -> Measured:
    """Collections of some sizes, so that what grows with them shows."""
    from distributed import LocalCluster

    settings: dict[str, Any] = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": None}
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder, LocalCluster(**settings) as running:
        cluster: Any = running
        dask = Executor(scheduler=str(cluster.scheduler_address))
        for count in counts:
            sweep = load_sweep("plain_pair", OVERRIDES, seeds=count)
            taken: dict[str, list[float]] = {name: [] for name in (MADE, FOUND, TASKS, OPENED)}
            for repeat in range(repeats):
                out = Path(folder) / f"{count}_{repeat}"
                works: dict[str, Callable[[], object]] = {
                    MADE: partial(generate_collection, sweep, out, THIS_PROCESS),
                    FOUND: partial(generate_collection, sweep, out, THIS_PROCESS),
                    TASKS: partial(generate_collection, sweep, out, dask),
                    OPENED: partial(open_collection, out),
                }
                for name, work in works.items():
                    start = time.perf_counter()
                    work()
                    taken[name].append((time.perf_counter() - start) / count)
            rows += [
                Row(TABLE, name, {"datasets": count}, {"time_ms": median_of(seconds, 1e3)})
                for name, seconds in taken.items()
            ]
    return Measured(rows)


def draw(figure: "Figure", measured: Measured) -> None:
    """Time of each dataset against how many there are."""
    axes = figure.subplots()
    for number, name in enumerate((MADE, FOUND, TASKS, OPENED)):
        curve(
            axes, [row for row in measured.of(TABLE) if row.name == name], "datasets", "time_ms", name, number
        )
    frame(axes, "datasets", "time_ms", "each dataset of a collection")


def reading(measured: Measured) -> str:
    """How to read it, with the figures of the larger collection."""
    most = max(int(row.parameters["datasets"]) for row in measured.of(TABLE))
    made, found, tasks = (
        measured.one(TABLE, name, datasets=most).values["time_ms"].value for name in (MADE, FOUND, TASKS)
    )
    return (
        f"What does a dataset cost beside its light? In a collection of {most} the smallest datasets there"
        f" are take {made:.0f} ms each to make, and {found:.1f} ms to be found finished, {tasks:.1f} ms as"
        " tasks of Dask. Flat lines mean that nothing grows with the size of the collection."
    )


STUDY = Study(
    "collections", "Datasets of a collection", SIZES, measure, draw, reading, width_in=6.0, height_in=3.4
)
