"""`simgen check`: each verdict on facts made by hand, and the probe on small scenes."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lit_scenes import ball

from pcii.base import command_line
from simgen.app import commands as cli
from simgen.cameras import coarser, disparities_px
from simgen.check import Facts, Finding, ObjectFacts, findings, probe_scene
from simgen.dataset import Prepared, peak_bytes, product_bytes
from simgen.photons import Plan
from simgen.spec import Recipe, Scene

SKY = {"type": "uniform", "luminance_cd_m2": 100.0}
EVEN = np.full(3, 0.25)
SPREAD_PX_MM = 9 * 50 * 5 / 0.0352
"""Of the paper's ten cameras: px of disparity between the outermost, times depth."""


def target_of(recipe: dict[str, Any], **scene: Any) -> Prepared:
    whole = Scene.model_validate({"title": "test", "lights": [SKY]} | scene)
    return Prepared(Recipe.model_validate({"scene": "test"} | recipe), whole, Path(), None)


def thing(name: str, *z_mm: float, share: float = 0.1, light: np.ndarray = EVEN, **more: Any) -> ObjectFacts:
    more = {"body_z_mm": (min(z_mm), max(z_mm)) if z_mm else (500.0, 510.0)} | more
    return ObjectFacts(name, np.array(z_mm), share, light, **more)


def facts(*objects: ObjectFacts, recipe: dict[str, Any] | None = None, **more: Any) -> Facts:
    scene = {"backdrop": more.pop("backdrop")} if "backdrop" in more else {}
    known = {
        "corners": 4,
        "luminance": 1.0,
        "colour_share": np.array([0.25, 0.5, 0.25]),
        "other_shares": {},
        "lamps_away": (),
        "plan": Plan(thins=True, samples=8, photons_per_view=1000.0),
        "path_s": 1e-7,
        "hit_s": 1e-7,
        "is_compiled": True,
        "memory_bytes": 1e12,
    }
    return Facts(target=target_of(recipe or {}, **scene), objects=objects, **(known | more))


def about(subject: str, known: Facts) -> list[Finding]:
    return [finding for finding in findings(known) if finding.subject == subject]


def verdicts(all_findings: list[Finding]) -> list[str]:
    return [finding.verdict for finding in all_findings]


@pytest.mark.parametrize(("apart", "verdict"), [(15.27, "ok"), (3.01, "ok"), (2.99, "warn"), (0.51, "warn")])
def test_objects_that_are_near_in_depth_are_warned_of(apart: float, verdict: str) -> None:
    far = 1 / (1 / 540 - apart / SPREAD_PX_MM)
    others = [thing("beside", 540.01), thing("behind", 900)]  # in one plane with a, and far away
    (finding,) = about("separation", facts(thing("a", 540), thing("b", far), *others))
    assert finding.verdict == verdict
    assert f"{apart:.2f} px" in finding.text


@pytest.mark.parametrize(
    ("z_mm", "verdict", "words"),
    [
        ((600, 606), "warn", "1.1 px of blur"),  # 9 * 7102 * (1/600 - 1/606)
        ((540, 540.001), "ok", "0.0 px of blur"),  # a flat scene is one on purpose
        ((540, 620), "ok", "15.3 px of blur"),
        ((6.9, 7.1), "bad", "1029"),  # 7102 / 6.9 px of 1024
        ((7.1, 7.5), "ok", "1000"),
    ],
)
def test_too_little_disparity_and_too_much(z_mm: tuple[float, float], verdict: str, words: str) -> None:
    (finding,) = about("disparity", facts(thing("a", *z_mm)))
    assert finding.verdict == verdict
    assert words in finding.text


def test_share_in_focus_is_what_blurs_by_one_pixel() -> None:
    # At 540 mm 1 px of half blur is 2 px of 63920 px mm / z: 1/540 - 1/z = 2/63920 at 549.3 mm.
    whole, blurred = thing("a", 540, 545, 549, 550), thing("b", 580, 581)
    known = facts(whole, recipe={"analysis": {"z_mm": [540, 620]}})
    first, empty = about("focus", known)
    assert (first.verdict, empty.verdict) == ("ok", "warn")
    assert "of a, the object least in focus, 75%" in first.text
    assert "no object is in focus at 620 mm" in empty.text
    poor = about("focus", facts(whole, blurred, recipe={"analysis": {"z_mm": [540]}}))[0]
    assert (poor.verdict, poor.remedy) == ("warn", "add 580 to analysis.z_mm")


def test_depths_that_nobody_names_are_warned_of() -> None:
    floor = thing("floor", 545, 900, is_scored=False)  # whose depths are no advice
    found = about("focus", facts(thing("a", 540), floor, thing("b", 620)))
    assert verdicts(found) == ["ok", "warn"]
    assert found[1].remedy == "add planes_mm = [540, 620] to the scene"


@pytest.mark.parametrize("z_range_mm", [[450, 541], [0.45, 0.75]])
def test_objects_outside_the_depth_range_are_warned_of(z_range_mm: list[float]) -> None:
    recipe = {"analysis": {"z_mm": [540], "z_range_mm": z_range_mm}}
    things = thing("a", 540), thing("b", 539, 544.2), thing("floor", 900, is_scored=False)
    found = about("focus", facts(*things, recipe=recipe))
    assert found[-1].verdict == "warn"
    assert found[-1].remedy == "analysis.z_range_mm = [539, 545]"


def test_planes_that_not_all_views_see_are_warned_of() -> None:
    few = about("overlap", facts(thing("a", 200)))  # 9 * 35.5 px of 1024 in both axes
    assert verdicts(few) == ["warn"]
    assert "47%" in few[0].text
    assert verdicts(about("overlap", facts(thing("a", 540)))) == ["ok"]


def test_colours_that_are_missing_are_told_with_a_remedy() -> None:
    even_mm = 50 * 5 / 0.0352 / 12  # where the paper's grid has 12 px per camera
    recipe = {"analysis": {"z_mm": [even_mm]}}
    (finding,) = about("colours", facts(thing("a", even_mm), recipe=recipe))
    assert finding.verdict == "warn"
    assert "75% have no R, 50% have no G, 75% have no B" in finding.text
    assert "pitch of" in finding.remedy
    assert verdicts(about("colours", facts(thing("a", 540)))) == ["ok"]
    monochrome = facts(thing("a", even_mm), recipe=recipe | {"sensor": {"cfa": "none"}})
    assert not about("colours", monochrome)


@pytest.mark.parametrize(
    ("object_facts", "verdict", "words"),
    [
        (thing("gone", corners_seeing=0), "bad", "no camera sees gone"),
        (thing("aside", corners_seeing=2), "warn", "the virtual centre, of which the truth is, does not"),
        (thing("edge", 540, corners_seeing_all=1), "warn", "1 of 4 corner cameras see all of edge"),
        (thing("floor", 540, corners_seeing_all=0, is_cut_at_centre=True), "ok", "see floor"),
        (thing("metres", body_z_mm=(0.46, 0.5)), "bad", "metres is at z = 0.46 to 0.5 mm"),
        (thing("behind", body_z_mm=(-60, -10)), "bad", "behind is at z = -60 to -10 mm"),
        (thing("around", 540, share=1.0, body_z_mm=(-60, 60)), "bad", "around is at z = -60 to 60 mm"),
        (thing("whole", 540), "ok", "see whole"),
    ],
)
def test_sight_of_one_object(object_facts: ObjectFacts, verdict: str, words: str) -> None:
    (finding,) = about("objects", facts(object_facts))
    assert finding.verdict == verdict
    assert words in finding.text
    assert verdicts(about("lights", facts(object_facts))) == ["ok"]
    assert bool(finding.remedy) == (verdict != "ok")


def test_a_lamp_may_stand_where_no_camera_sees_it() -> None:
    assert not about("objects", facts(thing("lamp", corners_seeing=0, shines=True)))


def test_darkness_lamps_that_face_away_glass_and_a_backdrop_in_metres() -> None:
    (dark,) = about("lights", facts(thing("a", 540), luminance=0.0))
    assert dark.verdict == "bad"
    away = about("lights", facts(thing("a", 540), lamps_away=(2,)))[0]
    assert away.verdict == "warn"
    assert "lights[1].target_mm" in away.remedy
    near = facts(thing("a", 540), backdrop={"z_mm": 0.9})
    assert verdicts(about("backdrop", near)) == ["bad"]
    glass = ball("a", 0, 540, (1, 1, 1)) | {"material": {"finish": {"type": "glass"}}}
    for depth, count in ((5, 1), (6, 0)):
        target = target_of({"render": {"max_depth": depth}}, objects=[glass])
        known = replace(facts(thing("a", 540)), target=target)
        assert verdicts(about("glass", known)) == ["warn"] * count


def test_photons_of_an_object_by_hand() -> None:
    # Of 1000 photons a view 1/4 R, 1/2 G, 1/4 B: 250 x 0.1 + 500 x 0.2 + 250 x 0.4 = 225.
    one = thing("a", 540, share=0.0225, light=np.array([0.1, 0.2, 0.4]))
    (finding,) = about("photons", facts(one))
    # 22500 over all views on 0.0225 x 1024^2 pixels: 0.954 each.
    assert finding.text == "a: 225 per view (22.5%), 22,500 in all, 0.95 per voxel"
    by_channel = facts(one, recipe={"photons": {"scope": "channel"}})
    assert about("photons", by_channel)[0].text.startswith("a: 233 per view")  # 1000 / 3 x 0.7
    half = facts(one, recipe={"sensor": {"quantum_efficiency": [0.5, 1.0, 0.25]}})
    assert about("photons", half)[0].text.startswith("a: 138 per view")  # 12.5 + 100 + 25


def test_few_photons_are_warned_of_and_the_remedy_gives_enough() -> None:
    dim = thing("dim", 540, share=1e-6, light=np.full(3, 0.0009))  # 0.9 a view, 90 in all
    (finding,) = about("photons", facts(dim))
    assert finding.verdict == "warn"
    budget = float(finding.remedy.split("photons.budget = ")[1].split(",")[0])
    assert 100 <= budget * 0.0009 * 100 < 115
    assert verdicts(about("photons", facts(replace(dim, light_share=np.full(3, 0.0011))))) == ["ok"]


def test_light_beside_the_objects_and_dark_counts_are_warned_of() -> None:
    one = thing("a", 540, share=0.01)
    others = {"what shines from all around": np.full(3, 0.6), "lamps in view": np.full(3, 0.15)}
    found = about("photons", facts(one, other_shares=others))
    assert verdicts(found) == ["ok", "warn"]
    parts = "what shines from all around 60.0%, lamps in view 15.0%"
    assert found[1].text == f"75.0% of the photons come from no object: {parts}"
    found = about("photons", facts(replace(one, is_scored=False), other_shares={"the backdrop": EVEN}))
    assert verdicts(found) == ["ok", "ok", "ok"]
    assert found[2].text == "25.0% of the photons come from objects that count in no score"
    assert not about("photons", facts(other_shares={"the backdrop": np.ones(3)}))  # nothing is hidden by it
    dark = about("photons", facts(one, recipe={"sensor": {"dark_counts": 0.001}}))[-1]
    assert dark.verdict == "warn"  # 1049 a view beside 1000
    assert "51% of all counts" in dark.text


def test_saturation_is_that_of_the_brightest_object() -> None:
    objects = thing("small", 540, share=0.001), thing("large", 620, share=0.1)
    many = about("photons", facts(*objects, recipe={"sensor": {"frames": 100, "bits": 1}}))[-1]
    # A quarter of 1000 photons on a thousandth of the pixels.
    assert many.text == "small: 0.0024 photons per pixel and frame, of which 0.1% saturate"
    one = about("photons", facts(*objects, recipe={"sensor": {"bits": 1}}))[-1]
    assert "0.24 photons per pixel and frame, of which 11.0% saturate" in one.text
    assert (many.verdict, one.verdict) == ("ok", "warn")


def test_sizes_memory_and_time_by_hand() -> None:
    recipe = {"products": {"radiance": "mosaic", "view_truth": True}, "render": {"samples_per_pixel": 2}}
    known, pixels = facts(recipe=recipe), 1024**2
    sizes = product_bytes(known.target.recipe, known.plan)
    assert sizes == {"counts": 16 * 1e5, "radiance": 400 * pixels, "truth": 6 * 101 * pixels}
    assert peak_bytes(known.target.recipe, known.plan) == 4e8 + 165 * pixels  # truth is written view by view
    # First hits of 101 films are 11 s, 200 paths through each pixel 21 s, a hundred million photons 230 s.
    for speeds, time in (({"path_s": 0}, "10 s"), ({"hit_s": 0}, "20 s")):
        assert f"in the order of {time} on this machine" in about("time", replace(known, **speeds))[0].text
    bright = Plan(thins=True, samples=8, photons_per_view=1e6)
    (time_of_photons,) = about("time", facts(recipe={"products": {"truth": False}}, plan=bright))
    assert "in the order of 4 minutes" in time_of_photons.text
    plan = Plan(thins=False, samples=5, photons_per_view=1e9, why_rendered="mirrors shine")
    dense = facts(recipe={"products": {"truth": False}}, plan=plan)
    text = about("time", dense)[0].text
    assert text.startswith("counts drawn from views of 5 samples per pixel, since mirrors shine; ")
    assert "in the order of 50 s" in text
    # A view's first hits take 165 B a pixel, 173 MB of 1024 x 1024.
    for room, verdict in ((170e6, "bad"), (180e6, "ok")):
        assert verdicts(about("memory", facts(memory_bytes=room))) == [verdict]


GRID = {"rows": 2, "cols": 2, "pitch_mm": [10.0, 10.0], "pixel_mm": 0.8, "height": 64, "width": 64}
AWAY = {
    "type": "area",
    "position_mm": (0, 0, 100),
    "target_mm": (0, 0, -100),
    "width_mm": 10,
    "height_mm": 10,
    "luminance_cd_m2": 10.0,
}
GREY = (0.5, 0.5, 0.5)


def probed(objects: list[dict[str, Any]], *lights: dict[str, Any], **scene: Any) -> Facts:
    recipe = {"grid": GRID, "render": {"max_depth": 2}}
    return probe_scene(target_of(recipe, objects=objects, lights=lights or [SKY], **scene))


@pytest.mark.renders
def test_the_probe_finds_what_is_hidden_behind_and_beside() -> None:
    places = {"front": (0, 500), "hidden": (0, 900), "behind": (0, -500), "beside": (5000, 500)}
    objects = [ball(name, x_mm, z_mm, GREY) for name, (x_mm, z_mm) in places.items()]
    known = probed(objects, SKY, AWAY)
    assert [thing.name for thing in known.visible_objects] == ["front"]
    assert known.objects[2].body_z_mm == pytest.approx((-620, -380))
    assert known.lamps_away == ()  # a ball stands behind the cameras, where the lamp points
    bad = {one.text: one.remedy for one in about("objects", known) if one.verdict == "bad"}
    assert [name in text for name, text in zip(("hidden", "behind", "beside"), bad, strict=True)] == [
        True
    ] * 3
    # Half of 64 px of 0.8 mm behind 50 mm, at 620 mm: 317 mm.
    assert "at 620 mm reaches 317 mm to either side" in bad["no camera sees beside"]
    assert probed(objects[:1], SKY, AWAY).lamps_away == (2,)


@pytest.mark.renders
def test_the_probe_sees_the_share_of_light() -> None:
    # A white and a black ball of the same size under an even sky.
    objects = [ball("white", -130, 600, (1, 1, 1)), ball("black", 130, 600, (0, 0, 0))]
    known = probed(objects)
    white, black = known.objects
    np.testing.assert_allclose(black.light_share, 0, atol=0.01)  # but for pixels at its border
    sky_share = known.other_shares["what shines from all around"]
    np.testing.assert_allclose(white.light_share + black.light_share + sky_share, 1, rtol=1e-5)
    # The white ball is as bright as the sky, and the black one is missing from the whole. Border pixels
    # are counted by their centres, which is wrong by some per cent on so coarse a film.
    expected = white.film_share / (1 - black.film_share)
    np.testing.assert_allclose(white.light_share, expected, rtol=0.05)
    assert known.luminance == pytest.approx(100 * (1 - black.film_share), rel=0.05)


def test_a_coarser_film_has_the_same_field_of_view() -> None:
    paper = Recipe.model_validate({"scene": "-", "grid": {"shear_px": (2.0, 4.0)}}).grid.camera_grid()
    small = coarser(paper, 256)
    assert (small.height, small.width, small.shear_px) == (256, 256, (0.5, 1.0))
    assert small.pixel_mm * 256 == pytest.approx(0.0352 * 1024)
    assert disparities_px(small, 540)[0] == pytest.approx(50 * 5 / 0.0352 / 540 / 4 - 0.5)
    assert coarser(small, 512) == small


@pytest.mark.renders
def test_the_small_recipe_passes(capsys: pytest.CaptureFixture[str]) -> None:
    assert command_line.run(cli.app, ["check", "small", "--set", "seed=3", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    # Its shifts at 540 mm are multiples of 12 px but for rounding: -30, -18, -6, 6, 18, 30.
    assert {row["subject"] for row in rows if row["verdict"] != "ok"} == {"colours"}
    assert any("ball (5" in row["text"] and "7.6" in row["text"] for row in rows)


@pytest.mark.renders
def test_exit_codes_of_broken_scenes(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    text = """
title = "broken"
[[objects]]
name = "lost"
position_mm = [0, 0, -500]
shape = { type = "sphere", radius_mm = 20 }
material = { reflectance = [0.5, 0.5, 0.5] }
[[lights]]
type = "uniform"
luminance_cd_m2 = 10
"""
    file.write_text(text)
    assert command_line.run(cli.app, ["check", str(file)]) == 1
    output = capsys.readouterr()
    assert "lost is at z = -520 to -480 mm" in output.out
    assert output.err == ""
    file.write_text(text.replace("radius_mm", "radius"))
    for target, words in ((tmp_path, "radius"), ("nowhere", "there is no scene or recipe 'nowhere'")):
        assert command_line.run(cli.app, ["check", str(target)]) == 2
        assert words in capsys.readouterr().err
    assert command_line.run(cli.app, ["check", "two_objects", "--set", "seed=1"]) == 2
    assert "name a recipe" in capsys.readouterr().err
