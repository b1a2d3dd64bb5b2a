"""The guard: ratios of a run against those of the last committed table; never seconds, which are a machine's.

A ratio says how many times better ours is than what was measured beside it in the same run. Speeds of a
machine cancel in it, though not what makes one processor better than another at one kind of work.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from benchmarks.results import Record

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
            "ratios": {name: round(ratio.value, 4) for name, ratio in record.measured.ratios.items()},
        }
        for record in records
        if record.measured.ratios
    }


def losses(records: Iterable[Record], reference: Mapping[str, Any]) -> list[str]:
    """A sentence for each ratio that lost more than `LOSS`, or that a study no longer measures.

    Studies of another size than the table's, and those that did not run, are not compared.
    """
    losses: list[str] = []
    for record in records:
        entry = reference.get(record.study)
        if entry is None or entry["size"] != record.size:
            continue
        for name, before in entry["ratios"].items():
            now = record.measured.ratios.get(name)
            if now is None:
                losses.append(f"{record.study}, {name}: was {before:.3g} and is not measured any more")
            elif not now.value >= (1 - LOSS) * before:
                lost = 1 - now.value / before
                losses.append(
                    f"{record.study}, {name}: {now.value:.3g} instead of {before:.3g}, {lost:.0%} less"
                )
    return losses
