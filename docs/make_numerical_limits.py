"""Write docs/numerical_limits.md: `python docs/make_numerical_limits.py`.

Every cell of the table is what a real call gives; a cell that is no value, no documented NaN and no clear
refusal stops the script.
"""

import inspect
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from PIL import Image

import pcii
import simgen

PAGE = Path(__file__).resolve().with_suffix("").with_name("numerical_limits.md")
VALUE, NAN, REFUSED, NOT = "value", "NaN, documented", "refused", "·"
CONDITIONS = {
    "black": "no photons, all black",
    "single": "one photon, one bright pixel",
    "constant": "constant",
    "bright": "bright",
    "too bright": "too bright",
    "not finite": "NaN or infinity",
    "negative": "negative",
    "1 x 1": "1 × 1",
    "bad depth": "depth not above 0",
    "beyond": "shifts beyond the image",
}
SCENES = {f"simgen.spec.{name}" for name in ("scene", "lights", "materials", "shapes")}
NO_NUMBERS = {
    "Collection": "a table of datasets",
    "Examples": "a sequence of examples",
    "examples": "checks its options, and data as `PhotonCounts` and `Truth` are",
    "FocalPlanes": "checked as `z_mm` of `reconstruct` is",
    "TrueFocus": "made of a `Truth`",
    "mean_interval": "means of scores",
    "sign_flip_p": "means of scores",
    "verify": "reads a folder",
    "InputError": "the refusal itself",
    "ViewOrder": "four switches",
    "FrameFormat": "checked by `import_counts`",
    "depth_methods": "names",
    "removal_methods": "names",
    "open_collection": "opens a folder",
    "sample": "opens a folder",
    "evaluate": "scores as `score` does",
    "import_hci": "reads pictures as `import_images` does",
    "Sections": "made by `reconstruct`",
    "DepthPosterior": "made by `depth_posterior`",
    "Segmented": "made by `segment`",
    "Score": "made by `score`",
    "Executor": "worker processes",
    "RecipeFile": "made by `load_recipe`",
    "import_scene": "reads a file of another program",
    "ImportedScene": "what `import_scene` says",
    "load_scene": "reads a file",
    "render": "takes its numbers as `load_recipe` does",
    "generate": "draws as `draw_photons` does, with the numbers of a recipe",
    "generate_collection": "draws as `draw_photons` does, with the numbers of a recipe",
    "preview": "a picture of a scene",
    **dict.fromkeys(("CalibrationErrors", "Lens", "Sensor"), "checked as a part of a recipe is"),
    **dict.fromkeys(
        (name for name in simgen.__all__ if name != "Scene" and getattr(simgen, name).__module__ in SCENES),
        "checked as a `Scene` is",
    ),
}
"""Public names that are not called, and why."""


Options = dict[str, Any]
OPTIONS: dict[str, Options] = {
    "": {},
    ", variance": {"variance": True},
    ", subpixel 2": {"subpixel": 2},
}
TEXT = """# Numerical limits

What the numbers of `pcii` can hold, where they are exact, and what the functions say to numbers that they
cannot use. `tests/stress` checks all of this, the small sizes in `make test` and the large ones in `make
stress`.

## Exact

* Photon counts are integers until the last division. A pixel holds up to 2^40 photons (10^12), all views
  together up to 2^63 − 1; sums of any number of views are exact up to that, by events or by images.
* The variance of photon counts (`reconstruct(counts, ..., variance=True)`) is made in integers: (m Q − S²)
  / (m (m − 1)) of m samples with the sum S and the sum of squares Q. It is refused where m Q might exceed
  2^63: 100 views of 10 million photons per pixel are fine, and 100 views of 100 million are not.
* Shifts are whole pixels, from the disparity in double precision; they reach up to 2^31 px.
* Results are the same to the bit for any number of threads and in any run. Radiance that is read from disk
  in batches is added in another order than that in memory, which may differ in the last bit.

## Bounded

* Radiance is added in double precision. Sums of n samples are off by at most n × 1.1 × 10^−16 of the sum of
  their magnitudes; float32 and float16 views give float32 sections, rounded once, 6 × 10^−8.
* Variances of radiance are of the differences from a voxel's first sample. With a mean of 10^6 standard
  deviations they are right to 10^−9, and so are the standard deviations of NIST's reference data (NumAcc1
  to 4, PiDigits, Lottery and others) to 8 digits or more. Numbers that float32 cannot hold, such as 10 000
  000.2, must be given as float64.
* Variances over views in windows, which `segment` uses, are in double precision and exact where the sum of
  squared differences times the number of views is below 2^53.
* Depth from radiance does not depend on the unit of radiance.

## Refused

A refusal is a `pcii.InputError`, one sentence that names the argument or the file: NaN and infinity; light
below 0 where photons are drawn from it; fractions of photons; depths not above 0, and those so near that
views shift by more than 2^31 px; more than 10^12 photons expected of a view by `limit_photons`; radiance so
large that a sum is no number of its type, and, for variances, so large that squares of
differences are none (above 10^19 in float32, 10^154 in float64).

## What each function gives

Made by `python docs/make_numerical_limits.py` from real calls with warnings as errors; a test makes it
anew. *value*: finite numbers. *NaN, documented*: there is NaN (or infinity) that the docstring describes,
such as pixels without a depth. *refused*: `InputError`. A dot: the function has no such argument. "Value or
refused": by how negative, or which of NaN and the infinities.

Views are 3 × 3 of 32 × 32 pixels. *Bright* is 2^40 photons in every pixel, radiance of 10^12 or 10^12
photons per view; *too bright* is 2^41 photons in a pixel, radiance of 10^308, pictures of 10^39 and budgets
above 10^12. *Depth not above 0* is 0, −1, NaN and infinity. *Shifts beyond the image* are of 1000 px.

{table}

Not in the table: {without}.
"""


class NotApplicableError(Exception):
    """The function has no such argument."""


@dataclass(frozen=True)
class Case:
    """One condition, and how each kind of argument looks under it."""

    condition: str
    bad: float = 0.0
    """The number that is wrong, of conditions with several."""
    folder: Path = Path()

    def need(self, *conditions: str) -> None:
        if self.condition not in conditions:
            raise NotApplicableError

    def without(self, *conditions: str) -> None:
        if self.condition in conditions:
            raise NotApplicableError

    @property
    def grid(self) -> pcii.CameraGrid:
        side = 1 if self.condition == "1 x 1" else 32
        return pcii.CameraGrid(
            rows=3, cols=3, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.25, height=side, width=side
        )

    @property
    def z_mm(self) -> float:
        """2 px of disparity, 1000 px, or the depth that is wrong."""
        return {"bad depth": self.bad, "beyond": 1.0}.get(self.condition, 500.0)

    @property
    def z_range_mm(self) -> tuple[float, float]:
        """A range about `z_mm`, whose parallax does not span too much to be searched."""
        return (0.99, 1.0) if self.condition == "beyond" else (self.z_mm, 900.0)

    def film(self, shape: tuple[int, ...], bright: float, too_bright: float) -> np.ndarray:
        """Numbers (float64) of this shape; all conditions that are not of numbers have a constant film."""
        level = {"black": 0.0, "single": 0.0, "bright": bright, "too bright": too_bright}
        film = np.full(shape, level.get(self.condition, 3.0))
        if self.condition == "single":
            film.flat[film.size // 2] = 1.0
        if self.condition in ("not finite", "negative"):
            film.flat[film.size // 2] = self.bad
        return film

    def light(self, channels: int = 1, too_bright: float = 1e308) -> np.ndarray:
        return self.film((*self.grid.shape_KLHW, channels), 1e12, too_bright)

    def views(self, channels: int = 1, cfa: str | None = None) -> pcii.Views:
        return pcii.Views(self.light(channels), self.grid, cfa)

    def counts_KLHW(self) -> np.ndarray:
        film = self.film(self.grid.shape_KLHW, 2**40, 2**41)
        return film if self.condition in ("not finite", "negative") else film.astype(np.int64)

    def counts(self, cfa: str | None = None) -> pcii.PhotonCounts:
        """Counts that exist already; what no counts can hold does not apply."""
        self.without("not finite", "negative", "too bright")
        return pcii.PhotonCounts.from_dense(self.counts_KLHW(), self.grid, cfa=cfa)

    @property
    def side(self) -> tuple[int, int]:
        """Height and width of an image."""
        return self.grid.height, self.grid.width

    @property
    def length(self) -> float:
        """A length of an argument that is no film."""
        self.need("not finite", "negative", "1 x 1")
        return 1.0 if self.condition == "1 x 1" else self.bad

    @property
    def optics(self) -> pcii.Optics:
        return pcii.Optics(pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.25)

    @property
    def truth(self) -> pcii.Truth:
        return pcii.Truth(np.full(self.side, 500.0), np.ones(self.side, int), {1: "wall"})


def _from_events(case: Case) -> pcii.PhotonCounts:
    n = case.counts_KLHW().ravel()
    k, l, i, j = np.indices(case.grid.shape_KLHW).reshape(4, -1)
    return pcii.PhotonCounts.from_events(k, l, i, j, n, case.grid)


def _grid(case: Case) -> pcii.CameraGrid:
    return pcii.CameraGrid(
        rows=1, cols=1, pitch_mm=(5, 5), focal_mm=50, pixel_mm=case.length, height=1, width=1
    )


def _map(case: Case, kind: type) -> Any:
    """A `Truth` or a `DepthMap` of which one depth is that of the case."""
    case.need("constant", "bad depth", "1 x 1")
    z_mm = np.full(case.side, 500.0)
    z_mm[0, 0] = case.z_mm
    if np.isinf(case.z_mm):
        raise NotApplicableError  # a miss, which maps may have
    if kind is pcii.Truth:
        return pcii.Truth(z_mm, np.ones(z_mm.shape, int), {1: "wall"})
    return pcii.DepthMap(z_mm, np.ones(z_mm.shape))


def _counts(level: int) -> pcii.PhotonCounts:
    grid = Case("constant").grid
    return pcii.PhotonCounts.from_dense(np.full(grid.shape_KLHW, level), grid)


def _photons(case: Case) -> float:
    """Expected photons of a view."""
    case.without("single", "bad depth", "beyond", "1 x 1")
    return case.film((1,), 1e12, 1e13)[0]


def _limited(case: Case) -> pcii.PhotonCounts:
    """Of constant light: the budget is that of the case."""
    return pcii.limit_photons(Case("constant").views(), _photons(case), seed=1)


def _rng() -> np.random.Generator:
    return np.random.default_rng(0)


def _score(case: Case) -> pcii.Score:
    case.without("bad depth")
    counts, z_range = case.counts(), case.z_range_mm
    focus = pcii.segment(counts, case.z_mm, method="brightness")
    depth = pcii.estimate_depth(counts, z_range, method="posterior")
    return pcii.score(focus, depth, case.truth)


def _images(case: Case) -> pcii.Views:
    import tifffile

    light = case.light(3, 1e39)
    for k, l in np.ndindex(3, 3):
        tifffile.imwrite(case.folder / f"{k}_{l}.tif", light[k, l], photometric="rgb")
    return pcii.import_images(case.folder, "{row}_{col}.tif", case.optics)


def _lens_array(case: Case) -> pcii.Views:
    import tifffile

    case.without("bad depth", "beyond")
    side = 3 * case.grid.height
    picture = case.film((side, side), 1e12, 1e39)
    tifffile.imwrite(case.folder / "lenses.tif", picture, photometric="minisblack")
    lenses = pcii.LensArray(rows=3, cols=3, pitch_px=(side / 3, side / 3))
    return pcii.import_lens_array(case.folder / "lenses.tif", lenses, case.optics)


def _saved(case: Case) -> pcii.Dataset:
    z_mm = case.z_mm if case.condition in ("bad depth", "beyond") else None
    return pcii.save_dataset(case.folder / "set", case.counts(), z_mm=z_mm)


def _saved_views(case: Case) -> pcii.Dataset:
    case.without("bad depth", "beyond")
    return pcii.save_dataset(case.folder / "set", case.views(3))


def _exported(case: Case, format: Any) -> Any:
    """The pictures of an export."""
    case.without("bad depth", "beyond")
    images: list[Any] = [case.views(1)] if format in ("hci", "nerfstudio") else []
    dataset = pcii.save_dataset(case.folder / "set", [*images, case.counts()], case.truth)
    out = pcii.export_dataset(dataset, format, case.folder / "out")
    return [np.asarray(Image.open(file)) for file in out.rglob("*.png")]


def _draw(case: Case) -> Any:
    """A budget of no photons or of an impossible number; photons themselves are drawn by a renderer."""
    case.need("black", "too bright", "not finite", "negative")
    budget = {"black": 0.0, "too bright": 1e300}.get(case.condition, case.bad)
    return simgen.draw_photons(simgen.load_scene("two_objects"), case.grid, budget=budget)


def _scene(case: Case) -> float:
    """Light, or the depth of a wall."""
    case.without("single", "constant", "1 x 1", "beyond")
    luminance = {"black": 0.0, "bright": 1e12, "too bright": 1e308, "bad depth": 1.0}
    lamp = simgen.UniformLight(luminance_cd_m2=luminance.get(case.condition, case.bad))
    wall = simgen.Backdrop(z_mm=case.z_mm)
    simgen.Scene(title="of numbers", lights=(lamp,), backdrop=wall)
    return lamp.luminance_cd_m2


def _recipe(case: Case) -> float:
    case.without("single", "constant", "beyond")
    budget = {"black": 0.0, "bright": 1e12, "too bright": 1e300, "1 x 1": 1.0}.get(case.condition, case.bad)
    override = f"analysis.z_mm=[{case.bad}]" if case.condition == "bad depth" else f"photons.budget={budget}"
    sizes = ["grid.height=1", "grid.width=1"] if case.condition == "1 x 1" else []
    return simgen.load_recipe("paper", [override, *sizes]).recipe.photons.budget


def _sections_of_counts(options: Options) -> Callable[[Case], Any]:
    return lambda case: pcii.reconstruct(case.counts(), case.z_mm, **options)


def _sections_of_views(options: Options) -> Callable[[Case], Any]:
    return lambda case: pcii.reconstruct(case.views(), case.z_mm, **options)


def _of_light(call: Callable[[Case], Any]) -> Callable[[Case], Any]:
    """The call, for functions without a depth."""

    def checked(case: Case) -> Any:
        case.without("bad depth", "beyond")
        return call(case)

    return checked


def _nothing(sentence: str) -> None:
    """Leave remarks on counts aside: those of a condition are all alike."""


def rows() -> dict[str, tuple[str, Callable[[Case], Any]]]:
    """Calls by the label of their row, each with the public name that it is a call of."""
    table: dict[str, tuple[str, Callable[[Case], Any]]] = {
        "CameraGrid": ("CameraGrid", _grid),
        "Optics": ("Optics", lambda case: pcii.Optics(pitch_mm=(5, 5), focal_mm=50, pixel_mm=case.length)),
        "LensArray": ("LensArray", lambda case: pcii.LensArray(rows=1, cols=1, pitch_px=(case.length, 1.0))),
        "PhotonCounts.from_dense": (
            "PhotonCounts",
            _of_light(lambda case: pcii.PhotonCounts.from_dense(case.counts_KLHW(), case.grid)),
        ),
        "PhotonCounts.from_events": ("PhotonCounts", _of_light(_from_events)),
        "PhotonCounts.subsample": (
            "PhotonCounts",
            _of_light(lambda case: _counts(3).subsample(case.film((1,), 2**40, 2**41)[0], _rng())),
        ),
        "Views, read by view(k, l)": ("Views", _of_light(lambda case: case.views().view(1, 1))),
        "Truth": ("Truth", lambda case: _map(case, pcii.Truth)),
        "DepthMap": ("DepthMap", lambda case: _map(case, pcii.DepthMap)),
    }
    for name, options in OPTIONS.items():
        table[f"reconstruct, photons{name}"] = ("reconstruct", _sections_of_counts(options))
    for name, options in OPTIONS.items():
        table[f"reconstruct, radiance{name}"] = ("reconstruct", _sections_of_views(options))
    table["demosaic"] = (
        "demosaic",
        _of_light(lambda case: pcii.demosaic(case.film(case.side, 1e12, 1e308))),
    )
    for method in (*pcii.removal_methods(), pcii.ThreeStep(entropy=False)):
        own = not isinstance(method, str)
        table["ThreeStep" if own else f"segment, {method}"] = (
            "ThreeStep" if own else "segment",
            lambda case, m=method: pcii.segment(case.counts("GRBG"), [case.z_mm, 900.0], method=m),
        )
    for method in pcii.depth_methods(_counts(0)):
        table[f"estimate_depth, photons, {method}"] = (
            "estimate_depth",
            lambda case, m=method: pcii.estimate_depth(case.counts(), case.z_range_mm, method=m),
        )
    for method in pcii.depth_methods(Case("black").views()):
        table[f"estimate_depth, radiance, {method}"] = (
            "estimate_depth",
            lambda case, m=method: pcii.estimate_depth(case.views(), case.z_range_mm, method=m),
        )
    for kind, data in (("photons", Case.counts), ("radiance", Case.views)):
        table[f"depth_posterior, {kind}"] = (
            "depth_posterior",
            lambda case, data=data: pcii.depth_posterior(data(case), case.z_range_mm),
        )
    return table | {
        "Light": ("Light", lambda case: pcii.Light(_photons(case))),
        "limit_photons, light": (
            "limit_photons",
            _of_light(lambda case: pcii.limit_photons(case.views(), 1000, seed=1)),
        ),
        "limit_photons, budget": ("limit_photons", _limited),
        "srgb_to_linear": (
            "srgb_to_linear",
            _of_light(lambda case: pcii.srgb_to_linear(case.film((2, 2), 1.0, 1e300))),
        ),
        "score": ("score", _score),
        "check_grid": (
            "check_grid",
            lambda case: pcii.check_grid(case.views(1), case.z_range_mm),
        ),
        "save_dataset and open_dataset, photons": ("open_dataset", _saved),
        "save_dataset and open_dataset, radiance": ("save_dataset", _saved_views),
        "Dataset.counts": ("Dataset", lambda case: _saved(case).counts),
        "export_dataset, events": ("export_dataset", lambda case: _exported(case, "events")),
        "export_dataset, hci": ("export_dataset", lambda case: _exported(case, "hci")),
        "export_dataset, nerfstudio": ("export_dataset", lambda case: _exported(case, "nerfstudio")),
        "import_arrays": (
            "import_arrays",
            _of_light(lambda case: pcii.import_arrays(case.light(), case.optics)),
        ),
        "import_arrays, gamma": (
            "import_arrays",
            _of_light(lambda case: pcii.import_arrays(case.light(), case.optics, encoding=2.2)),
        ),
        "import_counts": (
            "import_counts",
            _of_light(lambda case: pcii.import_counts(case.counts_KLHW(), case.optics, note=_nothing)),
        ),
        "import_images": ("import_images", _of_light(_images)),
        "import_lens_array": ("import_lens_array", _of_light(_lens_array)),
        "simgen.Scene": ("simgen.Scene", _scene),
        "simgen.load_recipe": ("simgen.load_recipe", _recipe),
        "simgen.draw_photons, budget": ("simgen.draw_photons", _draw),
    }


def conditions_of(condition: str) -> tuple[float, ...]:
    """The numbers that a condition is tried with."""
    return {
        "not finite": (np.nan, np.inf, -np.inf),
        "negative": (-1.0, -1e12),
        "bad depth": (0.0, -1.0, np.nan, np.inf),
    }.get(condition, (0.0,))


def cell(call: Callable[[Case], Any], condition: str, name: str) -> str:
    """What a call gives under a condition; raises AssertionError for what nobody would expect."""
    found = {_outcome(call, condition, bad, name) for bad in conditions_of(condition)}
    return " or ".join(one for one in (VALUE, NAN, REFUSED) if one in found) or NOT


def _outcome(call: Callable[[Case], Any], condition: str, bad: float, name: str) -> str:
    with TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            arrays = list(numbers_in(call(Case(condition, bad, Path(folder)))))
        except NotApplicableError:
            return NOT
        except pcii.InputError as fault:
            if not re.match(r"[^:]+: .", str(fault)):
                raise AssertionError(f"{name}: no argument is named: {fault}") from None
            return REFUSED
    if all(np.isfinite(array).all() for array in arrays):
        return VALUE
    documented = inspect.getdoc(_public(name)) or ""
    assert any(word in documented for word in ("NaN", "infinity")), f"{name}, {condition}: undocumented NaN"
    return NAN


def numbers_in(result: Any) -> Iterator[np.ndarray]:
    """All arrays of real numbers in a result, however deep."""
    if isinstance(result, pcii.PhotonCounts):
        yield result.events.n
    elif isinstance(result, pcii.Sections):
        yield result.estimate
    if is_dataclass(result) and not isinstance(result, type):
        result = [getattr(result, field.name) for field in fields(result)]
    if isinstance(result, Mapping):
        result = list(result.values())
    if isinstance(result, list | tuple):
        for part in result:
            yield from numbers_in(part)
    elif isinstance(result, np.ndarray | float | int) and np.asarray(result).dtype.kind in "fiub":
        yield np.asarray(result)


def _public(name: str) -> Any:
    package, _, own = name.rpartition(".")
    return getattr(simgen if package == "simgen" else pcii, own)


def table() -> str:
    """The table in Markdown."""
    lines = ["| |" + "|".join(CONDITIONS.values()) + "|", "|---" * (len(CONDITIONS) + 1) + "|"]
    return "\n".join([*lines, *(row(label, name, call) for label, (name, call) in rows().items())])


def row(label: str, name: str, call: Callable[[Case], Any]) -> str:
    """A line of the table: what a call gives in each condition."""
    return f"| {label} |" + "|".join(cell(call, one, name) for one in CONDITIONS) + "|"


def page() -> str:
    """The whole page."""
    reasons = dict.fromkeys(NO_NUMBERS.values())
    groups = {
        reason: [f"`{name}`" for name in NO_NUMBERS if NO_NUMBERS[name] == reason] for reason in reasons
    }
    without = "; ".join(f"{', '.join(names)} ({reason})" for reason, names in groups.items())
    return TEXT.format(table=table(), without=without)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
