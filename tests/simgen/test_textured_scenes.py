"""Textures in scenes: as cameras see them, in datasets, and told in one sentence if they are wrong."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pcii.base.errors import InputError
from simgen.assets.texture_pixels import paint
from simgen.base.strict_models import validate
from simgen.renderer import backend
from simgen.renderer.mitsuba_scene import build
from simgen.renderer.radiance import render_view
from simgen.spec.recipe import Grid
from simgen.spec.scene import Scene
from simgen.spec.textures import Checks, Edge, Noise, Star, Stripes, Text


def scene_of(texture: Any) -> dict[str, Any]:
    """A card that fills the view of one camera exactly, in even light, so that it shows its texture."""
    card = {
        "name": "card",
        "position_mm": (0.0, 0.0, 500.0),
        "shape": {"type": "card", "width_mm": 48.0, "height_mm": 32.0},
        "material": {"texture": texture},
    }
    return {"title": "t", "lights": [{"type": "uniform", "luminance_cd_m2": 1.0}], "objects": [card]}


@pytest.mark.renders
def test_a_camera_sees_a_cards_texture_as_it_was_painted() -> None:
    texture = {"type": "text", "text": "LF", "pixels": 192, "colours": [[0.9, 0.2, 0.2], [0.3, 0.3, 0.9]]}
    scene = validate(Scene, scene_of(texture), "t")
    built = build(backend.load(), scene, Path(), max_depth=2)
    # 48 x 32 pixels of 0.1 mm at 50 mm see 48 x 32 mm at 500 mm: four texels to a pixel.
    grid = Grid(rows=1, cols=1, focal_mm=50.0, pixel_mm=0.1, height=32, width=48).camera_grid()
    seen = render_view(built, grid, 0, 0, samples_per_pixel=256, seed=1)
    chosen = scene.objects[0].material.texture
    assert isinstance(chosen, Text)
    painted = paint(chosen, 1.5).reshape(32, 4, 48, 4, 3).mean((1, 3))
    # In even light of 1 cd/m^2 radiance is reflectance; a pixel on a border is known to 0.5 / sqrt(256)
    # of the colours' difference, 0.03, and 4.5 deviations of that hold for all of them.
    np.testing.assert_allclose(seen, painted, atol=0.14)
    assert np.abs(seen - painted).mean() < 0.01
    assert np.abs(seen - painted[:, ::-1]).mean() > 0.05
    assert np.abs(seen - painted[::-1]).mean() > 0.05


@pytest.mark.parametrize(
    ("texture", "message"),
    [
        (
            {"type": "checks", "rows": 2, "columns": 2, "colums": 3},
            "unknown key 'objects[0].material.texture.colums'; did you mean 'columns'?",
        ),
        (
            {"type": "cheks"},
            "'objects[0].material.texture.type': there is no 'cheks'; did you mean 'checks'?",
        ),
        (
            {"type": "zebra"},
            "material.texture.type': there is no 'zebra'; known are checks, edge, noise, star, stripes, text",
        ),
        ({"spokes": 3}, "'objects[0].material.texture.type' is missing"),
        (7, "'objects[0].material.texture': give the name of an image file or a table such as {"),
        ({"type": "text"}, "'objects[0].material.texture.text' is missing"),
        ({"type": "text", "text": 3}, "'objects[0].material.texture.text': input should be a valid string"),
        ({"type": "text", "text": "a\nb"}, "text: '\\n' cannot be drawn; use printable Latin-1 characters"),
        ({"type": "text", "text": "Ω"}, "text: 'Ω' cannot be drawn"),
        ({"type": "text", "text": "  "}, "text: give at least one character that is no space"),
        ({"type": "star", "pixels": 5000}, "'objects[0].material.texture.pixels'"),
        ({"type": "edge", "colours": [[0, 0, 0]]}, "'objects[0].material.texture.colours[1]' is missing"),
        ({"type": "edge", "colours": [[0, 0, 0], [0, 2, 0]]}, "'objects[0].material.texture.colours[1][1]'"),
        ({"type": "noise", "contrast": 2}, "contrast: 2 puts more than 1% of the values outside 0 to 1; use"),
    ],
)
def test_a_wrong_texture_is_told_in_one_sentence(texture: Any, message: str) -> None:
    with pytest.raises(InputError) as caught:
        validate(Scene, scene_of(texture), "s.toml")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_schema_describes_every_field_of_every_texture() -> None:
    schema = Scene.model_json_schema()
    for texture in (Checks, Stripes, Star, Edge, Text, Noise):
        told = schema["$defs"][texture.__name__]
        assert told["description"]
        for name, entry in told["properties"].items():
            assert name == "type" or entry["description"], f"{texture.__name__}.{name}"
