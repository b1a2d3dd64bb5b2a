"""SHA-256 of bytes, of files and of what JSON can say."""

import hashlib
import json
from pathlib import Path
from typing import Any


def hash_bytes(content: bytes) -> str:
    """SHA-256 of bytes, in hex."""
    return hashlib.sha256(content).hexdigest()


def hash_file(path: Path) -> str:
    """SHA-256 of a file, in hex."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def hash_json(value: Any) -> str:
    """SHA-256, in hex, of a value that JSON can say; the order of members of objects does not matter.

    >>> hash_json({"a": 1, "b": [2]}) == hash_json({"b": (2,), "a": 1})
    True
    """
    return hash_bytes(json.dumps(value, sort_keys=True).encode())
