"""The numbers of the scene model, in one place."""

from dataclasses import dataclass


@dataclass(frozen=True)
class SceneParameters:
    """Numbers of the energy of `pcii.scene_model.energy`."""

    cells_across: int = 256
    """Cells along the longer side of a film, at most: so a cell has 2 px of 512."""
    most_labels: int = 64
    """Depths of the ladder, at most."""
    windows_cells: tuple[float, ...] = (1.0, 2.0, 4.0, 8.0, 16.0)
    """Standard deviations of the windows that predict rates: from a cell to a sixteenth of the film."""
    quality_cells: float = 8.0
    """Standard deviation of the window in which it is judged how well each of these predicts."""
    widest_share: float = 0.05
    """Least share of the widest window: what a sudden spot costs at most."""
    beside_share: float = 0.25
    """Photons within half a cell of an outline come from the other side so often: of a border at a random
    place in cells half are beside it by less than half a cell, and half of these are on the wrong side."""
    lost_share: float = 1e-4
    """Rays that pass between cells of one surface, at most: so much of the film counts as background."""
    outline_nats_per_cell: float = 0.6
    """Cost of outlines: that of a closed curve on a square lattice, of which there are 2.64^n of n edges, is
    1 at most; less, since outlines are smooth."""
    surface_nats: float = 12.0
    """Cost of each surface: to say in which of 65 536 cells it begins takes log 65 536 = 11.1 nats."""
    roughness_nats: float = 0.1
    """Cost of a squared step between a cell and the mean of its surface around it."""
    roughness_cells: float = 2.0
    """Standard deviation of that mean's window."""
