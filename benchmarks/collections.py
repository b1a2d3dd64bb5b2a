"""What a dataset of a collection costs beside its light paths: made, found finished, and as a task of Dask.

The smallest datasets there are: 2 x 2 views of 32 x 32 pixels, photon counts alone.
"""

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pcii.base.crew import ALONE, Crew
from pcii.io.collection import open_collection
from simgen.collection.whole_collection import generate_collection
from simgen.spec.sweeps import load_sweep

COUNTS = (200, 2000)
OVERRIDES = [
    "grid.rows=2", "grid.cols=2", "grid.height=32", "grid.width=32", "grid.pixel_mm=1.1",
    "products.radiance=none", "products.truth=false", "photons.budget=10",
]  # fmt: skip


def table() -> Iterator[str]:
    """The table, line by line as it is measured."""
    from distributed import LocalCluster

    yield "| datasets | made, ms each | found finished, ms each | the same as tasks of Dask | opened, ms |"
    yield "|---|---|---|---|---|"
    settings: dict[str, Any] = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": None}
    with tempfile.TemporaryDirectory() as folder, LocalCluster(**settings) as running:
        cluster: Any = running
        for count in COUNTS:
            sweep, out = load_sweep("plain_pair", OVERRIDES, seeds=count), Path(folder) / str(count)
            crews = (ALONE, ALONE, Crew(scheduler=str(cluster.scheduler_address)))
            cells = []
            for crew in crews:
                start = time.perf_counter()
                generate_collection(sweep, out, crew)
                cells.append(1000 * (time.perf_counter() - start) / count)
            start = time.perf_counter()
            open_collection(out)
            opened = 1000 * (time.perf_counter() - start)
            yield f"| {count} | {cells[0]:.0f} | {cells[1]:.1f} | {cells[2]:.1f} | {opened:.0f} |"
