"""Recipes: one TOML file a dataset, resolved and validated before anything is rendered."""

import tomllib
from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import BeforeValidator, Field, model_validator

from pcii.base.errors import InputError
from pcii.core.bayer import PATTERNS
from pcii.core.photon_events import MOST_BITS, MOST_FRAMES, Readout
from pcii.exporting.dataset_card import Terms
from simgen.base.file_lookup import find, recipe_roots
from simgen.base.strict_models import (
    Count,
    NonNegative,
    Positive,
    Real,
    Share,
    Strict,
    Title,
    Whole,
    completed_by,
    read_toml,
    shown_value,
    suggestion,
    validate,
)
from simgen.spec.camera_grid import Grid
from simgen.spectral.filters import camera_names

Cfa = Literal["GRBG", "RGGB", "BGGR", "GBRG", "none"]
ViewPass = Literal["z_mm", "object_id", "normal", "coverage"]
ViewPasses = Annotated[
    tuple[ViewPass, ...],
    BeforeValidator(
        lambda given: {True: get_args(ViewPass), False: ()}[given] if isinstance(given, bool) else given,
        json_schema_input_type=bool | tuple[ViewPass, ...],
    ),
]
Efficiency = Annotated[Real, Field(gt=0, le=1)]
MOST_PHOTONS = 1e15
"""Above, NumPy's Poisson numbers have a variance that is some per cent off."""
MOST_PATHS = 1 << 31
"""One rendering pass counts its paths in 32 bits."""
OF_ITS_SCENE = ("title", "analysis")
"""What a recipe says of its own scene alone."""
MAX_SEGMENTS = 1_000_000
"""Longer paths carry no light, and the renderer counts segments in 32 bits."""
SEED_LIMIT = 1 << 63
"""Seeds are less."""
APERTURE_TOLERANCE = 0.01
"""F-numbers are rounded by about so much."""


def override(values: dict[str, Any], overrides: Sequence[str]) -> None:
    """Put values given as `key=value` into what a recipe says; raises `InputError` for any other text."""
    for text in overrides:
        _override(values, text)


def _override(values: dict[str, Any], text: str) -> None:
    key, equals, value = text.partition("=")
    if not equals or not all(key.split(".")):
        raise InputError(f"--set: expected key=value such as photons.budget=300, got {text!r}")
    *tables, last = key.split(".")
    target = values
    for table in tables:
        target = target.setdefault(table, {})
        if not isinstance(target, dict):
            raise InputError(f"--set: {table!r} in {key!r} is a value, not a table")
    try:
        target[last] = tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        if value.startswith(("[", "{")):
            raise InputError(
                f"--set: {text!r} is a list or table that cannot be read; words in it need quotation marks, "
                'as in \'scene=["two_objects", "overlap"]\''
            ) from None
        target[last] = value


assert set(Cfa.__args__) == {*PATTERNS, "none"}


class Publication(Strict):
    """Terms under which the data may be used. Only the dataset's card says them: no data depend on them."""

    licence: Annotated[Title, Field(min_length=1)] = Terms.licence
    """Name of a licence in the SPDX list, such as "CC-BY-4.0", or the URL of another one."""
    creators: Annotated[tuple[Title, ...], Field(min_length=1)] = Terms.creators
    """Who made the data."""
    citation: Title = Terms.citation
    """How to cite the data."""
    url: Title = ""
    """Where the data are."""

    def terms(self) -> Terms:
        """The same as the type that cards are written with."""
        return Terms(**self.model_dump())


class FullLight(Strict):
    """Noise of the full-light images; needs the recipe's [exposure]."""

    full_well_e: Positive = 10_000.0
    """Electrons that a pixel holds at most."""
    read_noise_e: NonNegative = 2.0
    """Standard deviation of the noise of reading a pixel, in electrons."""
    adc_bits: Annotated[Whole, Field(ge=1, le=24)] = 12
    """The full well is read in so many steps of equal size: 2^bits - 1."""


class Sensor(Strict):
    """What stands on the pixels, and how well they count. Every fault is off by default."""

    cfa: Cfa = "GRBG"
    """Bayer pattern by its first two rows, or "none" for a monochrome sensor."""
    camera: Annotated[str | None, Field(json_schema_extra=completed_by("examples", camera_names))] = None
    """A camera's spectral sensitivities: by a name that colour-science has, such as "Nikon 5100 (NPL)", or a
    CSV file beside the recipe. Light is then traced as spectra; without, as linear sRGB, which is faster."""
    quantum_efficiency: tuple[Efficiency, Efficiency, Efficiency] = (1.0, 1.0, 1.0)
    """Chance that a photon is counted, by the pixel's colour: R, G, B; a monochrome sensor takes G. With a
    camera, of photons of the wavelength that it sees best."""
    dark_counts: NonNegative = 0.0
    """Mean number of counts that each pixel of a view has without any light."""
    hot_pixel_share: Share = 0.0
    """Share of the pixels that are hot: the same ones in every view, since one sensor takes them all."""
    hot_pixel_counts: NonNegative = 1.0
    """Mean number of counts that a hot pixel has in each view without any light."""
    dead_pixel_share: Share = 0.0
    """Share of the pixels that never count; the same ones in every view."""
    frames: Annotated[Whole, Field(ge=1, le=MOST_FRAMES)] = 1
    """The exposure is divided into so many equal frames, each with its part of photons and false counts."""
    bits: Annotated[Whole, Field(ge=1, le=MOST_BITS)] | None = None
    """A pixel stops at 2^bits - 1 counts in each frame; 1 makes it tell only whether there was a photon."""
    full_light: FullLight | None = None
    """Makes the full-light images those of a camera instead of exact radiance."""

    @property
    def bayer(self) -> str | None:
        """Bayer pattern, None for a monochrome sensor."""
        return None if self.cfa == "none" else self.cfa

    @property
    def readout(self) -> Readout:
        """Frames, and where a pixel stops in each."""
        return Readout(self.frames, self.bits)

    @property
    def is_spectral(self) -> bool:
        """Whether light is traced as spectra."""
        return self.camera is not None


class Photons(Strict):
    """How much light there is."""

    budget: Annotated[Real, Field(gt=0, le=MOST_PHOTONS)] = 1000.0
    """Expected photons that arrive in each `scope`; not used with scope "exposure"."""
    scope: Literal["view", "channel", "scene", "exposure"] = "view"
    """What `budget` is counted over: every view, each colour of every view, or all views together.
    "exposure": as many as the scene's light, the aperture and the exposure time give."""
    statistics: Literal["poisson", "multinomial"] = "poisson"
    """Poisson counts have a random total with mean `budget`; multinomial counts have it exactly."""
    nested: tuple[Positive, ...] = ()
    """Smaller budgets whose photons are kept too, each a subset of the next larger one."""

    @model_validator(mode="after")
    def _budgets_fit(self) -> Self:
        if self.scope == "exposure":
            if self.statistics != "poisson":
                raise ValueError("statistics: an exposure has no fixed total; use 'poisson'")
            if self.nested:
                raise ValueError("nested: an exposure has no budget; use scope 'view', 'channel' or 'scene'")
        elif self.nested and max(self.nested) >= self.budget:
            raise ValueError(f"nested: every budget must be less than budget = {self.budget:g}")
        if len(set(self.nested)) < len(self.nested):
            raise ValueError("nested: give each budget once")
        if self.statistics == "multinomial" and any(n % 1 for n in (self.budget, *self.nested)):
            raise ValueError("budget: with 'multinomial' statistics budgets are whole numbers")
        return self


class Exposure(Strict):
    """The camera's exposure: how much light makes how many photons."""

    f_number: Positive = 8.0
    """Focal length by diameter of the aperture."""
    time_s: Positive = 0.01
    """How long the shutter is open."""


class Render(Strict):
    """How radiance is estimated."""

    samples_per_pixel: Count = 16
    """Light paths through each pixel of the radiance images; photon counts choose their own number."""
    background_samples_per_pixel: Count | None = None
    """Paths where no object can be seen, if fewer are enough there, as for a dark backdrop."""
    max_depth: Annotated[Count, Field(le=MAX_SEGMENTS)] = 3
    """Longest light path in segments: 2 is direct light, 3 adds one bounce."""

    @model_validator(mode="after")
    def _objects_come_first(self) -> Self:
        if (self.background_samples_per_pixel or 0) > self.samples_per_pixel:
            raise ValueError("background_samples_per_pixel: expected at most samples_per_pixel")
        return self


class Products(Strict):
    """What the dataset holds beside its manifest."""

    counts: bool = True
    """Photon counts of every view: the sums over all frames."""
    frames: bool = False
    """The frame of each single count, where the sensor has several."""
    truth: bool = True
    """What every pixel of the virtual centre sees: depth, object, normal, the share of the pixel that the
    object covers, and whether it is in focus at each plane of `analysis.z_mm`."""
    visibility: bool = False
    """How many cameras see the point that each pixel of the virtual centre sees."""
    view_truth: ViewPasses = ()
    """What every pixel of every view sees: any of "z_mm", "object_id", "normal", "coverage"; true: all."""
    radiance: Literal["none", "mosaic", "rgb"] = "none"
    """Full-light images as float32 EXR: behind the Bayer pattern, or all three colours."""

    @model_validator(mode="after")
    def _parts_have_their_whole(self) -> Self:
        if self.visibility and not self.truth:
            raise ValueError("visibility: it is counted for the points of the truth; set truth = true too")
        if self.frames and not self.counts:
            raise ValueError("frames: they are those of the counts; set counts = true too")
        return self


class Analysis(Strict):
    """Where whoever opens the dataset should look; nothing of it is rendered."""

    z_mm: tuple[Positive, ...] = ()
    """Depths of the sections that `pcii run` reconstructs by default."""
    z_range_mm: tuple[Positive, Positive] | None = None
    """Nearest and farthest depth that a depth map considers."""

    @model_validator(mode="after")
    def _near_before_far(self) -> Self:
        if self.z_range_mm is not None and self.z_range_mm[0] >= self.z_range_mm[1]:
            raise ValueError("z_range_mm: near must be less than far")
        return self


class Recipe(Strict):
    """A dataset: which scene, seen by which cameras, in how much light, and what is kept."""

    title: Title = ""
    """What reports and pictures call it; the scene's title unless given."""
    scene: Annotated[str, Field(min_length=1)]
    """Name of a scene that ships, path of a scene folder (relative paths: to the recipe), or a Python
    function that draws scenes, as "module:function" or "file.py:function"."""
    scene_number: Annotated[Whole, Field(ge=0, lt=SEED_LIMIT)] | None = None
    """Which scene of those that a Python function draws; none for a single scene."""
    seed: Annotated[Whole, Field(ge=0, lt=SEED_LIMIT)] = 0
    """All that is random follows from it and from what is drawn: the same recipe, the same bytes."""
    grid: Grid = Grid()
    sensor: Sensor = Sensor()
    photons: Photons = Photons()
    exposure: Exposure | None = None
    """Needed where light is absolute: photons.scope "exposure", sensor.full_light."""
    render: Render = Render()
    products: Products = Products()
    analysis: Analysis = Analysis()
    publication: Publication = Publication()

    @model_validator(mode="after")
    def _one_pass_renders_a_view(self) -> Self:
        grid, samples = self.grid, self.render.samples_per_pixel
        paths = samples * grid.height * grid.width
        if paths >= MOST_PATHS:
            raise ValueError(
                f"a view of {grid.height} x {grid.width} pixels with {samples} samples each is {paths} "
                f"paths; fewer than {MOST_PATHS} can be rendered at once"
            )
        return self

    @model_validator(mode="after")
    def _exposure_is_known(self) -> Self:
        if self.exposure is None and self.photons.scope == "exposure":
            raise ValueError("photons.scope: 'exposure' needs the table [exposure] with f_number and time_s")
        if self.exposure is None and self.sensor.full_light is not None:
            raise ValueError("sensor.full_light: needs the table [exposure] with f_number and time_s")
        return self

    @model_validator(mode="after")
    def _one_aperture(self) -> Self:
        if self.exposure is not None and self.grid.lens is not None:
            expected_mm = self.grid.focal_mm / self.exposure.f_number
            if abs(self.grid.lens.aperture_mm / expected_mm - 1) > APERTURE_TOLERANCE:
                raise ValueError(
                    f"grid.lens.aperture_mm: focal_mm / exposure.f_number is {expected_mm:g} mm, "
                    f"and aperture_mm is {self.grid.lens.aperture_mm:g}; make them agree"
                )
        return self

    @property
    def is_spectral(self) -> bool:
        """Whether light is traced as spectra."""
        return self.sensor.is_spectral

    @property
    def cfa(self) -> str | None:
        """Bayer pattern, None for a monochrome sensor."""
        return self.sensor.bayer


def load_recipe(
    name_or_path: str, overrides: Sequence[str] = (), *, trust_python: bool = False
) -> tuple[Recipe, Path]:
    """A recipe by path or shipped name, with `key=value` overrides; and its folder.

    A key is dotted (`photons.budget=300`), a value is TOML or else taken as a string. With another scene the
    recipe's title and analysis, which are of its own scene, are dropped but for what is given too.
    Raises `InputError` for a recipe that is missing or wrong.
    """
    values, source, recipe_folder = read_recipe(name_or_path, overrides, trust_python=trust_python)
    return validate(Recipe, values, source), recipe_folder


def read_recipe(
    name_or_path: str, overrides: Sequence[str] = (), *, trust_python: bool = False
) -> tuple[dict[str, Any], str, Path]:
    """What a recipe and its overrides say, before it is checked; what to call both; and the folder.

    Raises `InputError` for a file that names a Python function, unless its author is trusted to run code:
    overrides are the person's own.
    """
    path = recipe_file(name_or_path)
    if path is None:
        names = {file.stem for root in recipe_roots() for file in root.glob("*.toml")}
        raise InputError(f"recipe: there is no {name_or_path!r}{suggestion(Path(name_or_path).stem, names)}")
    written = read_toml(path)
    if not trust_python and ":" in str(written.get("scene", "")):
        raise InputError(
            f"{path}: scene: {shown_value(written['scene'])} runs Python code of the recipe's author; "
            "if you trust it, add --trust-python (in Python trust_python=True)"
        )
    values = deepcopy(written)
    override(values, overrides)
    if values.get("scene") != written.get("scene"):
        values = {name: value for name, value in written.items() if name not in OF_ITS_SCENE}
        override(values, overrides)
    source = str(path) if not overrides else f"{path} with --set {' '.join(overrides)}"
    return values, source, path.parent


def recipe_file(name_or_path: str) -> Path | None:
    """The file of a recipe by path or shipped name, None if there is none."""
    path = Path(name_or_path)
    if path.is_file():
        return path
    shipped = find(recipe_roots, f"{name_or_path.removesuffix('.toml')}.toml")
    return shipped if path.parent == Path() else None
