"""Maps of depth and masks of a submission: where they are, checked as they are read.

    ramp_photons_1/1000/depth.npz     z_mm (H, W) in mm, not finite where there is no answer, and, if there is
                                      one, confidence (H, W) from 0 to 1
                       /depth.pfm     or .exr: z_mm alone; confidence.pfm or .exr beside it
                       /masks.npz     in_focus (Z, H, W), 0 or 1, at the depths of the dataset, in their order
                       /mask_540.png  or so for each depth: in focus where it is not 0

The first folder is that of the dataset; the second says from how many photons per view, or "full-light".
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from zipfile import BadZipFile, ZipFile

import numpy as np

from pcii.base.errors import InputError
from pcii.exchange.pixel_files import decode, picture_of
from pcii.store.dataset import FULL_LIGHT, Budget, Dataset
from pcii.store.suggested_depths import planes_of
from pcii.types.estimates import DepthMap

DEPTH_FILES = ("depth.npz", "depth.pfm", "depth.exr")
CONFIDENCE_FILES = ("confidence.pfm", "confidence.exr")
MASKS = "masks.npz"


def light_folder(budget: Budget) -> str:
    """What the folder of results from so many photons per view is called.

    >>> light_folder(1000.0), light_folder("full-light")
    ('1000', 'full-light')
    """
    return FULL_LIGHT if budget == FULL_LIGHT else f"{budget:.15g}"


def has_depth(folder: Path) -> bool:
    """Whether there is a map of depth in a folder of results."""
    return any((folder / name).is_file() for name in DEPTH_FILES)


def has_masks(folder: Path) -> bool:
    """Whether there are masks in a folder of results."""
    return (folder / MASKS).is_file() or any(folder.glob("mask_*.png"))


def submitted_depth(folder: Path, dataset: Dataset) -> DepthMap:
    """The map of depth in a folder of results; `InputError`, naming the file, for one that is none."""
    shape = dataset.grid.shape_HW
    files = [folder / name for name in DEPTH_FILES if (folder / name).is_file()]
    if len(files) > 1:
        raise InputError(f"{files[1]}: {files[0].name} is there too; give one of them")
    (file,) = files
    if file.suffix == ".npz":
        arrays = _arrays(file, {"z_mm": shape, "confidence": shape}, optional={"confidence"})
        z_mm, confidence = arrays["z_mm"], arrays.get("confidence")
    else:
        z_mm, confidence = _picture(file, shape), None
        for beside in CONFIDENCE_FILES:
            if (folder / beside).is_file():
                file = folder / beside
                confidence = _picture(file, shape)
    z_mm = np.where(np.isfinite(z_mm), z_mm, np.nan).astype(np.float64)
    if (z_mm <= 0).any():
        raise InputError(f"{files[0]}: z_mm: depths are above 0 mm; give NaN where there is no answer")
    answered = np.isfinite(z_mm)
    if confidence is None:
        return DepthMap(z_mm, answered.astype(np.float64))
    if not ((confidence >= 0) & (confidence <= 1)).all():
        raise InputError(f"{file}: confidence: expected numbers from 0 to 1, also where there is no depth")
    return DepthMap(z_mm, np.where(answered, confidence, 0.0).astype(np.float64))


def submitted_masks(folder: Path, dataset: Dataset) -> np.ndarray:
    """The masks (Z, H, W) bool in a folder of results; `InputError`, naming the file, for others."""
    shape, z_mm = dataset.grid.shape_HW, planes_of(dataset, ()).z_mm.tolist()
    pictures = sorted(folder.glob("mask_*.png"))
    if (folder / MASKS).is_file():
        if pictures:
            raise InputError(f"{pictures[0]}: {MASKS} is there too; give one of them")
        masks = _arrays(folder / MASKS, {"in_focus": (len(z_mm), *shape)})["in_focus"]
        if not np.isin(masks, (0, 1)).all():
            raise InputError(f"{folder / MASKS}: in_focus: expected 0 and 1, or bool")
        return masks.astype(bool)
    expected = [folder / f"mask_{z:g}.png" for z in z_mm]
    depths = f"the depths are {', '.join(f'{z:g}' for z in z_mm)} mm"
    for file in expected:
        if not file.is_file():
            raise InputError(f"{file}: is missing; {depths}")
    for file in pictures:
        if file not in expected:
            raise InputError(f"{file}: {depths}")
    return np.stack([_picture(file, shape) > 0 for file in expected])


def _picture(file: Path, shape: tuple[int, int]) -> np.ndarray:
    """Numbers (H, W) of a picture of one channel; `InputError` for another one."""
    kinds = {".png": "PNG", ".pfm": "PFM", ".exr": "EXR"}
    picture = picture_of(file, (kinds[file.suffix],))
    if picture.shape != (*shape, 1):
        raise InputError(
            f"{file}: expected {shape[0]} x {shape[1]} px of one channel, got {picture.layout()}"
        )
    return next(decode(picture))[..., 0]


def _arrays(
    file: Path, shapes: Mapping[str, tuple[int, ...]], optional: set[str] | None = None
) -> dict[str, np.ndarray]:
    """The named arrays of an .npz file; `InputError` if they are not there, or not of these shapes."""
    try:
        with ZipFile(file) as packed:
            sizes = {info.filename.removesuffix(".npy"): info.file_size for info in packed.infolist()}
        unknown = sizes.keys() - shapes.keys()
        missing = shapes.keys() - sizes.keys() - (optional or set())
        if unknown or missing:
            raise InputError(
                f"{file}: expected the arrays {_listed(shapes, optional)}, got "
                f"{', '.join(sorted(sizes)) or 'none'}"
            )
        for name, size in sizes.items():  # before anything is unpacked
            if size > 8 * np.prod(shapes[name], dtype=np.int64) + (1 << 16):
                raise InputError(f"{file}: {name}: expected numbers {shapes[name]}, got {size} bytes")
        with np.load(file, allow_pickle=False) as loaded:
            arrays = {name: loaded[name] for name in sizes}
    except InputError:
        raise
    except (BadZipFile, OSError, ValueError, KeyError, EOFError):
        raise InputError(f"{file}: damaged, or no .npz file of plain numbers") from None
    for name, values in arrays.items():
        if values.shape != shapes[name] or values.dtype.kind not in "fiub":
            raise InputError(
                f"{file}: {name}: expected numbers {shapes[name]}, got {values.dtype} {values.shape}"
            )
    return arrays


def _listed(names: Iterable[str], optional: set[str] | None) -> str:
    return ", ".join(f"{name} (if known)" if name in (optional or ()) else name for name in names)
