"""What a recipe takes is estimated before any work; what does not fit is refused by its field."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pcii.base import command_line
from pcii.base.errors import InputError
from simgen.app import commands as cli
from simgen.dataset import resources
from simgen.dataset.prepared import needs_of
from simgen.dataset.resources import Needs, check_resources, peak_bytes, shortage, tile_count
from simgen.photons.counting_plan import Plan
from simgen.photons.disparity_layers import layers_for, tile_px_for
from simgen.photons.exploration import MAX_RAYS
from simgen.spec.recipe import Recipe

ROOM = 8e9
THINS = Plan(
    thins=True,
    samples=1,
    photons_per_view=1e3,
    noise=0.0,
    normaliser_error=0.0,
    depths_mm=(500.0, 600.0, 3000.0),
)


def needs(**values: Any) -> Needs:
    return needs_of(Recipe.model_validate({"scene": "two_objects", **values}))


TOO_MUCH: list[tuple[dict[str, Any], str]] = [
    ({"sensor": {"dark_counts": 1e6}}, "sensor.dark_counts"),
    ({"sensor": {"hot_pixel_share": 0.01, "hot_pixel_counts": 1e9}}, "sensor.hot_pixel_share"),
    ({"grid": {"rows": 10**8}}, "grid.rows"),
    ({"grid": {"height": 10**6}, "render": {"samples_per_pixel": 1}}, "grid.height"),
    ({"grid": {"pixel_mm": 1e-6}}, "grid.pixel_mm"),
    ({"grid": {"shear_px": [0.0, -1e9]}}, "grid.pixel_mm"),
    ({"analysis": {"z_mm": [500.0 + n for n in range(5000)]}}, "analysis.z_mm"),
    ({"photons": {"budget": 1e6}}, "photons.budget"),
]


@pytest.mark.parametrize(("values", "field"), TOO_MUCH)
def test_what_does_not_fit_is_named_by_its_field(values: dict[str, Any], field: str) -> None:
    plan = None if field == "grid.rows" else THINS  # whose photons grow with the views
    if field == "photons.budget":
        plan = replace(THINS, photons_per_view=1e6)
    sentence = shortage(needs(**values), plan, ROOM)
    assert sentence is not None
    assert sentence.startswith(field)
    assert "this machine has 8 GB available" in sentence


def test_ordinary_recipes_fit() -> None:
    assert shortage(needs(), THINS, ROOM) is None
    assert shortage(needs(sensor={"hot_pixel_share": 0.01, "dark_counts": 1e-3}), THINS, ROOM) is None
    # In rendered views there are no more photons than pixels: 100 x 1024 x 1024 of 200 B.
    assert (
        peak_bytes(needs(), replace(THINS, thins=False, photons_per_view=1e15)) == 4e8 + 200 * 100 * 1024**2
    )


@pytest.mark.parametrize(
    "grid",
    [{}, {"rows": 4, "cols": 7, "pixel_mm": 0.01}, {"shear_px": [9.0, -3.0]}, {"pitch_mm": [2.0, 30.0]}],
)
def test_tiles_are_counted_as_the_majorant_has_them(grid: dict[str, Any]) -> None:
    cameras, z_mm = needs(grid=grid).grid.camera_grid(), np.array([480.0, 500, 503, 640, 2000, np.inf])
    made = layers_for(cameras, tile_px_for(cameras, MAX_RAYS), z_mm).tiles
    assert tile_count(cameras, z_mm) == pytest.approx(made, rel=0.02)  # shifts there are whole and even


def test_a_disk_that_is_too_small_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    wanted = needs(products={"radiance": "rgb"})  # 100 views of 12.6 MB, of which half is written at least
    monkeypatch.setattr(resources, "_free_bytes", lambda _: 6e8)
    with pytest.raises(InputError, match=r"products\.radiance: rendered views .* 630 MB .* has 600 MB left"):
        check_resources(wanted, None, tmp_path / "out")
    check_resources(needs(), None, tmp_path / "out")


def test_what_is_rendered_already_needs_no_more_disk(tmp_path: Path) -> None:
    before = resources._free_bytes(tmp_path / "new" / "out")
    (tmp_path / "radiance").mkdir()
    with (tmp_path / "radiance" / "view_00_00.exr").open("wb") as file:
        file.truncate(1 << 38)  # takes no place
    assert resources._free_bytes(tmp_path) > before + (1 << 37)


@pytest.mark.renders
@pytest.mark.parametrize("setting", ["sensor.dark_counts=1e6", "grid.pixel_mm=1e-6"])
def test_commands_refuse_before_any_work(
    setting: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    field = setting.split("=")[0]
    assert command_line.run(cli.app, ["check", "paper", "--set", setting]) == 1
    (told,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("bad   memory"))
    out = tmp_path / "out"
    assert command_line.run(cli.app, ["generate", "paper", "--set", setting, "-o", str(out)]) == 2
    said = capsys.readouterr().err
    for text in (told.removeprefix("bad   memory       "), said.removeprefix("error: ")):
        assert text.startswith(field)
        assert "of memory, and this machine has" in text
    assert said.count("\n") == 1
    assert not out.exists()
