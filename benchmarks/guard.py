"""The guard: ratios of a run against those of the last committed table; never seconds, which are a machine's.

A ratio says how many times better ours is than what was measured beside it in the same run. Speeds of a
machine cancel in it, though not what makes one processor better than another at one kind of work.
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from benchmarks.results import Record
from pcii.base.errors import InputError
from pcii.base.safe_files import write_json_safely

REFERENCE = Path(__file__).with_name("reference_ratios.json")
LOSS = 0.25
"""Largest share of a ratio that may be lost."""


def reference_of(records: Iterable[Record]) -> dict[str, Any]:
    """The table to commit: ratios by study, with size, date and machine of each."""
    return {
        record.study: {
            "size": record.size,
            "date": record.date,
            "machine": dict(record.machine),
            "ratios": {ratio.name: round(ratio.ratio.value, 4) for ratio in record.measured.ratios},
        }
        for record in records
        if record.measured.ratios
    }


def write_reference(records: Iterable[Record], path: Path = REFERENCE) -> None:
    """Make the table anew."""
    write_json_safely(path, reference_of(records))


def read_reference(path: Path = REFERENCE) -> dict[str, Any]:
    """The committed table; `InputError` if there is none or it is no such table."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        for entry in content.values():
            _ = entry["size"], entry["ratios"].items()
    except FileNotFoundError:
        raise InputError(
            f"{path}: there is no table to compare with; make one by `make bench-publish`"
        ) from None
    except (ValueError, TypeError, KeyError, AttributeError):
        raise InputError(
            f"{path}: expected ratios by study; make the table anew by `make bench-publish`"
        ) from None
    return content


def losses(records: Iterable[Record], reference: Mapping[str, Any]) -> list[str]:
    """A sentence for each ratio that lost more than `LOSS`, or that a study no longer measures.

    Studies of another size than the table's, and those that did not run, are not compared.
    """
    found: list[str] = []
    for record in records:
        entry = reference.get(record.study)
        if entry is None or entry["size"] != record.size:
            continue
        now = {ratio.name: ratio.ratio.value for ratio in record.measured.ratios}
        for name, before in entry["ratios"].items():
            if name not in now:
                found.append(f"{record.study}, {name}: was {before:.3g} and is not measured any more")
            elif not now[name] >= (1 - LOSS) * before:
                lost = 1 - now[name] / before
                found.append(
                    f"{record.study}, {name}: {now[name]:.3g} instead of {before:.3g}, {lost:.0%} less"
                )
    return found
