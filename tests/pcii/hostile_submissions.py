"""What is done to folders of scores and of maps by mistake or on purpose, and what is said of it."""

import os
import re
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from pcii.evaluation import SUBMISSION
from pcii.store import EVALUATION_FOLDER, ROWS, list_files
from pcii.store.folders import EVALUATION

Attack = tuple[Callable[[Path], object], str]


def edit(name: str, old: str, new: str, *, lists: bool = True) -> Callable[[Path], object]:
    """Replaces a text, and `lists` the files anew, as whoever changes scores on purpose would."""

    def attack(folder: Path) -> None:
        text, number = re.subn(old, new, (folder / name).read_text(), count=1)
        (folder / name).write_text(text if number else "none")
        if lists:
            files = list_files(folder, [ROWS, SUBMISSION, "evaluation.html", "means.csv"])
            EVALUATION_FOLDER.write(folder, {"files": files})

    return attack


def instead(file: Path, make: Callable[[Path], object]) -> None:
    file.unlink()
    make(file)


def listing(files: object) -> Callable[[Path], object]:
    return lambda folder: EVALUATION_FOLDER.write(folder, {"files": files})


DEEP = "[" * 50_000
AGAIN = ".*; delete the folder and make or score it again"
LINK = ": is a link or no file; a folder of scores holds nothing but files"
ELSEWHERE = {"../x": {"bytes": 0, "sha256": "0" * 64}}
# What is done to scores of which a page is made, and what is said of it.
ATTACKS: dict[str, Attack] = {
    "an edited row": (edit(ROWS, '"iou": 0', '"iou": 1', lists=False), f"{ROWS}{AGAIN}"),
    "a longer table": (edit("means.csv", "$", "more", lists=False), f"means.csv{AGAIN}"),
    "another author": (edit(SUBMISSION, "A. N.", "A. M.", lists=False), f"{SUBMISSION}{AGAIN}"),
    "an edited list": (edit(EVALUATION, "files", "file", lists=False), f"{EVALUATION}{AGAIN}"),
    "no list": (lambda f: (f / EVALUATION).unlink(), "theirs: not a finished evaluation"),
    "an empty list": (listing({}), f"theirs: not listed in {EVALUATION}: .*, {ROWS}, {SUBMISSION}"),
    "a file elsewhere": (listing(ELSEWHERE), f"files.../x: expected a path inside the folder{AGAIN}"),
    "a link": (lambda f: instead(f / ROWS, lambda file: file.symlink_to("/dev/null")), f"{ROWS}{LINK}"),
    "a pipe": (lambda f: instead(f / SUBMISSION, os.mkfifo), f"{SUBMISSION}{LINK}"),
    "a folder elsewhere": (lambda f: f.symlink_to(f.rename(f.parent.parent / "away")), f"theirs{LINK}"),
    "2 GB": (
        lambda f: os.truncate(f / ROWS, 1 << 31),
        f"{ROWS}: has 2147483648 bytes; all files may have 20000000 together",
    ),
    "no rows": (edit(ROWS, "(?s).*", ""), "theirs: holds no evaluation"),
    "another half": (
        edit(SUBMISSION, "development", "best"),
        f"{SUBMISSION}: half: .*; expected a JSON object of",
    ),
}
IOU = '"iou": [0-9.]+'
ROW_ATTACKS = {
    "a list": ('"title": "pair"', '"title": ["pair"]', "title: expected text, got list"),
    "text": (IOU, '"iou": "0.5"', "planes.0.scores.iou: .* a valid number"),
    "an object": (IOU, '"iou": {"x": "0.5"}', "planes.0.scores.iou.x: .* a valid number"),
    "no number": (IOU, '"iou": NaN', "planes.0.scores.iou: .* a finite number"),
    "infinity": (IOU, '"iou": 1e999', "planes.0.scores.iou: .* a finite number"),
    "a name of a column": ('"iou"', '"scene"', "planes.0.scores: 'scene' is no name of a measure"),
    "400 digits": ('"seed": 1', f'"seed": {10**400}', "seed: .* a valid number"),
    "a hole": ('"seed": 1', f'"seed": {DEEP}', "is no row of scores"),
    "no identity": (r'"identity": "\w+", ', "", "identity: Field required"),
    "no planes": ('"planes"', '"plains"', "is no row of scores"),
}
for name, (old, new, words) in ROW_ATTACKS.items():
    ATTACKS[name] = edit(ROWS, old, new), f"{ROWS}: line 1: {words}; delete that line and repeat the command"


SHAPE = (130, 140)
DEPTH = "pair_photons_1/1000/depth.npz"
NUMBERS = r"expected numbers z_mm \(130, 140\), confidence \(130, 140\), of which z_mm is needed"
DAMAGED = "depth.npz: damaged, or no .npz file as numpy.savez writes it"
NO_FILE = ": expected a file of this folder, no link, of at most"


def depth(values: object, **others: Any) -> Callable[[Path], object]:
    """Another depth map: of these values, or of one value."""
    z_mm = values if isinstance(values, np.ndarray) else np.full(SHAPE, values)
    return lambda folder: np.savez(folder / DEPTH, z_mm=z_mm, **others)


def packed(
    shape: object, zeros: int, version: int = 1, by: int = zipfile.ZIP_DEFLATED
) -> Callable[[Path], object]:
    """A depth map of this shape, of which there is nothing but zeros."""
    text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}}}\n".encode()
    size = len(text).to_bytes(2, "little") if version == 1 else zeros.to_bytes(4, "little")

    def make(folder: Path) -> None:
        with zipfile.ZipFile(folder / DEPTH, "w", by) as file:
            file.writestr("z_mm.npy", b"\x93NUMPY" + bytes([version, 0]) + size + text + bytes(zeros))

    return make


def encrypt(folder: Path) -> None:
    content = (folder / DEPTH).read_bytes()
    for start in (b"(PK\3\4..).", b"(PK\1\2....)."):  # the first bit of the flags that follow
        content = re.sub(start, lambda header: header[1] + b"\1", content, flags=re.DOTALL)
    (folder / DEPTH).write_bytes(content)


# What is done to a good submission, and what is said of it.
FAULTS: dict[str, Attack] = {
    "another benchmark": (
        edit(SUBMISSION, "small", "large", lists=False),
        "benchmark: is 'large', but .* 'small'",
    ),
    "a hole": (lambda f: (f / SUBMISSION).write_text(DEEP), f"{SUBMISSION}: Invalid JSON: recursion limit"),
    "a pipe": (lambda f: instead(f / SUBMISSION, os.mkfifo), f"{SUBMISSION}{NO_FILE}"),
    "no maps": (lambda f: [shutil.rmtree(each) for each in f.glob("*/")], "has no results of a dataset of"),
    "a dataset that is not there": (
        lambda f: shutil.copytree(f / "pair_photons_1", f / "pear_photons_1"),
        "pear_photons_1/.*: is no result of this half; expected files DATASET/LIGHT/depth.npz or masks.npz",
    ),
    "missing pieces": (
        lambda f: shutil.rmtree(f / "pair_photons_2" / "1000"),
        r"pair_photons_2/1000/\w+.npz: is missing, and of this light it is needed of all datasets$",
    ),
    "masks of shares": (
        lambda f: np.savez(f / DEPTH.replace("depth", "masks"), in_focus=np.full((2, *SHAPE), 0.5)),
        "in_focus: expected 0 and 1",
    ),
    "another size": (depth(np.ones((130, 14))), NUMBERS),
    **{f"{z!r}": (depth(z), f"depth.npz: {NUMBERS}") for z in (1j, "far", np.datetime64("2026-01-10"), None)},
    **{f"{z} mm": (depth(z), "z_mm: expected 0.001 to 1e.12 mm") for z in (-1.0, 1e-310, 1e200)},
    "8 TiB": (packed((1 << 20, 1 << 20), 0), NUMBERS),
    "a map more": (depth(1.0, error=1.0), f"depth.npz: 'error' is not used; {NUMBERS}"),
    "half a file": (lambda f: os.truncate(f / DEPTH, 9999), DAMAGED),
    "a password": (encrypt, DAMAGED),
    "a bomb": (packed(SHAPE, 1 << 26), DAMAGED),
    "a bomb in a header": (packed(SHAPE, 1 << 26, version=2), DAMAGED),
    "a bomb by bzip2": (packed(SHAPE, 1 << 26, by=zipfile.ZIP_BZIP2), DAMAGED),
    "a map that is a pipe": (lambda f: instead(f / DEPTH, os.mkfifo), f"depth.npz{NO_FILE}"),
    "no end": (
        lambda f: instead(f / DEPTH, lambda file: file.symlink_to("/dev/zero")),
        f"depth.npz{NO_FILE}",
    ),
    "elsewhere": (
        lambda f: (f / DEPTH).symlink_to((f / DEPTH).rename(f.parent / "x")),
        f"depth.npz{NO_FILE}",
    ),
    "1 TiB": (lambda f: os.truncate(f / DEPTH, 1 << 40), f"depth.npz{NO_FILE} 647936 bytes"),
}
