import json
from pathlib import Path

import pytest
from records import record

from benchmarks.results import read_record, write_record
from benchmarks.timing import median_of, ratio_of, side_by_side, timed
from pcii.base import InputError


def test_a_record_reads_as_it_was_written(tmp_path: Path) -> None:
    write_record(tmp_path, record())
    assert read_record(tmp_path / "nothing.json") == record()
    content = json.loads((tmp_path / "nothing.json").read_text())
    assert content["machine"]["processor"] == "abacus"
    assert content["measured"]["seeds"] == [1, 2]


@pytest.mark.parametrize("text", ['{"study": "nothing"}', "{"])
def test_a_file_that_is_no_record_is_refused_by_name(tmp_path: Path, text: str) -> None:
    path = tmp_path / "nothing.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"nothing\.json: expected results of a study"):
        read_record(path)


def test_works_take_turns_and_the_first_round_is_not_counted() -> None:
    calls: list[tuple[str, int]] = []
    works = {name: lambda n, name=name: calls.append((name, n)) for name in "ab"}
    seconds = side_by_side(works, repeats=2)
    assert calls == [("a", 0), ("b", 0), ("a", 1), ("b", 1), ("a", 2), ("b", 2)]
    assert {name: len(taken) for name, taken in seconds.items()} == {"a": 2, "b": 2}
    assert timed(lambda n: n, repeats=3)[1] == 3


def test_intervals_of_medians_are_order_statistics() -> None:
    # Both ends of 6 miss the median with the probability 2 / 2^6 = 3 %, of 5 with 6 %.
    assert median_of([1.0, 2.0, 3.0, 4.0, 5.0]).low is None
    six = median_of([6.0, 1.0, 5.0, 2.0, 4.0, 3.0], scale=10)
    assert (six.value, six.low, six.high) == (35, 10, 60)
    # Of 12 the third on either side: 2 (1 + 12 + 66) / 2^12 = 3.9 %.
    twelve = median_of([float(n) for n in range(1, 13)])
    assert (twelve.low, twelve.high) == (3, 10)


def test_ratios_are_taken_round_by_round() -> None:
    # Were they of medians, the slow third round of both would count.
    found = ratio_of("x", [2.0, 4.0, 90.0], [1.0, 1.0, 30.0], asked=2, scale=10)
    assert (found.ratio.value, found.asked) == (30, 2)
