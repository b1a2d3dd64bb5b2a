"""The command `pcii import`: images made by others become a dataset; and its options."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from pcii.app.command_options import Depths, Out
from pcii.base.command_output import answer, results_folder, say, say_next
from pcii.base.errors import InputError
from pcii.base.progress import Stages
from pcii.core.arrays import check_z_mm
from pcii.core.images import Views
from pcii.core.photon_counts import PhotonCounts
from pcii.core.photon_limit import Light, limit_photons
from pcii.importing.camera_order import Optics
from pcii.importing.import_advice import checked
from pcii.importing.import_requests import Imported, Request, ViewOptions, WholePair, read
from pcii.importing.lens_arrays import LensArray
from pcii.importing.light_encoding import Encoding, check_encoding
from pcii.io.dataset import Dataset
from pcii.io.dataset_writer import check_depth_range, held_dataset, save_dataset
from pcii.transforms.film_sizes import FilmSize
from pcii.transforms.transforms_file import TRANSFORMS

Pair = tuple[float, float] | None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class LensOptions:
    """Where lenses are in a picture of a lens array."""

    lens_array: WholePair = None
    """Rows and columns of lenses whose images one picture holds side by side."""
    lens_pitch_px: Pair = None
    """Distance from lens to lens in the picture, x and y; need not be whole."""
    lens_offset_px: Pair = None
    """Left upper corner of the first lens image, x and y. Default: 0 0."""
    inverted: bool = False
    """Each lens image is upside down, as a sensor right behind the lenses sees it."""

    def lenses(self) -> LensArray | None:
        """The lens array; None if there is none. `InputError` if only a part of it is said."""
        if self.lens_array is None:
            if self != LensOptions():
                raise InputError("--lens-pitch-px, --lens-offset-px, --inverted: are for --lens-array")
            return None
        if self.lens_pitch_px is None:
            raise InputError("--lens-pitch-px: missing; a lens array needs the distance from lens to lens")
        return LensArray(
            rows=self.lens_array[0],
            cols=self.lens_array[1],
            pitch_px=self.lens_pitch_px,
            offset_px=self.lens_offset_px or (0.0, 0.0),
            inverted=self.inverted,
        )


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class CameraOptions:
    """Where cameras stand and how they see."""

    pitch_mm: Pair = None
    """Distance between neighbouring cameras, x and y. Of a lens array: its lens pitch in pixels, by
    default."""
    focal_mm: float | None = None
    """Focal length: from the pinhole to the sensor."""
    sensor_mm: float | None = None
    """Width of the sensor that a whole picture shows."""
    pixel_mm: float | None = None
    """Side of a pixel, instead of --sensor-mm."""
    shear_px: Pair = None
    """Disparity, x and y, that was taken out of the pictures of a converging grid."""

    def film(self) -> FilmSize | None:
        """The one length that is said beside a transforms.json; `InputError` for what that tells itself."""
        if self.pitch_mm is not None or self.shear_px is not None:
            raise InputError(
                f"--pitch-mm, --shear-px: {TRANSFORMS} tells where cameras are; leave them out, or give "
                "--pattern"
            )
        if self.focal_mm is None and self.sensor_mm is None and self.pixel_mm is None:
            return None
        return FilmSize(focal_mm=self.focal_mm, sensor_mm=self.sensor_mm, pixel_mm=self.pixel_mm)

    def optics(self, lenses: LensArray | None) -> Optics | None:
        """The cameras' optics; None if nothing is said of them. `InputError` if only a part is."""
        pitch_mm, pixel_mm = self.pitch_mm, self.pixel_mm
        if lenses is not None and pitch_mm is None and pixel_mm is not None:
            pitch_mm = lenses.pitch_px[0] * pixel_mm, lenses.pitch_px[1] * pixel_mm
        size = self.sensor_mm if pixel_mm is None else pixel_mm
        needed = {"--pitch-mm": pitch_mm, "--focal-mm": self.focal_mm, "--sensor-mm or --pixel-mm": size}
        missing = [name for name, value in needed.items() if value is None]
        if len(missing) == len(needed) and self.shear_px is None:
            return None
        if missing or pitch_mm is None or self.focal_mm is None:
            raise InputError(
                f"{', '.join(missing)}: missing; cameras need pitch, focal length and pixel size"
            )
        return Optics(
            pitch_mm=pitch_mm,
            focal_mm=self.focal_mm,
            sensor_mm=self.sensor_mm,
            pixel_mm=pixel_mm,
            shear_px=self.shear_px or (0.0, 0.0),
        )


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class LightOptions:
    """How numbers tell light, and how many photons are drawn."""

    srgb: bool = False
    """Numbers are sRGB: the default for whole numbers in pictures."""
    linear: bool = False
    """Numbers are proportional to light: the default for floats."""
    gamma: float | None = None
    """Light is the number (from 0 to 1) to the power of this."""
    cfa: str | None = None
    """Bayer pattern: GRBG, RGGB, BGGR or GBRG. Of RGB pictures each pixel keeps one colour; grey ones are
    mosaics already."""
    photons: float | None = None
    """Draw photon counts with so many expected in each view."""
    seed: int = 1
    """Seed of these counts."""

    def encoding(self) -> Encoding | None:
        """How numbers tell light; None for the usual way. `InputError` if two ways are said."""
        if self.srgb + self.linear + (self.gamma is not None) > 1:
            raise InputError("--srgb, --linear, --gamma: give one of them")
        check_encoding(self.gamma)
        return "srgb" if self.srgb else "linear" if self.linear else self.gamma


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class DatasetOptions:
    """What the dataset says of itself."""

    z_mm: Depths = ()
    """Depth to look at in mm, or start:stop:step, kept as a suggestion; repeat for more. Default: where
    things are sharpest."""
    z_range_mm: Pair = None
    """Nearest and farthest depth of the scene in mm, kept as a suggestion."""
    title: str | None = None
    """Title of reports."""
    licence: str | None = None
    """Licence of the images."""
    citation: str | None = None
    """Whom to cite for the images."""


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ImportOptions:
    """All that can be said of images made by others."""

    views: Annotated[ViewOptions, Parameter(name="*")] = field(default_factory=ViewOptions)
    cameras: CameraOptions = CameraOptions()
    lenses: LensOptions = LensOptions()
    light: LightOptions = LightOptions()
    dataset: DatasetOptions = DatasetOptions()

    def request(self, source: Path) -> Request:
        """What is asked of a source; raises `InputError` for what is said by half."""
        lenses, light = self.lenses.lenses(), self.light
        asked = Request(source, self.views, None, lenses, light.encoding(), light.cfa)
        if asked.transforms is not None:
            return replace(asked, film=self.cameras.film())
        return replace(asked, optics=self.cameras.optics(lenses))


NOTHING_SAID = ImportOptions()


def import_dataset(source: Path, *, out: Out, options: ImportOptions = NOTHING_SAID) -> None:
    """Make a dataset of images that others made: pictures, arrays, lens arrays, photon counts.

    Says at which depths things are sharpest, and warns if the views fit together better in another order.

    Examples of use:

        pcii import photos -o out/mine --pattern "{col}_{row}.png" --pitch-mm 2 2 --focal-mm 35 --sensor-mm 36
        pcii import photos -o out/dim --pattern "{col}_{row}.png" --pitch-mm 2 2 --focal-mm 35 \\
          --sensor-mm 36 --cfa GRBG --photons 1000 --z-range-mm 30 200
        pcii import cotton -o out/cotton
        pcii import lenses.png -o out/lenses --lens-array 10 10 --lens-pitch-px 60.5 60.5 --focal-mm 3 \\
          --pixel-mm 0.01
        pcii import frames.npy -o out/spad --counts --pitch-mm 5 5 --focal-mm 50 --pixel-mm 0.05
        pcii import cubes -o out/spad --counts --bitpack --pattern "{row}_{col}.npy" --pitch-mm 5 5 \\
          --focal-mm 50 --pixel-mm 0.05

    Parameters
    ----------
    source
        A folder of pictures, a TIFF file with a page for each view, a folder of the HCI 4D light field
        benchmark, pictures or photon cubes with a transforms.json, a picture of a lens array, an array in a
        .npy or .npz file: (K, L, H, W), (K, L, H, W, C), or with --counts (K, L, N, H, W); or events.npz or
        views.exr of `simgen export`, which need no options.
    out
        Folder for the dataset: new or empty.
    """
    asked, photons, said = options.request(source), options.light.photons, options.dataset
    depths = check_z_mm(said.z_mm).tolist() if said.z_mm else None
    if said.z_range_mm is not None:
        check_depth_range(said.z_range_mm)
    if photons is not None:
        Light.per_view(photons)
        if asked.views.counts:
            raise InputError("--photons: is for pictures; these are photon counts already")
    held_dataset(out, None, content=False)
    with Stages() as report:
        imported = read(asked, report)
        given, drawn = _with_photons(source, imported, photons, options.light.seed)
        z_range = said.z_range_mm or imported.z_range_mm
        sharp, warning = checked(imported, asked, z_range)
        dataset = save_dataset(
            out,
            given,
            imported.truth,
            view_z_mm=imported.view_z_mm,
            z_mm=depths or imported.z_mm or [float(f"{z:.3g}") for z in sharp] or None,
            z_range_mm=z_range,
            photon_budget=photons or imported.photon_budget,
            radiance_unit=imported.radiance_unit,
            title=said.title or source.resolve().name,
            licence=said.licence,
            citation=said.citation,
            origin=imported.origin + drawn,
        )
    _say_what_came_in(dataset, imported, drawn, sharp)
    if warning is not None:
        answer(f"warning: {warning}; then delete {out} and import again")
    else:
        if not sharp and not imported.z_mm:
            say("nothing is clearly sharp at any depth that was looked at")
        say_next("pcii", "run", out, "-o", results_folder(out))


def _with_photons(
    source: Path, imported: Imported, photons: float | None, seed: int
) -> tuple[list[Views | PhotonCounts], str]:
    """Images and those beside them, with photon counts drawn of views if asked for, and a note of that."""
    given = [imported.images, *imported.beside]
    if photons is None:
        return given, ""
    if any(isinstance(one, PhotonCounts) for one in given):
        raise InputError(f"--photons: is for pictures, and {source} has photon counts already")
    counts = [limit_photons(one, photons, seed=seed) for one in given if isinstance(one, Views)]
    return [*given, *counts], f"; {photons:g} photons expected in each view, seed {seed}"


def _say_what_came_in(dataset: Dataset, imported: Imported, drawn: str, sharp: tuple[float, ...]) -> None:
    K, L, H, W = dataset.grid.shape_KLHW
    pattern = dataset.cfa or "no"
    say(f"{dataset.path}: {K} x {L} views of {H} x {W} px, {pattern} Bayer pattern; {imported.origin}{drawn}")
    for note in imported.notes:
        say(note)
    if sharp:
        say(f"sharpest at {', '.join(f'{z:.3g}' for z in sharp)} mm")
