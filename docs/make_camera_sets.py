"""Write docs/camera_sets.md, what sets of cameras can know: `python docs/make_camera_sets.py`.

docs/camera_sets.csv keeps a line for each measurement, and what is there is not measured again: delete it
after a change of the methods. All of it takes ten minutes on two idle cores.
"""

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np

import pcii
import simgen
from pcii.base.blocks import on_pixels
from pcii.depth.methods import depth_posterior
from pcii.depth.posterior_depth import PosteriorDepth, depth_map_of
from pcii.evaluation.tables import NOT_BETTER, Table, markdown
from pcii.removal.posterior_masks import masks_of
from pcii.types.geometry import total_disparity_px

PAGE = Path(__file__).resolve().with_name("camera_sets.md")
SIDE_PX, FILM_MM, FOCAL_MM = 256, 36.0448, 50.0
FAR_MM, NEAR_MM = 620.0, 540.0
"""Baselines are stated as the difference of total disparity between these depths."""

TEXT = """# Which camera sets can know what

You have an array of cameras, or plan one. Do depth and removal work with it, in your light? What must the
baseline be? The table has the answers. Where it names no other distance, things are {usual_px} px of total
disparity apart:

{known}

**The baseline** is counted in px of total disparity, (N − 1) focal pitch / (z pixel), between the nearest
and the farthest thing that you want to distinguish ([scores](scores.md#units)). Plan 5 px with few cameras,
and up to 10 px with 3 × 3 cameras or more that see texture. With a longer baseline a px is fewer mm, and more
pixels are wrong: at 20 px only 10 × 10 cameras before a bright room are better within 1 px than one depth
everywhere. The fewer cameras, the shorter it must be: what decides is the disparity between neighbours.

## How it was measured

All sets have the same baseline along the axes that they have, and the same photons in all views together,
so that geometry alone differs: 100, 1000 and 10 000 photons are per view of 10 × 10 cameras, a hundred
times as many in all. Views are of {side} × {side} px, and objects at 540 and 620 mm are {usual_px} px of
total disparity apart. *Two objects* is the paper's scene, a ball and a bird before the dark, on {lit} of
the film; *room* is `drawn_room` number 103, whose walls fill the film, so that the same photons are spread
over {spread_times} times as many pixels. One draw of photons each: single figures are off by chance, most
where a depth is only just shown, as in the room at 1000 photons. Methods as they ship, which were made with
10 × 10 cameras more than with others.

*Within 1 px* and *3 px* are the shares of the objects' pixels whose depth is as near to the truth in total
disparity; a missing answer is wrong. *One depth everywhere* is the best answer that looks at no photon,
*everything* the IoU of whoever claims the whole film. {mark}: no better than these. – was not measured.
`python docs/make_camera_sets.py` makes the tables.

## Sets of cameras

Depth of two objects:

{depth_two}

Depth of the room:

{depth_room}

IoU of removal, two objects:

{removal_two}

IoU of removal, the room:

{removal_room}

## Baselines

Two objects at 1000 photons, the room at 10 000:

{baselines}

## Why

**Photons at the ends tell most.** The bound of Cramér and Rao ([theory](theory.md#6-bounds)) counts each
photon by the square of its camera's distance from the middle, for texture that is known:

{information}

So few cameras at the corners would be best, if the texture were known. It is not, and a plane is found by
comparison with wrong ones. At a wrong plane the section of N cameras shows each detail N times, N − 1 of
them as ghosts, each with 1 / N of its contrast. Ten by ten ghosts are a blur that looks like nothing; the
two or four of 1 × 2 and 2 × 2 are as sharp as the detail itself, and meet those of other details where the
baseline is longer than the distance between details.

**A line of cameras is blind to edges along it.** They do not move (the aperture problem), and they stay
sharp at every plane, behind infinity as well, so that they [show no
depth](theory.md#where-a-depth-is-shown). What is left without an answer, of lines and of other arrays,
shows below: the column *seen as a surface* counts what the network takes for one, and the last column what
would be right if all were answered.

{abstention}

**Two cameras** are enough for depth and the masks of the network, but in much light each outline is about
as sharp behind infinity, where it is seen twice, as at its depth: of two objects at 10 000 photons
{two_cameras} is answered. A single view is refused. The three steps need 8 samples to reject a point by its
variance, so that with fewer cameras outlines and entropy decide alone.

**Dead cameras.** A grid has no cameras that are left out: `pcii import` refuses a folder in which views are
missing, and a camera that does not work is one without photons. Its pixels count as samples that were dark.
So `sections.estimate` is lower by the share of dead cameras, by {few_dead} with 5 of 100 and {cross_dead}
in the cross; masks and depth compare planes, which are all lower alike, so that five of 100 change little.
The three steps take the spread among views for defocus, and lose much of two objects with the cross at 1000
photons.

## What is not modelled

Positions, rotations and lenses that are not perfect are [simulated](cameras.md#errors), but depth and
removal believe the ideal grid: [what that costs](experiments/wrong_cameras.md).
Not simulated are cameras of unequal sensitivity, vignetting, rolling
readout, motion, and arrays that are no plane grid with even pitch. The methods assume equal cameras too.

Real single-photon cameras have pixels that count without light. A map of them, measured with the lens
capped, is `sensor.hot_pixels` of a recipe, of one sensor or of each camera: [Single-photon
cameras](single_photon.md#dark-counts-of-a-real-camera). The figures above have none, and no dark counts.
Afterpulses, crosstalk and temperature are not modelled.
"""


@dataclass(frozen=True)
class CameraSet:
    """A grid of cameras of which some have no photons: `is_dead` (rows, cols) bool, None if all work."""

    rows: int
    cols: int
    is_dead: np.ndarray | None = None

    @property
    def working(self) -> int:
        """Number of cameras that work."""
        return self.rows * self.cols - (0 if self.is_dead is None else int(self.is_dead.sum()))


def _dead(rows: int, cols: int, *cameras: tuple[int, int]) -> np.ndarray:
    is_dead = np.zeros((rows, cols), bool)
    is_dead[tuple(np.transpose(cameras))] = True
    return is_dead


K, L = np.indices((5, 5))
SETS = {
    "10 × 10": CameraSet(10, 10),
    "10 × 10, 5 dead": CameraSet(10, 10, _dead(10, 10, (0, 3), (2, 7), (4, 4), (6, 1), (9, 8))),
    "5 × 5": CameraSet(5, 5),
    "cross of 9 in 5 × 5": CameraSet(5, 5, (K != 2) & (L != 2)),
    "chessboard of 13 in 5 × 5": CameraSet(5, 5, (K + L) % 2 == 1),
    "3 × 3": CameraSet(3, 3),
    "2 × 2": CameraSet(2, 2),
    "1 × 9": CameraSet(1, 9),
    "9 × 1": CameraSet(9, 1),
    "1 × 2": CameraSet(1, 2),
}
"""All have the same baseline along the axes that they have."""


@dataclass(frozen=True)
class View:
    """A scene, the range of depths that is searched, its amounts of light and that of the baselines.

    Light is in photons per view of 10 x 10 cameras; other sets have as many in all views together.
    """

    scene: simgen.Scene
    z_range_mm: tuple[float, float]
    photons: tuple[int, ...]
    usual_photons: int


SCENES = {
    "two objects": View(simgen.load_scene("two_objects"), (450.0, 750.0), (100, 1000, 10_000), 1000),
    "room": View(simgen.load_scene("drawn_room", number=103), (400.0, 850.0), (1000, 10_000), 10_000),
}
DIFFERENCES_PX = 2.0, 5.0, 10.0, 20.0
USUAL_PX = 10.0
OF_BASELINES = "10 × 10", "2 × 2"
METHODS = "three-step", "posterior"
OF_ABSTENTION = "3 × 3", "1 × 9", "9 × 1", "1 × 2", "chessboard of 13 in 5 × 5"
HEAD = "scene", "cameras", "difference_px", "photons"
Key = tuple[str, str, float, int]
Row = dict[str, float]


def works() -> Iterator[Key]:
    """What is measured: all sets in all light at one baseline, some at all baselines in the same light."""
    for scene, view in SCENES.items():
        for cameras, photons in product(SETS, view.photons):
            yield scene, cameras, USUAL_PX, photons
    for scene, view in SCENES.items():
        for cameras, difference_px in product(OF_BASELINES, DIFFERENCES_PX):
            if difference_px != USUAL_PX:
                yield scene, cameras, difference_px, view.usual_photons


def grid_of(cameras: CameraSet, difference_px: float) -> pcii.CameraGrid:
    """The grid whose total disparities at `NEAR_MM` and `FAR_MM` differ by so much."""
    pixel_mm = FILM_MM / SIDE_PX
    baseline_mm = difference_px * pixel_mm / FOCAL_MM / (1 / NEAR_MM - 1 / FAR_MM)
    pitch_mm = baseline_mm / (max(cameras.rows, cameras.cols) - 1)
    return pcii.CameraGrid(
        rows=cameras.rows,
        cols=cameras.cols,
        pitch_mm=(pitch_mm, pitch_mm),
        focal_mm=FOCAL_MM,
        pixel_mm=pixel_mm,
        height=SIDE_PX,
        width=SIDE_PX,
    )


@cache
def drawn(scene: str, rows: int, cols: int, difference_px: float) -> tuple[pcii.PhotonCounts, pcii.Truth]:
    """The most photons that any set of this grid needs, once: other draws are samples of them."""
    grid = grid_of(CameraSet(rows, cols), difference_px)
    fewest = min(each.working for each in SETS.values() if (each.rows, each.cols) == (rows, cols))
    view = SCENES[scene]
    most = 100 * (max(view.photons) if difference_px == USUAL_PX else view.usual_photons)
    counts, truth = simgen.draw_photons(view.scene, grid, budget=1.02 * most / fewest, seed=1)
    return counts, replace(truth, photons=None)  # which are of these counts, not of samples


def measure(scene: str, cameras: str, difference_px: float, photons: int) -> Row:
    """Scores of depth and removal, and of whoever looks at no photon."""
    of = SETS[cameras]
    counts, truth = drawn(scene, of.rows, of.cols, difference_px)
    if of.is_dead is not None:
        e = counts.events
        is_working = ~of.is_dead[e.k, e.l]
        k, l, i, j, n = (column[is_working] for column in (e.k, e.l, e.i, e.j, e.n))
        counts = pcii.PhotonCounts.from_events(k, l, i, j, n, counts.grid, cfa=counts.cfa)
    counts = counts.subsample(100 * photons, np.random.default_rng((1, photons)))
    view = SCENES[scene]
    z_mm = view.scene.planes_mm
    posterior = depth_posterior(counts, view.z_range_mm, z_mm=z_mm)
    steps = pcii.segment(counts, z_mm, method="three-step")
    focus = steps, masks_of(posterior, steps.sections)
    score = pcii.score(focus, depth_map_of(posterior, view.z_range_mm), truth)
    depth, true_px = score.depth, total_disparity_px(counts.grid, truth.object_z_mm)
    # What the answers would be without the rules by which the method abstains.
    _, _, total_px = posterior.most_probable()
    is_surface, best_px = (
        on_pixels(part, posterior.block_px, counts.grid.shape_HW)
        for part in (posterior.no_surface <= PosteriorDepth().max_empty, total_px)
    )
    on_object = np.isfinite(truth.object_z_mm)
    planes = [plane for plane in score.planes if plane["truth"] == "object" and plane["iou"] is not None]
    of_methods = [[plane for plane in planes if plane["method"] == each.method] for each in focus]
    return {
        "one_depth": depth["one_depth"]["within_1px"],
        "within_1px": depth["within_1px"],
        "within_3px": depth["within_3px"],
        "answered": depth["coverage"],
        "surface": float(is_surface[on_object].mean()),
        "best_within_1px": float((np.abs(best_px - true_px)[on_object] <= 1).mean()),
        "everything": float(np.mean([plane["everything"]["iou"] for plane in of_methods[0]])),
        **{own[0]["method"]: float(np.mean([plane["iou"] for plane in own])) for own in of_methods},
    }


def measured(file: Path) -> dict[Key, Row]:
    """All measurements; those that the file lacks are made and added to it."""
    rows = read(file) if file.is_file() else {}
    for key in works():
        if key not in rows:
            rows[key] = measure(*key)
            with file.open("a", newline="", encoding="utf-8") as stream:
                writer = csv.writer(stream, lineterminator="\n")
                if stream.tell() == 0:
                    writer.writerow([*HEAD, *rows[key]])
                writer.writerow([*key, *(f"{value:.4f}" for value in rows[key].values())])
            print(*key, *(f"{name} {value:.3f}" for name, value in rows[key].items()), flush=True)
    return rows


def read(file: Path) -> dict[Key, Row]:
    """The measurements that a file has."""
    with file.open(newline="", encoding="utf-8") as stream:
        lines = list(csv.DictReader(stream))
    rows: dict[Key, Row] = {}
    for line in lines:
        scene, cameras, difference_px, photons = (line.pop(name) for name in HEAD)
        key = scene, cameras, float(difference_px), int(photons)
        rows[key] = {name: float(value) for name, value in line.items()}
    return rows


def spread(cameras: CameraSet) -> float:
    """c_x + c_y of docs/theory.md for the cameras that work: what a photon tells, of texture all around."""
    alive = np.ones((cameras.rows, cameras.cols), bool) if cameras.is_dead is None else ~cameras.is_dead
    places = np.argwhere(alive) / (max(cameras.rows, cameras.cols) - 1)
    return float(places.var(axis=0).sum())


def page(rows: Mapping[Key, Row]) -> str:
    """The page, of which every figure is one of the rows."""

    def of(scene: str, cameras: str, photons: int, name: str, difference_px: float = USUAL_PX) -> float:
        return rows[scene, cameras, difference_px, photons][name]

    def cell(row: Row, name: str, yardstick: str) -> str:
        value = row[name]
        mark = f" {NOT_BETTER}" if value <= row[yardstick] else ""
        return "–" if np.isnan(value) else f"{value:.2f}{mark}"

    def table(header: tuple[str, ...], lines: Iterator[tuple[str, ...]], words: int = 1) -> str:
        return markdown(Table("", header, tuple(lines), words=words))

    def depth_table(scene: str) -> str:
        light = SCENES[scene].photons
        header = "cameras", *(f"{title}, {n}" for n in light for title in ("within 1 px", "3 px", "answered"))

        def lines() -> Iterator[tuple[str, ...]]:
            for cameras in SETS:
                own = [rows[scene, cameras, USUAL_PX, n] for n in light]
                yield (
                    cameras,
                    *(
                        text
                        for row in own
                        for text in (
                            cell(row, "within_1px", "one_depth"),
                            f"{row['within_3px']:.2f}",
                            f"{row['answered']:.2f}",
                        )
                    ),
                )
            best = f"{of(scene, '10 × 10', light[0], 'one_depth'):.2f}"
            yield "one depth everywhere", *([best, "", "1.00"] * len(light))

        return table(header, lines())

    def removal_table(scene: str) -> str:
        light = SCENES[scene].photons
        header = "cameras", *(f"{method}, {n}" for n in light for method in METHODS)

        def lines() -> Iterator[tuple[str, ...]]:
            for cameras in SETS:
                own = [rows[scene, cameras, USUAL_PX, n] for n in light]
                yield cameras, *(cell(row, method, "everything") for row in own for method in METHODS)
            everything = f"{of(scene, '10 × 10', light[0], 'everything'):.2f}"
            yield "everything", *([everything] * len(light) * len(METHODS))

        return table(header, lines())

    def baseline_table() -> str:
        header = (
            "scene", "cameras", "px apart", "px between neighbours", "1 px is, mm",
            "within 1 px", "one depth", "3 px", "answered", *METHODS, "everything",
        )  # fmt: skip

        def lines() -> Iterator[tuple[str, ...]]:
            for scene, cameras, difference_px in product(SCENES, OF_BASELINES, DIFFERENCES_PX):
                row = rows[scene, cameras, difference_px, SCENES[scene].usual_photons]
                step_px = difference_px / (max(SETS[cameras].rows, SETS[cameras].cols) - 1)
                yield (
                    scene, cameras, f"{difference_px:g}", f"{step_px:.1f}",
                    f"{(FAR_MM - NEAR_MM) / difference_px:.0f}", cell(row, "within_1px", "one_depth"),
                    f"{row['one_depth']:.2f}", f"{row['within_3px']:.2f}", f"{row['answered']:.2f}",
                    *(cell(row, method, "everything") for method in METHODS), f"{row['everything']:.2f}",
                )  # fmt: skip

        return table(header, lines(), words=2)

    def abstention_table() -> str:
        header = "scene", "cameras", "photons", "answered", "seen as a surface", "within 1 px if all answered"

        def lines() -> Iterator[tuple[str, ...]]:
            for scene, view in SCENES.items():
                for cameras, photons in product(OF_ABSTENTION, view.photons[-2:]):
                    row = rows[scene, cameras, USUAL_PX, photons]
                    yield (
                        scene,
                        cameras,
                        str(photons),
                        f"{row['answered']:.2f}",
                        f"{row['surface']:.2f}",
                        cell(row, "best_within_1px", "one_depth"),
                    )

        return table(header, lines(), words=2)

    def span(scene: str, names: tuple[str, ...], measure: str, photons: tuple[int, ...]) -> str:
        values = [of(scene, name, n, measure) for name in names for n in photons]
        least, most = f"{min(values):.2f}", f"{max(values):.2f}"
        return least if least == most else f"{least} to {most}"

    information = table(
        ("cameras", "work", "information per photon, 10 × 10 being 1"),
        ((name, str(s.working), f"{spread(s) / spread(SETS['10 × 10']):.2f}") for name, s in SETS.items()),
    )
    lit_share = 2 * of("two objects", "10 × 10", 1000, "everything")
    two, room = (SCENES[name].photons for name in SCENES)
    squares = "10 × 10", "5 × 5", "3 × 3"
    return TEXT.format(
        mark=NOT_BETTER,
        lit=f"{lit_share:.0%}".replace("%", " %"),
        spread_times=f"{1 / lit_share:.0f}",
        few_dead=f"{1 - SETS['10 × 10, 5 dead'].working / 100:.0%}".replace("%", " %"),
        two_cameras=f"{of('two objects', '1 × 2', 10_000, 'answered'):.2f}",
        cross_dead=f"{1 - SETS['cross of 9 in 5 × 5'].working / 25:.0%}".replace("%", " %"),
        side=SIDE_PX,
        usual_px=f"{USUAL_PX:g}",
        known=table(
            ("what you have", "depth", "removal"),
            iter(
                [
                    (
                        "3 × 3 to 10 × 10 cameras, things apart before the dark, from 100 photons per view",
                        "within 3 px of total disparity in "
                        + span("two objects", squares, "within_3px", two)
                        + "; within 1 px only in "
                        + span("two objects", squares, "within_1px", two),
                        "yes: IoU " + span("two objects", squares, "posterior", two),
                    ),
                    (
                        "2 × 2 or 1 × 2 cameras, the same things",
                        "the same coarse depth ("
                        + span("two objects", ("2 × 2", "1 × 2"), "within_3px", two)
                        + " within 3 px); with things at most 5 px apart it is better",
                        "yes, as their outlines alone tell them apart: "
                        + span("two objects", ("2 × 2", "1 × 2"), "posterior", two),
                    ),
                    (
                        "a row or a column of cameras, the same things",
                        span("two objects", ("1 × 9", "9 × 1"), "within_3px", two)
                        + " within 3 px, "
                        + span("two objects", ("1 × 9", "9 × 1"), "within_1px", two)
                        + " within 1 px",
                        "yes: " + span("two objects", ("1 × 9", "9 × 1"), "posterior", two),
                    ),
                    (
                        "3 × 3 to 10 × 10 cameras, a bright room, 10 000 photons per view",
                        "yes: " + span("room", squares, "within_1px", room[-1:]) + " within 1 px",
                        "in part, by posterior: " + span("room", squares, "posterior", room[-1:]),
                    ),
                    (
                        "a row or a column of cameras, the room, 10 000 photons per view",
                        "yes: " + span("room", ("1 × 9", "9 × 1"), "within_1px", room[-1:]) + " within 1 px",
                        "in part, by posterior: " + span("room", ("1 × 9", "9 × 1"), "posterior", room[-1:]),
                    ),
                    (
                        "any set, the room, 1000 photons per view",
                        "no: "
                        + span("room", tuple(SETS), "within_1px", room[:1])
                        + ", no better than one depth",
                        "hardly",
                    ),
                    (
                        "2 × 2 or 1 × 2 cameras, a bright room",
                        "only with a short baseline: 2 × 2 has "
                        f"{of('room', '2 × 2', room[-1], 'within_1px', 5.0):.2f} at 5 px and "
                        f"{of('room', '2 × 2', room[-1], 'within_1px'):.2f} at {USUAL_PX:g} px",
                        "with a short baseline in part, by posterior: "
                        f"{of('room', '2 × 2', room[-1], 'posterior', 5.0):.2f} at 5 px",
                    ),
                    (
                        "some dead cameras, a cross, or one colour of a chessboard",
                        "as with all of them, where there is light enough",
                        "as with all of them by posterior; by the three steps not always",
                    ),
                ]
            ),
            words=3,
        ),
        depth_two=depth_table("two objects"),
        depth_room=depth_table("room"),
        removal_two=removal_table("two objects"),
        removal_room=removal_table("room"),
        baselines=baseline_table(),
        abstention=abstention_table(),
        information=information,
    )


if __name__ == "__main__":
    PAGE.write_text(page(measured(PAGE.with_suffix(".csv"))), encoding="utf-8")
