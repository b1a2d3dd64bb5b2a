"""What a recipe takes is estimated before any work; what does not fit is refused by its field."""

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from pcii.base import InputError, command_line
from simgen.app import commands as cli
from simgen.dataset import check_resources, peak_bytes, shortage
from simgen.photons import Plan
from simgen.spec import Recipe

ROOM = 8e9
DEPTHS_MM = (500.0, 600.0, 3000.0)
THINS = Plan(thins=True, samples=1, photons_per_view=1e3, depths_mm=DEPTHS_MM)


def recipe(**values: Any) -> Recipe:
    return Recipe.model_validate({"scene": "two_objects", **values})


TOO_MUCH: list[tuple[dict[str, Any], str]] = [
    ({"sensor": {"dark_counts": 1e6}}, "sensor.dark_counts"),
    ({"sensor": {"hot_pixel_share": 0.01, "hot_pixel_counts": 1e9}}, "sensor.hot_pixel_share"),
    ({"grid": {"rows": 10**8}}, "grid.rows"),
    ({"grid": {"height": 10**6}, "render": {"samples_per_pixel": 1}}, "grid.height"),
    ({"grid": {"shear_px": [0.0, -1e9]}}, "grid.pixel_mm"),
    ({"analysis": {"z_mm": [500.0 + n for n in range(5000)]}}, "analysis.z_mm"),
    ({"photons": {"budget": 1e6}}, "photons.budget"),
]


@pytest.mark.parametrize(("values", "field"), TOO_MUCH)
def test_what_does_not_fit_is_named_by_its_field(values: dict[str, Any], field: str) -> None:
    plan = None if field == "grid.rows" else THINS  # whose photons grow with the views
    if field == "photons.budget":
        plan = replace(THINS, photons_per_view=1e6)
    sentence: Any = shortage(recipe(**values), plan, ROOM)
    assert sentence.startswith(field)
    assert (shortage(recipe(), THINS, ROOM, map_counts=1e8) or "").startswith("sensor.hot_pixels")
    assert "this machine has 8 GB available" in sentence


def test_ordinary_recipes_fit() -> None:
    assert shortage(recipe(), THINS, ROOM) is None
    assert shortage(recipe(sensor={"hot_pixel_share": 0.01, "dark_counts": 1e-3}), THINS, ROOM) is None
    # In rendered views there are no more photons than pixels: 100 x 1024 x 1024 of 200 B.
    bright = replace(THINS, thins=False, photons_per_view=1e15)
    assert peak_bytes(recipe(), bright) == 4e8 + 200 * 100 * 1024**2


def test_a_disk_that_is_too_small_is_named_unless_views_are_there(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    wanted = recipe(products={"radiance": "rgb"})  # 100 views of 12.6 MB, of which half is written at least
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=6e8))
    with pytest.raises(InputError, match=r"products\.radiance: rendered views .* 630 MB .* has 600 MB left"):
        check_resources(wanted, None, tmp_path / "new" / "out")
    check_resources(recipe(), None, tmp_path / "out")
    (tmp_path / "radiance").mkdir()
    with (tmp_path / "radiance" / "view_00_00.exr").open("wb") as file:
        file.truncate(1 << 26)
    check_resources(wanted, None, tmp_path)


@pytest.mark.renders
def test_commands_refuse_before_any_work(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    setting, out = "sensor.dark_counts=1e6", tmp_path / "out"
    assert command_line.run(cli.app, ["check", "paper", "--set", setting]) == 1
    sentence = "sensor.dark_counts: takes some 21000 TB of memory, and this machine has"
    assert f"bad   memory      {sentence}" in capsys.readouterr().out
    assert command_line.run(cli.app, ["generate", "paper", "--set", setting, "-o", str(out)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"error: {sentence}")
    assert error.count("\n") == 1
    assert not out.exists()
