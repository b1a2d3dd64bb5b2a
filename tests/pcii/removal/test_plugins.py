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


def test_methods_of_another_package_are_found_by_name_and_imported_when_they_are_used(tmp_path, monkeypatch):
    assert removal_methods() == tuple(METHODS)
    install(tmp_path, monkeypatch, good="strange_code:good", broken="no_such_module:remove")
    assert removal_methods() == (*METHODS, "good", "broken")
    focus = segment(counts(), [1.0, 2.0], method="good")
    np.testing.assert_array_equal(focus.in_focus, focus.sections.counts[..., 0] > 0)
    words = r"^method: 'broken' of the package strange cannot be loaded: .*no_such"
    with pytest.raises(InputError, match=words):
        segment(counts(), 1.0, method="broken")


@pytest.mark.parametrize("name", ["posterior", "../good"])
def test_the_name_of_a_built_in_and_one_that_makes_no_file_name_are_refused(tmp_path, monkeypatch, name):
    install(tmp_path, monkeypatch, **{name: "strange_code:good"})
    words = f"strange_code:good of the package strange needs another name than '{name}'"
    with pytest.raises(InputError, match=words):
        removal_methods()
    assert segment(counts(), 1.0, method="brightness").method == "brightness"


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
