"""Channels of OpenEXR files, part by part, whose sizes their headers tell first."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pcii.base.errors import InputError


def exr_headers(path: Path) -> list[dict[str, Any]]:
    """Header of each part of a file, without its pixels."""
    import OpenEXR

    with path.open("rb") as opened, OpenEXR.File(opened, separate_channels=True, header_only=True) as file:
        return [dict(part.header) for part in file.parts]  # gone when the file is closed


def exr_channels(path: Path) -> dict[str, dict[str, np.ndarray]]:
    """Channels (H, W) of each part by the names of both."""
    import OpenEXR

    with path.open("rb") as opened, OpenEXR.File(opened, separate_channels=True) as file:
        return {  # pixels are gone when the file is closed
            part.name(): {name: np.array(channel.pixels) for name, channel in part.channels.items()}
            for part in file.parts
        }


def window_size(header: Mapping[str, Any], name: str = "dataWindow") -> tuple[int, int]:
    """Height and width of a part in px, of its pixels or of its "displayWindow"."""
    (left, top), (right, bottom) = (map(int, corner) for corner in header[name])
    return bottom - top + 1, right - left + 1


def exr_header(path: Path) -> dict[str, Any]:
    """What `Picture` says of a file of one flat part, with the channels R, G, B or else Y; `InputError`."""
    import OpenEXR

    headers = exr_headers(path)
    if len(headers) != 1:
        raise InputError(f"has {len(headers)} parts; save each as a picture of its own")
    (header,) = headers
    if header.get("type", OpenEXR.scanlineimage) not in (OpenEXR.scanlineimage, OpenEXR.tiledimage):
        raise InputError("is a deep picture; save a flat one")
    channels = {channel.name: channel for channel in header["channels"]}
    if not _colours(channels):
        raise InputError(f"has the channels {', '.join(sorted(channels))[:60]}; expected R, G and B, or Y")
    if any(channel.xSampling != 1 or channel.ySampling != 1 for channel in channels.values()):
        raise InputError("has channels of different sizes")
    data, display = (np.ravel(header[name]).tolist() for name in ("dataWindow", "displayWindow"))
    if data != display:
        raise InputError("its data window is not its display window; save the whole picture")
    return {
        "shape": (*window_size(header), len(_colours(channels))),
        "dtype": np.dtype(np.float32),
        "alpha": "A" in channels,
        "stored": len(channels),
    }


def exr_pixels(path: Path) -> np.ndarray:
    """R, G, B or Y, and alpha if there is, of a file of one part: (H, W, C) float32."""
    (channels,) = exr_channels(path).values()
    names = [*_colours(channels), *(["A"] if "A" in channels else [])]
    return np.stack([np.float32(channels[name]) for name in names], axis=-1)


def _colours(names: Sequence[str] | Mapping[str, Any]) -> str:
    """Names of the channels to read, "" if there are none."""
    return "RGB" if all(name in names for name in "RGB") else "Y" if "Y" in names else ""
