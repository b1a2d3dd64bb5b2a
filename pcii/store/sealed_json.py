"""JSON documents that end in a checksum of themselves, and JSON of strangers.

The last member of such a document is "sha256": the SHA-256 of its bytes with 64 zeros in the place of that.
"""

import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pcii.base.errors import InputError
from pcii.base.safe_files import json_bytes, write_bytes_safely
from pcii.store.hashes import hash_bytes

LARGEST_DOCUMENT_BYTES = 1 << 24
"""JSON takes up to 30 times its length in memory; a list of 100 000 files is shorter than this."""
_BLANK = b"0" * 64
_SEAL = re.compile(rb'"sha256": "([0-9a-f]{64})"(\n\}\n|\})\Z')


def write_sealed(path: Path, document: Mapping[str, Any]) -> None:
    """Write `document` with its checksum, atomically."""
    write_bytes_safely(path, sealed(document, json_bytes))


def sealed(document: Mapping[str, Any], to_bytes: Callable[[Mapping[str, Any]], bytes]) -> bytes:
    """What `to_bytes` makes of a document, on one line or indented, with its checksum."""
    blank = to_bytes({**document, "sha256": _BLANK.decode()})
    start = blank.rindex(_BLANK)
    checksum = hash_bytes(blank).encode()
    return blank[:start] + checksum + blank[start + len(_BLANK) :]


def check_seal(content: bytes) -> None:
    """Raise ValueError unless a document ends in its checksum, and that is right."""
    found = _SEAL.search(content)
    if found is None:
        raise ValueError("damaged or of another release, it does not end in its checksum")
    blank = content[: found.start(1)] + _BLANK + content[found.end(1) :]
    if hash_bytes(blank).encode() != found[1]:
        raise ValueError("changed since it was written, its checksum does not match")


def read_sealed(path: Path, remedy: str, *, largest_bytes: int = LARGEST_DOCUMENT_BYTES) -> dict[str, Any]:
    """Members of a document whose checksum is right; else raises `InputError`, which ends in `remedy`."""
    content = read_small(path, largest_bytes, remedy)
    try:
        check_seal(content)
    except ValueError as fault:
        raise InputError(f"{path}: {fault}; {remedy}") from None
    document = parse_json(content, path, remedy)
    return {name: value for name, value in document.items() if name != "sha256"}


def read_small(path: Path, limit: int, remedy: str) -> bytes:
    """Content of a regular file of at most `limit` bytes; raises `InputError` for any other."""
    if not path.is_file():
        raise InputError(f"{path}: missing; {remedy}")
    try:
        with path.open("rb") as file:
            content = file.read(limit + 1)
    except OSError as fault:
        raise InputError(f"{path}: cannot be read ({fault.strerror}); {remedy}") from None
    if len(content) > limit:
        raise InputError(f"{path}: larger than the {limit} bytes that such a file has at most; {remedy}")
    return content


def parse_json(content: bytes, path: Path, remedy: str) -> dict[str, Any]:
    """The JSON object in `content`; raises `InputError`, naming `path`, for anything else."""

    def refuse(constant: str) -> None:
        raise ValueError(f"{constant} is no JSON")

    try:
        document = json.loads(content.decode("utf-8"), parse_constant=refuse)
    except (ValueError, RecursionError) as fault:
        raise InputError(f"{path}: damaged, it is not valid JSON ({fault}); {remedy}") from None
    if not isinstance(document, dict):
        raise InputError(f"{path}: damaged, it is not a JSON object; {remedy}")
    return document
