"""Pictures that a glTF file names or holds."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from pcii.base.errors import InputError
from simgen.assets.asset_files import LARGEST_TOTAL_BYTES, read_texture
from simgen.importing.gltf_file import GltfFile


def pictures_of(gltf: GltfFile) -> dict[int, np.ndarray]:
    """Pixels of the images that textures name, (H, W, 3) or with alpha (H, W, 4), uint8 or uint16, by number.

    Raises `InputError`, naming the image, for one that is missing or cannot be decoded.
    """
    wanted = sorted({texture.source for texture in gltf.document.textures if texture.source is not None})
    found: dict[int, np.ndarray] = {}
    with _on_disk(gltf, wanted) as paths:
        total = 0
        for number, path in paths.items():
            try:
                found[number] = read_texture(path, alpha=True, as_stored=True)
            except InputError as fault:
                sentence = str(fault).removeprefix(f"{path}: ")
                raise gltf.fault(f"images[{number}]: {sentence}") from None
            total += found[number].nbytes
            if total > LARGEST_TOTAL_BYTES:
                raise gltf.fault(f"its images take more than {LARGEST_TOTAL_BYTES} bytes; make them smaller")
    return found


@contextmanager
def _on_disk(gltf: GltfFile, numbers: list[int]) -> Iterator[dict[int, Path]]:
    """Images as files."""
    images = gltf.document.images
    with tempfile.TemporaryDirectory() as folder:
        paths: dict[int, Path] = {}
        for number in numbers:
            where = f"images[{number}]"
            if number >= len(images):
                raise gltf.fault(f"textures: there is no {where}")
            image = images[number]
            if image.uri is not None:
                content = gltf.named_bytes(image.uri, f"{where}.uri")
            elif image.buffer_view is not None:
                content, _ = gltf.view(image.buffer_view, f"{where}.bufferView")
            else:
                raise gltf.fault(f"{where}: it has neither a uri nor a bufferView")
            paths[number] = Path(folder) / f"{number}"
            paths[number].write_bytes(content.tobytes())
        yield paths
