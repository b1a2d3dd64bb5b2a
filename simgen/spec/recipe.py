"""Recipes: one TOML file a dataset, resolved and validated before anything is rendered."""

from typing import Annotated, Literal, Self, get_args

from pydantic import BeforeValidator, Field, model_validator

from pcii.store import Terms
from pcii.types import MOST_BITS, MOST_FRAMES, CameraGrid, Readout
from simgen.base import LARGEST_MM, Count, Length, NonNegative, Positive, Real, Share, Strict, Title, Whole
from simgen.spectral import camera_names

MAX_SHEAR_PX = 1e9
"""Larger shears would overflow the shifts of views, which are 32-bit numbers of pixels."""
MAX_HALF_WIDTHS_PER_FOCAL = 1e4
"""Half a view's width by its focal length: if much larger, views are rounded to 180 degrees."""
MOST_PHOTONS = 1e15
"""Above, NumPy's Poisson numbers have a variance that is some per cent off."""
MOST_PATHS = 1 << 31
"""One rendering pass counts its paths in 32 bits."""
MAX_SEGMENTS = 1_000_000
"""Longer paths carry no light, and the renderer counts segments in 32 bits."""
SEED_LIMIT = 1 << 63
"""Seeds are less."""
APERTURE_TOLERANCE = 0.01
"""F-numbers are rounded by about so much."""
Cfa = Literal["GRBG", "RGGB", "BGGR", "GBRG", "none"]
ViewPass = Literal["z_mm", "object_id", "normal", "coverage"]
ViewPasses = Annotated[
    tuple[ViewPass, ...],
    BeforeValidator(
        lambda value: {True: get_args(ViewPass), False: ()}[value] if isinstance(value, bool) else value,
        json_schema_input_type=bool | tuple[ViewPass, ...],
    ),
]
Efficiency = Annotated[Real, Field(gt=0, le=1)]
Spread = Annotated[Real, Field(ge=0, le=LARGEST_MM)]
Shear = Annotated[Real, Field(ge=-MAX_SHEAR_PX, le=MAX_SHEAR_PX)]


class CalibrationErrors(Strict):
    """How far the cameras are off. The truth keeps it; the grid that a dataset opens with does not."""

    position_sd_mm: tuple[Spread, Spread, Spread] = (0.0, 0.0, 0.0)
    """Standard deviation of each camera's place along X, Y and Z."""
    rotation_sd_deg: tuple[NonNegative, NonNegative, NonNegative] = (0.0, 0.0, 0.0)
    """Standard deviation of each camera's turn about X (tilt), Y (pan) and Z (roll)."""
    pitch_error: Annotated[Real, Field(gt=-1, le=1)] = 0.0
    """The true pitch is (1 + this) times `pitch_mm`, along both axes."""


class Lens(Strict):
    """A thin lens in place of each pinhole: what is not at the depth in focus is blurred."""

    aperture_mm: Length
    """Diameter of the lens."""
    focus_mm: Length
    """Planar depth from the camera that is in focus."""


class Grid(Strict):
    """The camera grid: parallel cameras in the plane Z = 0, pinholes unless they have a lens."""

    rows: Count = 10
    """Rows of cameras, counted from the top."""
    cols: Count = 10
    """Columns of cameras, counted from the left."""
    pitch_mm: tuple[Length, Length] = (5.0, 5.0)
    """Distance between neighbouring cameras, (x, y)."""
    focal_mm: Length = 50.0
    """Distance from pinhole to sensor."""
    pixel_mm: Length = 0.0352
    """Side of a square pixel."""
    height: Count = 1024
    """Rows of pixels of one view."""
    width: Count = 1024
    """Columns of pixels of one view."""
    shear_px: tuple[Shear, Shear] = (0.0, 0.0)
    """Each camera's axis meets its film so many pixels further right and down than that of the camera before;
    with focal pitch / (z pixel) the cameras converge at depth z."""
    errors: CalibrationErrors | None = None
    lens: Lens | None = None

    @model_validator(mode="after")
    def _can_be_built(self) -> Self:
        least_mm = max(self.width, self.height) * self.pixel_mm / 2 / MAX_HALF_WIDTHS_PER_FOCAL
        if self.focal_mm < least_mm:
            raise ValueError(f"focal_mm: {least_mm:g} mm or more is needed for views of this size")
        if self.lens is not None and self.shear_px != (0, 0):
            raise ValueError(
                "shear_px: the film behind a lens cannot be shifted; leave out shear_px or the lens"
            )
        return self

    def camera_grid(self) -> CameraGrid:
        """The same grid as the type that the dataset is written with, where cameras ought to be."""
        return CameraGrid(**self.model_dump(exclude={"errors", "lens"}))


class Publication(Strict):
    """Terms under which the data may be used, for the dataset's card; no data depend on them."""

    licence: Title = ""
    """Name of a licence in the SPDX list, such as "CC-BY-4.0", or the URL of another one."""
    creators: tuple[Title, ...] = ()
    citation: Title = ""
    url: Title = ""

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
    camera: Annotated[
        str | None, Field(json_schema_extra=lambda schema: schema.update(examples=[*camera_names()]))
    ] = None
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
    hot_pixels: Annotated[str | None, Field(exclude_if=lambda name: name is None)] = None
    """A map of further dark counts, such as a measured one: a .npy file in the recipe's folder with the mean
    number of counts that each pixel of a view has without any light, (H, W), or (K, L, H, W) if cameras
    differ."""
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
        if self.scope == "exposure" and (self.nested or self.statistics != "poisson"):
            raise ValueError("scope: an exposure has no budget, so no 'nested' and no fixed total")
        if self.scope != "exposure" and max(self.nested, default=0) >= self.budget:
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

    profile: Annotated[Literal["full", "training"], Field(exclude_if=lambda name: name == "full")] = "full"
    """"training": what networks learn from, packed in one file: photon counts, and of the truth depth,
    objects and what is in focus; neither normals, coverage nor the origins of photons."""
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
    def _fit_each_other(self) -> Self:
        if self.visibility and not self.truth:
            raise ValueError("visibility: it is counted for the points of the truth; set truth = true too")
        if self.frames and not self.counts:
            raise ValueError("frames: they are those of the counts; set counts = true too")
        others = {"radiance": self.radiance != "none", "visibility": self.visibility}
        others["view_truth"] = bool(self.view_truth)
        if self.profile == "training" and any(others.values()):
            names = " and ".join(name for name, is_wanted in others.items() if is_wanted)
            raise ValueError(f'profile: "training" leaves out {names}; leave {names} out, or profile')
        return self

    @property
    def origins(self) -> bool:
        """Whether the object and depth that each photon comes from are kept."""
        return self.truth and self.profile == "full"


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
    def _parts_fit_each_other(self) -> Self:
        grid, exposure = self.grid, self.exposure
        paths = self.render.samples_per_pixel * grid.height * grid.width
        if paths >= MOST_PATHS:
            raise ValueError(
                f"render.samples_per_pixel: a view has {paths} paths; fewer than {MOST_PATHS} can be rendered"
            )
        if exposure is None:
            if self.photons.scope == "exposure" or self.sensor.full_light is not None:
                raise ValueError("exposure: photons.scope = 'exposure' and sensor.full_light need this table")
        elif grid.lens is not None:
            expected_mm = grid.focal_mm / exposure.f_number
            if abs(grid.lens.aperture_mm / expected_mm - 1) > APERTURE_TOLERANCE:
                raise ValueError(
                    f"grid.lens.aperture_mm: focal_mm / exposure.f_number is {expected_mm:g} mm, "
                    f"and aperture_mm is {grid.lens.aperture_mm:g}; make them agree"
                )
        return self

    @property
    def is_spectral(self) -> bool:
        """Whether light is traced as spectra."""
        return self.sensor.camera is not None

    @property
    def cfa(self) -> str | None:
        """Bayer pattern, None for a monochrome sensor."""
        return self.sensor.bayer
