"""Datasets of strangers: members of their JSON or bytes of their files changed, all hashes made right again.

Run as a program it opens as many as it is told, in a process of its own, and prints what went wrong and the
memory that it took at most.
"""

import json
import random
import shutil
import sys
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from pcii.store.dataset import open_dataset
from pcii.store.dataset_layout import COUNTS, MANIFEST, PHOTON_TRUTH, RADIANCE, TRUTH, write_manifest
from pcii.store.folders import list_files

HUGE_TEXT = "x" * 100_000
VALUES: list[Any] = [
    None, True, False, 0, -1, 1, 2, 3, 7, 255, 1 << 20, 200_000_000, 1 << 31, 1 << 62, 1 << 64, 10**40,
    -0.0, 0.5, 1e-300, 1e308, -1e308, 1e18, "", "a", "NaN", "-Infinity", "../../etc/passwd", "\x1b[2J", "\n",
    "GRBG", "float64", "int64", "uint8", "object", "zstd", "sharding_indexed", "gzip", HUGE_TEXT, [], [0],
    [-1], [1 << 30], [1 << 30, 1 << 30], [[]], [None], ["a"], {}, {"a": 1}, {"name": "regular"}, {"rows": 1},
]  # fmt: skip


def mutated(document: Any, rng: random.Random) -> Any:
    """A copy of a JSON value in which a few members are changed, deleted, added or exchanged."""
    document = _copied(document)
    for _ in range(rng.choice((1, 1, 1, 2, 5))):
        places = [(node, key) for node in _nodes(document) for key in _keys(node)]
        if not places:
            return _copied(rng.choice(VALUES))
        node, key = rng.choice(places)
        kind = rng.randrange(5)
        if kind == 0:
            del node[key]
        elif kind == 1:
            other, its = rng.choice(places)
            node[key] = _copied(other[its]) if its in _keys(other) else None
        elif kind == 2 and isinstance(node, dict):
            node[str(rng.choice(VALUES))] = _copied(rng.choice(VALUES))
        elif kind == 3 and type(node[key]) in (int, float):
            node[key] = rng.choice((node[key] * -1, node[key] * 10**9, node[key] + 1, node[key] * 0.5))
        else:
            node[key] = _copied(rng.choice(VALUES))
    return document


def _copied(value: Any) -> Any:
    return json.loads(json.dumps(value))


def _nodes(value: Any) -> list[Any]:
    if isinstance(value, dict):
        return [value, *(node for inner in value.values() for node in _nodes(inner))]
    if isinstance(value, list):
        return [value, *(node for inner in value for node in _nodes(inner))]
    return []


def _keys(node: Any) -> list[Any]:
    return list(node) if isinstance(node, dict) else list(range(len(node)))


def make_hostile(root: Path, rng: random.Random) -> str:
    """Change one file of the dataset in `root`, hashes and checksum included; what was done."""
    manifest = json.loads((root / MANIFEST).read_text())
    manifest.pop("sha256")
    files = sorted(path for path in root.rglob("*") if path.is_file() and path.name != MANIFEST)
    kind = rng.choice(("manifest", "metadata", "chunk", "bomb", "raw"))
    if kind == "raw":  # no hash is made right
        path = rng.choice([root / MANIFEST, *files])
        content = bytearray(path.read_bytes())
        for _ in range(rng.choice((1, 1, 3, 30))):
            content[rng.randrange(len(content))] = rng.randrange(256)
        path.write_bytes(content)
        return f"raw bytes of {path.name}"
    if kind == "manifest":
        manifest = mutated(manifest, rng)
        if not isinstance(manifest, dict):
            manifest = {"a": manifest}
        files_too = manifest.get("files")
    else:
        metadata = [path for path in files if path.name == "zarr.json"]
        path = rng.choice(metadata if kind == "metadata" else [p for p in files if p not in metadata])
        if kind == "metadata":
            path.write_text(json.dumps(mutated(json.loads(path.read_text()), rng)))
        elif kind == "bomb":
            path.write_bytes(bomb(1 << rng.randrange(31)))
        else:
            content = bytearray(path.read_bytes())
            for _ in range(rng.choice((1, 1, 3, 30))):
                content[rng.randrange(len(content))] = rng.randrange(256)
            path.write_bytes(content)
        files_too = list_files(root, [COUNTS, TRUTH, PHOTON_TRUTH, RADIANCE])
        kind = f"{kind} {path.relative_to(root)}"
    write_manifest(root, {**manifest, "files": files_too})
    return kind


def bomb(size: int) -> bytes:
    """A chunk of one zstd frame (RFC 8878) of so many zeros, of which four bytes tell 128 KiB."""
    most = 1 << 17
    blocks = [most] * (size // most) + [size % most] * (size % most > 0)
    frame = b"\x28\xb5\x2f\xfd\xa0" + size.to_bytes(4, "little")
    for number, length in enumerate(blocks, start=1):
        frame += ((number == len(blocks)) | 1 << 1 | length << 3).to_bytes(3, "little") + b"\0"
    return frame + b"crc."


def read_all(root: Path) -> None:
    """Everything that can be read of a dataset."""
    dataset = open_dataset(root)
    for budget in dataset.budgets:
        dataset.at_budget(budget)
    counts = dataset.counts
    assert 0 <= counts.total < 1 << 63
    assert dataset.truth is None or dataset.truth.z_mm.size
    if dataset.views is not None:
        dataset.views.view(0, 0)
    assert dataset.name


def open_many(whole: Path, scratch: Path, number: int, seed: int) -> dict[str, Any]:
    """Open so many hostile variants of the dataset `whole`; what went wrong, and what it took."""
    faults: list[str] = []
    refused = 0
    for step in range(number):
        rng = random.Random(1_000_000 * seed + step)
        shutil.rmtree(scratch, ignore_errors=True)
        shutil.copytree(whole, scratch)
        done = make_hostile(scratch, rng)
        try:
            read_all(scratch)
        except InputError as fault:
            refused += 1
            if "\n" in str(fault) or str(scratch) not in str(fault):
                faults.append(f"{step}, {done}: {str(fault)[:300]}")
        except Exception as fault:
            faults.append(f"{step}, {done}: {type(fault).__name__}: {str(fault)[:300]}")
    # Not ru_maxrss, which knows the process that started this one, too.
    status = Path("/proc/self/status").read_text()
    memory = int(status.split("VmHWM:")[1].split()[0]) / 1024
    return {"faults": faults, "refused": refused, "memory_mb": memory}


if __name__ == "__main__":
    result = open_many(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]))
    print(json.dumps(result))
