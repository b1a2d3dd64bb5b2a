"""Methods pooled over scenes, figures by hand; the page marks the best, and says what it was made by."""

import hashlib
from pathlib import Path
from typing import Any

import pytest

from pcii.evaluation.evaluation_pages import write_evaluation
from pcii.evaluation.rows import append_row, claim_rows
from pcii.evaluation.summary import summarise

A, B = "depth:a", "depth:b"


def row(scene: str, seed: int, method: str, bad_1px: float, **more: Any) -> dict[str, Any]:
    head = {"dataset": f"seed_{seed}", "identity": f"{scene} {seed}", "seed": seed, "seconds": 1.0}
    head |= {"recipe": scene, "title": scene, "scene": scene, "budget": 30.0, "photons_per_view": 30.0}
    return head | {"method": method, "depth": {"bad_1px": bad_1px}} | more


BY_HAND = [
    row("cards", 1, A, 0.25),
    row("cards", 2, A, 0.75),
    row("cards", 1, B, 0.5),
    row("cards", 2, B, 1.0),
    row("slats", 1, A, 0.25),
    row("slats", 1, B, 0.75),
    row("slats", 2, B, 0.0),  # datasets that the other method has not seen
    row("slats", 3, A, 1.0),
    row("alone", 1, B, 0.0),  # and a scene
]


def test_each_scene_counts_once_with_the_seeds_that_all_methods_have() -> None:
    (entry,) = summarise(BY_HAND)["pooled"]
    assert (entry["measure"], entry["budget"], entry["scenes"], entry["datasets"]) == ("bad_1px", 30.0, 2, 3)
    first, second = entry["methods"]
    # a: 0.5 and 0.25; b: 0.75 twice, so it is worse by 0.25 and 0.5, with 12.706 * 0.125 to either side.
    assert (first["method"], first["rank"], first["mean"]["mean"]) == (A, 1, 0.375)
    assert first["difference"] is first["p"] is None
    assert (second["method"], second["rank"], second["mean"]["mean"]) == (B, 2, 0.75)
    assert second["mean"]["interval"] == [0.75, 0.75]
    assert second["difference"]["mean"] == 0.375
    assert second["difference"]["interval"] == pytest.approx([0.375 - 1.588, 0.375 + 1.588], abs=1e-3)
    assert second["p"] == second["least_p"] == 0.5


@pytest.mark.parametrize(("scenes", "least"), [(1, None), (2, 1 / 2), (6, 1 / 32), (15, 1 / 10_001)])
def test_what_p_cannot_be_less_than_follows_from_the_number_of_scenes(
    scenes: int, least: float | None
) -> None:
    rows = [
        row(f"scene {scene}", 1, method, bad) for scene in range(scenes) for method, bad in ((A, 0), (B, 1))
    ]
    found = [entry["methods"][1] for entry in summarise(rows)["pooled"]]
    assert [one["least_p"] for one in found] == ([] if least is None else [least])
    assert all(one["p"] >= one["least_p"] for one in found)


def test_equal_methods_share_a_rank_and_none_is_marked(tmp_path: Path) -> None:
    rows = [row(scene, 1, method, 0.5) for scene in ("cards", "slats") for method in (A, B)]
    evaluation = summarise(rows)
    assert [each["rank"] for each in evaluation["pooled"][0]["methods"]] == [1, 1]
    claim_rows(tmp_path)
    write_evaluation(tmp_path, evaluation)
    assert "**" not in (tmp_path / "evaluation.md").read_text()


def test_the_page_marks_the_best_and_can_be_cited(tmp_path: Path) -> None:
    older, newer = ({"numpy": "2.1", "python": "3.11"}, {"numpy": "2.2", "python": "3.11"})
    claim_rows(tmp_path)
    rows = [
        each
        | {"software": older if number < 3 else newer, "date": f"2026-01-{10 + number}", "machine": "EPYC"}
        for number, each in enumerate(BY_HAND)
    ]
    for each in rows:
        append_row(tmp_path, each)
    write_evaluation(tmp_path, summarise(rows))
    text, page = ((tmp_path / f"evaluation.{ending}").read_text() for ending in ("md", "html"))
    assert "| **depth:a** | 30 | 1 | **0.375 (0.000 to 1.000)** | – | – | – | 2 | 3 |" in text
    assert (
        "| depth:b | 30 | 2 | 0.750 (0.750 to 0.750) | 0.375 (-1.213 to 1.963) | 0.5 | 0.5 | 2 | 3 |" in text
    )
    assert '<td class="left"><strong>depth:a</strong></td>' in page
    digest = hashlib.sha256((tmp_path / "rows.jsonl").read_bytes()).hexdigest()
    for cited in ("2 methods on 6 datasets of 3 scenes", "2026-01-10 to 2026-01-18", "EPYC", digest):
        assert cited in text
        assert cited in page
    assert "| numpy | 2.1 (3 rows); 2.2 (6 rows) |" in text
    assert "| python | 3.11 |" in text
    assert "Not all rows are of the same software (numpy): name all datasets" in text
