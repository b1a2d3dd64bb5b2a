"""Methods of other packages, as if installed: a module and its entry points in a folder of the path."""

import sys
from pathlib import Path

import numpy as np
import pytest
from other_packages import install_package
from twins import even_light, unit_grid

from pcii.base import InputError
from pcii.removal import METHODS, removal_methods, segment
from pcii.types import PhotonCounts

CODE = """
from dataclasses import replace
import numpy as np
from pcii import PhotonCounts, Sections, Segmented, reconstruct

def good(counts, sections):
    assert isinstance(counts, PhotonCounts) and isinstance(sections, Sections)
    mask = sections.counts.sum(axis=-1) > 0
    return Segmented(mask, "good", sections)

def text(counts, sections):
    return "in focus"

def fine(counts, sections):
    sections = reconstruct(counts, sections.planes, subpixel=2)
    return Segmented(sections.counts[..., 0] > 0, "fine", sections)

def photons(counts, sections):
    kept = np.ones((len(sections.planes), 1 + counts.events.n.size), dtype=bool)
    return replace(good(counts, sections), method="photons", photon_in_focus=kept)

def renamed(counts, sections):
    return good(counts, sections)

def steps(counts, sections):
    return Segmented(good(counts, sections).in_focus, "steps", sections, {"blur": np.ones(3)})

def alone(counts):
    return good(counts, None)

def writing(counts, sections):
    sections.counts[0] = 0
    return good(counts, sections)

number = 3
"""


def install(folder: Path, monkeypatch: pytest.MonkeyPatch, **points: str) -> None:
    """Install `CODE` as strange_code.py with these entry points (underscores for hyphens)."""
    points = {name.replace("_", "-"): value for name, value in points.items()}
    install_package(folder, monkeypatch, {"pcii.methods": points}, {"strange_code.py": CODE})


def counts() -> PhotonCounts:
    return even_light(unit_grid(2, 2, 5, 6), 0.5, seed=1)


def test_a_method_of_another_package_is_found_by_name(tmp_path, monkeypatch):
    assert removal_methods() == tuple(METHODS)
    install(tmp_path, monkeypatch, good="strange_code:good")
    assert removal_methods() == (*METHODS, "good")
    focus = segment(counts(), [1.0, 2.0], method="good")
    np.testing.assert_array_equal(focus.in_focus, focus.sections.counts[..., 0] > 0)


def test_nothing_is_imported_before_it_is_asked_for(tmp_path, monkeypatch):
    install(tmp_path, monkeypatch, broken="no_such_module:remove")
    assert "broken" in removal_methods()
    segment(counts(), 1.0, method="brightness")
    with pytest.raises(
        InputError, match=r"^method: 'broken' of the package strange cannot be loaded: .*no_such"
    ):
        segment(counts(), 1.0, method="broken")


def test_the_name_of_a_built_in_cannot_be_taken(tmp_path, monkeypatch):
    install(tmp_path, monkeypatch, posterior="strange_code:good")
    with pytest.raises(
        InputError, match=r"strange_code:good of the package strange needs another name than 'posterior'"
    ):
        removal_methods()
    assert segment(counts(), 1.0, method="posterior").method == "posterior"


def test_a_name_that_makes_no_file_name_is_refused(tmp_path, monkeypatch):
    install(tmp_path, monkeypatch, **{"../good": "strange_code:good"})
    with pytest.raises(InputError, match=r"needs another name than '\.\./good'"):
        removal_methods()


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("text", r"must return a pcii\.Segmented, not str$"),
        ("fine", r"must return a Segmented of the sections that it was given$"),
        ("renamed", r"must return its own name as `method`, not 'good'$"),
        ("photons", r"must return photon_in_focus for the \d+ events of the counts, not for \d+$"),
        ("number", r"is int, which cannot be called$"),
        ("steps", r"must return maps \(1, 5, 6\) in `steps`, and 'blur' is none$"),
        ("alone", r"failed: TypeError: alone\(\) takes 1 positional argument but 2 were given$"),
        ("writing", r"failed: ValueError: assignment destination is read-only$"),
    ],
)
def test_nonsense_is_reported_in_one_sentence(tmp_path, monkeypatch, name, sentence):
    install(tmp_path, monkeypatch, **{name: f"strange_code:{name}"})
    method = name.replace("_", "-")
    with pytest.raises(InputError, match=rf"^method: '{method}' of the package strange {sentence}"):
        segment(counts(), 1.0, method=method)
    if name not in ("number", "renamed"):  # a function may be given by another name than that of its result
        function = getattr(sys.modules["strange_code"], name)
        with pytest.raises(InputError, match=rf"^method: '{name}' {sentence}"):
            segment(counts(), 1.0, method=function)
