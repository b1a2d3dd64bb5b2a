"""Names of submissions: what could be taken for another name, or for what is no method, is refused."""

import json
import shutil
from pathlib import Path

import pytest
from hostile_submissions import edit

from pcii.base import InputError
from pcii.evaluation import SUBMISSION, read_submission, write_page
from pcii.evaluation.benchmark_page import COMPARISONS
from pcii.evaluation.rows import ROWS
from pcii.evaluation.tables import SIMPLE

SHIPPED = Path(__file__).parents[3] / "docs" / "submissions" / "variance"
NO_METHODS = [
    *SIMPLE,
    *(comparison.bound for comparison in COMPARISONS if comparison.bound),
    *("(Everything)", "( nothing )", "\uff08one depth\uff09", "\u27ee everything \u27ef", "[nothing]"),
]
UNSEEN = [
    "\u200b",
    "\u202e",
    "\u2069",
    "\xad",
    "\ufe0f",
    "\u034f",
    "\u115f",
    "\u2800",
    "\U000e0061",
    "\ue000",
]
OF_OTHERS = [
    *(f"my{letter}net" for letter in [*UNSEEN, "  ", "\xa0", "\n", "\0"]),
    *(" net", "net ", "\uff4eet", "ne\u0301t", "\U0001d427et", "\ufb01ne", "my\u2010net"),
    *("n\u0435t", "\u03bdet", "net\u0338"),  # Cyrillic, Greek, a mark that overlays
    *("Brightness", "BRIGHTNESS", "Sweep-17", "structure-tensor", "Depth"),
    *("depth:net", "depth:depth:net", "depth:", "my_module:net", "depth\u2236net"),
]


def submitted(folder: Path, **about: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / SUBMISSION).write_text(json.dumps({"benchmark": "b", "method": "net"} | about))
    return folder


@pytest.mark.parametrize("name", [*NO_METHODS, *OF_OTHERS], ids=ascii)
def test_names_that_could_be_taken_for_others_are_refused(name: str, tmp_path: Path) -> None:
    says = f"{SUBMISSION}: method: (expected a name of letters|the name '.*' is taken; choose another one)"
    with pytest.raises(InputError, match=says):
        read_submission(submitted(tmp_path, method=name), "b")


@pytest.mark.parametrize(
    "name", ["Größe 2.1", "β-net, 3rd try", "方法", "метод", "深層ネット", "a<b", "U-Net + CRF"]
)
def test_names_of_any_language_are_taken(name: str, tmp_path: Path) -> None:
    assert read_submission(submitted(tmp_path, method=name), "b").methods == (f"depth:{name}", name)


def test_authors_are_seen_and_addresses_are_of_the_web(tmp_path: Path) -> None:
    good = {"authors": "José O’Brien & 李明", "url": "https://example.org/a?b=c#d"}
    assert read_submission(submitted(tmp_path, **good), "b").model_dump().items() >= good.items()
    authors = [f"A.{letter} N." for letter in (*UNSEEN, " ")]
    urls = ["javascript:x", "example.org", "https://g\u0456t.org", "https://a\u200b.org", "https://a .org"]
    for field, texts in {"authors": [*authors, "\uff21. N."], "url": urls}.items():
        for text in texts:
            with pytest.raises(InputError, match=f"{SUBMISSION}: {field}: expected .*, got '.*'$"):
                read_submission(submitted(tmp_path, **{field: text}), "b")


def test_a_page_has_each_name_once_whatever_its_case_and_rows_of_that_name(tmp_path: Path) -> None:
    made = '"method": "{}", "made": "scored from maps by pcii benchmark score"'
    for folder, name in (("ours", "net"), ("theirs", "Net")):
        shutil.copytree(SHIPPED, tmp_path / folder)
        edit(SUBMISSION, r'(?s)"method": .*(?=,\s+"half")', made.format(name))(tmp_path / folder)
    with pytest.raises(InputError, match=r"ours/rows\.jsonl: has rows of 'variance', which submission.json"):
        write_page(tmp_path, tmp_path / "page.html")
    edit(ROWS, "(?s).*", (SHIPPED / ROWS).read_text().replace('"variance"', '"net"'))(tmp_path / "ours")
    with pytest.raises(InputError, match=r"ours and theirs are both of 'Net', in upper or lower case$"):
        write_page(tmp_path, tmp_path / "page.html")
    edit(SUBMISSION, '"Net"', '"(nothing)"')(tmp_path / "theirs")
    with pytest.raises(InputError, match=r"theirs/submission.json: method: .*, got '\(nothing\)'$"):
        write_page(tmp_path, tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()
