"""A map of true depth that somebody measured or rendered, as the truth of imported views."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pcii.base import InputError
from pcii.exchange.number_files import decode, kind_of, open_array, picture_of
from pcii.exchange.stated_images import Note
from pcii.types import CameraGrid, Truth

DEPTH_PICTURES = ("PNG", "TIFF", "EXR", "PFM")
"""Kinds of pictures that keep depth."""
DEPTH_CHANNELS = ("Z", "V", "Y")
"""How the names of channels of depth end in EXR files of several, the surest first: V is of Blender."""
NEAREST_MM, FARTHEST_MM = 0.1, 1e8
"""Depths that can be: where a ray meets nothing renderers write 1e10."""
UNKNOWN = 1
"""Number of the object that stands for pixels of unknown depth, which count in no score."""


@dataclass(frozen=True, kw_only=True)
class DepthFile:
    """A map of true depth of the virtual centre camera, which of an odd grid is the middle view."""

    depth: Path | None = None
    """True depth in the image of the virtual centre camera, which of an odd grid is the middle view: PNG,
    TIFF, EXR, PFM or an array. 0, NaN and the largest whole number are unknown; infinity is nothing."""
    depth_key: str | None = None
    """Name of the map in a .npz, .mat or HDF5 file of several arrays."""
    depth_unit_mm: float = 1.0
    """What a depth of 1 stands for in mm: 1000 of a file in metres."""
    depth_along_ray: bool = False
    """Depth is the distance from the camera, not along its axis."""

    def truth_for(self, grid: CameraGrid, note: Note) -> Truth | None:
        """The truth of views of a `grid`, None without a file. Pixels of unknown depth count in no score.

        `note` takes how many those are. Raises `InputError`, naming the file, for a map of another size, and
        for depths that are not from 0.1 mm to 100 km.
        """
        if self.depth is None:
            if self != NO_DEPTH:
                raise InputError("--depth-key, --depth-unit-mm, --depth-along-ray: are for a file of --depth")
            return None
        if not 0 < self.depth_unit_mm < np.inf:
            raise InputError(f"--depth-unit-mm: expected a length above 0, got {self.depth_unit_mm:g}")
        path = Path(self.depth)
        numbers = _numbers_in(path, self.depth_key)
        if numbers.shape != grid.shape_HW or numbers.dtype.kind not in "iuf":
            raise InputError(
                f"--depth: {path} is {numbers.dtype} {numbers.shape}; expected real numbers {grid.shape_HW}, "
                "rows x columns of a view"
            )
        is_unknown = np.isnan(numbers) | (numbers == 0)
        if numbers.dtype.kind in "iu":
            is_unknown |= numbers == np.iinfo(numbers.dtype).max
        z_mm = numbers.astype(np.float64) * self.depth_unit_mm
        if self.depth_along_ray:
            rows, cols = (np.arange(size) - (size - 1) / 2 for size in grid.shape_HW)
            # Length of the ray of each pixel of the virtual centre to the plane at depth 1.
            z_mm /= np.hypot(np.hypot(rows[:, None], cols) * grid.pixel_mm / grid.focal_mm, 1.0)
        z_mm[is_unknown | (z_mm >= FARTHEST_MM)] = np.inf
        if is_unknown.all() or not (z_mm >= NEAREST_MM).all():
            least = f"{z_mm.min():.3g} mm" if not is_unknown.all() else "no known depth"
            raise InputError(
                f"--depth: {path} has {least}, where depths are from {NEAREST_MM:g} mm to 100 km; correct "
                "--depth-unit-mm"
            )
        hit = z_mm[np.isfinite(z_mm)]
        reach = f"{hit.min():.4g} to {hit.max():.4g} mm" if hit.size else "nothing"
        if hit.size and hit.max() < grid.focal_mm:
            note(
                f"warning: {path.name} has depths of {reach}, nearer than the focal length of "
                f"{grid.focal_mm:g} mm; if they are in metres, import again with --depth-unit-mm 1000"
            )
        note(f"with the true depth of the virtual centre, {reach}, from {path.name}")
        count = np.count_nonzero(is_unknown)
        if count:
            note(f"{count} of {z_mm.size} pixels have no known depth there, and count in no score")
        names = {UNKNOWN: "unknown depth"} if count else {}
        object_id = np.where(is_unknown, UNKNOWN, 0).astype(np.int16)
        z_mm = z_mm.astype(np.float32)
        return Truth(z_mm, object_id, names, unscored=frozenset(names), are_objects_known=False)


NO_DEPTH = DepthFile()
"""Views without a map of true depth."""


def _numbers_in(path: Path, key: str | None) -> np.ndarray:
    """The numbers (H, W) of a file of depth."""
    kind = kind_of(path)
    if kind is None:
        try:
            return np.squeeze(open_array(path, key))
        except InputError as fault:
            raise InputError(str(fault).replace("--key", "--depth-key")) from None
    channel = _depth_channel(path) if kind == "EXR" else None
    if channel is not None:
        return channel
    picture = picture_of(path, DEPTH_PICTURES)
    pixels = decode(picture)[0]
    if picture.pages > 1 or (pixels != pixels[..., :1]).any():
        raise InputError(f"--depth: {path} has colours or several pages; expected one map of depth")
    return pixels[..., 0]


def _depth_channel(path: Path) -> np.ndarray | None:
    """The channel of depth of an EXR file, which renderers name in several ways; None of a picture."""
    import OpenEXR

    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {
                name: np.asarray(c.pixels) for part in file.parts for name, c in part.channels.items()
            }
    except Exception as fault:  # decoders raise various exceptions for damaged content
        raise InputError(f"--depth: {path} is damaged ({fault})") from None
    if len(channels) == 1:
        return next(iter(channels.values()))
    for end in DEPTH_CHANNELS:
        for name, pixels in channels.items():
            if name.split(".")[-1].upper() == end:
                return pixels
    return None
