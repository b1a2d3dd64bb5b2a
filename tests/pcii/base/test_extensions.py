"""Methods that are named as module:function or file.py:function."""

import pickle
import sys
from pathlib import Path

import pytest
from twins import even_light, unit_grid

import pcii
from pcii.base import InputError, load_function
from pcii.evaluation import named_methods

CODE = """
import numpy as np
from pcii import DepthMap, Segmented

def remove(counts, sections):
    return Segmented(sections.counts[..., 0] > 0, "mine", sections)

def depth(data, z_range_mm):
    return DepthMap(np.full(data.grid.shape_HW, z_range_mm[0]), np.ones(data.grid.shape_HW))

number = 3
"""


@pytest.mark.parametrize(
    "name", ["{folder}/own_removal.py:remove", "own_removal.py:remove", "own_removal:remove"]
)
def test_a_function_of_a_file_or_a_module_is_a_method(tmp_path: Path, monkeypatch, name: str) -> None:
    (tmp_path / "own_removal.py").write_text(CODE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", sys.path.copy())
    name = name.format(folder=tmp_path)
    counts = even_light(unit_grid(2, 2, 5, 6), 0.5, seed=1)
    assert pcii.segment(counts, 1.0, method=name).method == "mine"
    assert (pcii.estimate_depth(counts, (1.0, 2.0), method=name.replace("remove", "depth")).z_mm == 1).all()
    function = load_function(name)
    assert pickle.loads(pickle.dumps(function)) is function
    methods = named_methods([name, f"depth:{name}"])
    assert [method.name for method in methods] == ["remove", "depth:remove"]
    assert {method.function for method in methods} == {function}
    del sys.modules["own_removal"]


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("own_numbers.py:nothing", r"AttributeError: .*nothing"),
        ("json.py:dumps", r"a module of the name 'json' is at .*rename the file"),
        ("own_numbers.py:number", "is int, which cannot be called"),
    ],
)
def test_what_is_no_function_is_refused(tmp_path: Path, monkeypatch, name: str, sentence: str) -> None:
    for file in ("own_numbers.py", "json.py"):
        (tmp_path / file).write_text(CODE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", sys.path.copy())
    sys.modules.pop("own_numbers", None)
    with pytest.raises(InputError, match=f"^method: '{name}' .*{sentence}"):
        load_function(name)
