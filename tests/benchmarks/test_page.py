import inspect
from pathlib import Path

import pytest
from PIL import Image
from records import STUDY, record

from benchmarks import __main__ as command
from benchmarks.page import write_page
from benchmarks.results import read_record
from benchmarks.studies import STUDIES


def test_the_markdown_page_has_figure_reading_tables_and_ratios(tmp_path: Path) -> None:
    write_page(tmp_path / "page.md", [STUDY], [record()])
    text = (tmp_path / "page.md").read_text()
    assert "![A study of nothing](benchmarks/nothing.png)" in text
    assert "Ours takes 2 ms. Two. Three." in text
    assert "| ours against theirs | 4 (3.5 to 4.5) |" in text
    assert "abacus, 2 cores" in text
    with Image.open(tmp_path / "benchmarks" / "nothing.png") as picture:
        assert min(picture.size) > 300


def test_a_run_leaves_results_and_prints_its_tables(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = command.measure(STUDY, "quick", tmp_path)
    assert read_record(tmp_path / "nothing.json").measured == made.measured
    assert made.versions["numpy"]
    assert "| ours | 4 | 2 (1.5 to 2.5) | 0.125 |" in capsys.readouterr().out


def test_every_study_has_both_sizes_and_they_fit() -> None:
    names = [study.name for study in STUDIES]
    assert len(set(names)) == len(names)
    for study in STUDIES:
        assert set(study.sizes) == {"quick", "full"}
        for size in study.sizes.values():
            inspect.signature(study.measure).bind(**size)
