"""`simgen check`: each verdict on facts made by hand, and the probe on small scenes."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from command_runs import run_simgen
from lit_scenes import LAMP, ball

from simgen.cameras import coarser, disparities_px
from simgen.check import Facts, Finding, ObjectFacts, findings, probe_scene
from simgen.dataset import Prepared, peak_bytes, product_bytes
from simgen.photons import Plan
from simgen.spec import Recipe, Scene

SKY = {"type": "uniform", "luminance_cd_m2": 100.0}
EVEN = np.full(3, 0.25)
RED = np.array([1.0, 0.0, 0.0])
SPREAD_PX_MM = 9 * 50 * 5 / 0.0352
"""Of the paper's ten cameras: px of disparity between the outermost, times depth."""


def target_of(recipe: dict[str, Any], **scene: Any) -> Prepared:
    whole = Scene.model_validate({"title": "test", "lights": [SKY]} | scene)
    return Prepared(Recipe.model_validate({"scene": "test"} | recipe), whole, Path(), None)


def thing(name: str, *z_mm: float, share: float = 0.1, light: np.ndarray = EVEN, **more: Any) -> ObjectFacts:
    more = {"body_z_mm": (min(z_mm), max(z_mm)) if z_mm else (500.0, 510.0)} | more
    return ObjectFacts(name, np.array(z_mm), share, light, **more)


def facts(*objects: ObjectFacts, recipe: dict[str, Any] | None = None, **more: Any) -> Facts:
    glass = ball("a", 0, 540, finish={"type": "glass"})
    scene = {"objects": [glass]} if more.pop("glass", False) else {"backdrop": more.pop("backdrop", None)}
    known = {"corners": 4, "luminance": 1.0, "colour_share": np.array([0.25, 0.5, 0.25])}
    known |= {"other_shares": {}, "lamps_away": (), "path_s": 1e-7, "hit_s": 1e-7}
    known |= {"plan": Plan(True, 8, 1000.0), "is_compiled": True, "memory_bytes": 1e12}
    return Facts(target=target_of(recipe or {}, **scene), objects=objects, **(known | more))


def about(subject: str, known: Facts) -> list[Finding]:
    return [finding for finding in findings(known) if finding.subject == subject]


def verdicts(all_findings: list[Finding]) -> list[str]:
    return [finding.verdict for finding in all_findings]


EVEN_MM = 50 * 5 / 0.0352 / 12
"""Where the paper's grid has 12 px per camera."""
ONE = thing("a", 540)
FLOOR = thing("floor", 545, 900, is_scored=False)  # whose depths are no advice
WHOLE = thing("a", 540, 545, 549, 550)
NEAR_BOTH = thing("a", 540), thing("b", 539, 544.2), thing("floor", 900, is_scored=False)
RANGE = "analysis.z_range_mm = [539, 545]"
LIT = thing("a", 540, share=0.01)
OTHERS = {"what shines from all around": np.full(3, 0.6), "lamps in view": np.full(3, 0.15)}
OF_OTHERS = "75.0% of the photons come from no object: what shines from all around 60.0%, lamps in view 15.0%"
PER_FRAME = "photons per pixel and frame, of which"
OF_UNSCORED = "25.0% of the photons come from objects that count in no score"
PAIR = thing("small", 540, share=0.001), thing("large", 620, share=0.1)
# 22500 over all views on 0.0225 x 1024^2 pixels: 0.954 each, of 250 x 0.1 + 500 x 0.2 + 250 x 0.4 = 225.
COLOURED = thing("a", 540, share=0.0225, light=np.array([0.1, 0.2, 0.4]))
IN_RED = thing("a", 540, share=0.0225, light=np.array([0.1, 0.0, 0.0]))
PER_CHANNEL = {"photons": {"scope": "channel"}}


def apart(px: float) -> Facts:
    """Two objects so far apart, one in a plane with the first, and one far away."""
    far = 1 / (1 / 540 - px / SPREAD_PX_MM)
    return facts(thing("a", 540), thing("b", far), thing("beside", 540.01), thing("behind", 900))


def planes(*z_mm: float, **more: Any) -> dict[str, Any]:
    return {"analysis": {"z_mm": z_mm, **more}}


def sensor(**values: Any) -> dict[str, Any]:
    return {"sensor": values}


EVENLY_SPACED = facts(thing("a", EVEN_MM), recipe=planes(EVEN_MM))
CASES: dict[str, list[tuple[Facts, str | None, str]]] = {
    "separation": [
        *((apart(px), "ok", f"{px:.2f} px") for px in (15.27, 3.01)),
        *((apart(px), "warn", f"{px:.2f} px") for px in (2.99, 0.51)),
    ],
    "disparity": [
        (facts(thing("a", 600, 606)), "warn", "1.1 px of blur"),  # 9 * 7102 * (1/600 - 1/606)
        (facts(thing("a", 540, 540.001)), "ok", "0.0 px of blur"),  # it is flat on purpose
        (facts(thing("a", 540, 620)), "ok", "15.3 px of blur"),
        (facts(thing("a", 6.9, 7.1)), "bad", "1029"),  # 7102 / 6.9 px of 1024
        (facts(thing("a", 7.1, 7.5)), "ok", "1000"),
    ],
    "focus": [
        # At 540 mm 1 px of half blur is 2 px of 63920 px mm / z: 1/540 - 1/z = 2/63920 at 549.3 mm.
        (facts(WHOLE, recipe=planes(540, 620)), "ok", "of a, the object least in focus, 75%"),
        (facts(WHOLE, recipe=planes(540, 620)), "warn", "no object is in focus at 620 mm"),
        (facts(WHOLE, thing("b", 580, 581), recipe=planes(540)), "warn", "add 580 to analysis.z_mm"),
        (facts(ONE, FLOOR, thing("b", 620)), "warn", "add planes_mm = [540, 620] to the scene"),
        (facts(*NEAR_BOTH, recipe=planes(540, z_range_mm=[450, 541])), "warn", RANGE),
        (facts(*NEAR_BOTH, recipe=planes(540, z_range_mm=[0.45, 0.75])), "warn", RANGE),
    ],
    "overlap": [
        (facts(thing("a", 200)), "warn", "47%"),  # 9 * 35.5 px of 1024 in both axes
        (facts(ONE), "ok", ""),
    ],
    "colours": [
        (EVENLY_SPACED, "warn", "75% have no R, 50% have no G, 75% have no B"),
        (EVENLY_SPACED, "warn", "pitch of"),
        (facts(ONE), "ok", ""),
        (facts(thing("a", EVEN_MM), recipe=planes(EVEN_MM) | sensor(cfa="none")), None, ""),
    ],
    "objects": [
        (facts(thing("gone", corners_seeing=0)), "bad", "no camera sees gone"),
        (facts(thing("aside", corners_seeing=2)), "warn", "virtual centre, of which the truth is, does not"),
        (facts(thing("edge", 540, corners_seeing_all=1)), "warn", "1 of 4 corner cameras see all of edge"),
        (facts(thing("floor", 540, corners_seeing_all=0, is_cut_at_centre=True)), "ok", "see floor"),
        (facts(thing("metres", body_z_mm=(0.46, 0.5))), "bad", "metres is at z = 0.46 to 0.5 mm"),
        (facts(thing("behind", body_z_mm=(-60, -10))), "bad", "behind is at z = -60 to -10 mm"),
        (facts(thing("around", 540, share=1.0, body_z_mm=(-60, 60))), "bad", "around is at z = -60 to 60 mm"),
        (facts(thing("whole", 540)), "ok", "see whole"),
        (facts(thing("lamp", corners_seeing=0, shines=True)), None, ""),
    ],
    "lights": [
        (facts(ONE), "ok", ""),
        (facts(ONE, luminance=0.0), "bad", ""),
        (facts(ONE, lamps_away=(2,)), "warn", "lights[1].target_mm"),
    ],
    "backdrop": [(facts(ONE, backdrop={"z_mm": 0.9}), "bad", "")],
    "glass": [
        (facts(ONE, glass=True, recipe={"render": {"max_depth": 5}}), "warn", ""),
        (facts(ONE, glass=True, recipe={"render": {"max_depth": 6}}), None, ""),
    ],
    "photons": [
        (facts(COLOURED), "ok", "a: 225 per view (22.5%), 22,500 in all, 0.95 per voxel"),
        # 1000 / 3 x 0.7, and 12.5 + 100 + 25.
        (facts(COLOURED, recipe=PER_CHANNEL), "ok", "a: 233 per view"),
        (facts(IN_RED, recipe=PER_CHANNEL, colour_share=RED), "ok", "a: 33 per view (10.0%)"),
        (facts(COLOURED, recipe=sensor(quantum_efficiency=[0.5, 1.0, 0.25])), "ok", "a: 138 per view"),
        (facts(LIT, other_shares=OTHERS), "warn", OF_OTHERS),
        (facts(replace(LIT, is_scored=False), other_shares={"the backdrop": EVEN}), "ok", OF_UNSCORED),
        (facts(other_shares={"the backdrop": np.ones(3)}), None, ""),  # nothing is hidden by it
        (facts(LIT, recipe=sensor(dark_counts=0.001)), "warn", "51% of all counts"),  # 1049 a view
        # A quarter of 1000 photons on a thousandth of the pixels.
        (facts(*PAIR, recipe=sensor(frames=100, bits=1)), "ok", f"small: 0.0024 {PER_FRAME} 0.1% saturate"),
        (facts(*PAIR, recipe=sensor(bits=1)), "warn", f"0.24 {PER_FRAME} 11.0% saturate"),
    ],
}


@pytest.mark.parametrize(
    ("subject", "known", "expected", "words"),
    [(subject, *case) for subject, cases in CASES.items() for case in cases],
)
def test_a_verdict_on_facts_by_hand(subject: str, known: Facts, expected: str | None, words: str) -> None:
    """A finding on the subject has this verdict and these words; without words it is the only one."""
    found = about(subject, known)
    is_alone = subject in ("separation", "disparity", "overlap", "colours", "objects")
    if not words or is_alone:
        assert verdicts(found) == [expected] * (expected is not None)
    if words:
        assert [one.verdict for one in found if words in one.text + one.remedy] == [expected]
    if subject == "objects":
        assert all(bool(one.remedy) == (one.verdict != "ok") for one in found)


def test_few_photons_are_warned_of_and_the_remedy_gives_enough() -> None:
    dim = thing("dim", 540, share=1e-6, light=np.full(3, 0.0009))  # 0.9 a view, 90 in all
    (finding,) = about("photons", facts(dim))
    assert finding.verdict == "warn"
    budget = float(finding.remedy.split("photons.budget = ")[1].split(",")[0])
    assert 100 <= budget * 0.0009 * 100 < 115
    assert verdicts(about("photons", facts(replace(dim, light_share=np.full(3, 0.0011))))) == ["ok"]


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
AWAY = LAMP | {"position_mm": (0, 0, 100), "target_mm": (0, 0, -100), "width_mm": 10, "height_mm": 10}
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
    assert all(name in text for name, text in zip(("hidden", "behind", "beside"), bad, strict=True))
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
    assert run_simgen("check", "small", "--set", "seed=3", "--json") == 0
    rows = json.loads(capsys.readouterr().out)
    # Its shifts at 540 mm are multiples of 12 px but for rounding: -30, -18, -6, 6, 18, 30.
    assert {row["subject"] for row in rows if row["verdict"] != "ok"} == {"colours"}
    assert any("ball (5" in row["text"] and "7.6" in row["text"] for row in rows)


@pytest.mark.renders
def test_exit_codes_of_broken_scenes(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    lost = ball("lost", 0, -500, GREY, radius_mm=20)
    text = tomli_w.dumps({"title": "broken", "objects": [lost], "lights": [SKY]})
    file.write_text(text)
    assert run_simgen("check", file) == 1
    output = capsys.readouterr()
    assert "lost is at z = -520 to -480 mm" in output.out
    assert output.err == ""
    file.write_text(text.replace("radius_mm", "radius"))
    for target, words in ((tmp_path, "radius"), ("nowhere", "there is no scene or recipe 'nowhere'")):
        assert run_simgen("check", target) == 2
        assert words in capsys.readouterr().err
    assert run_simgen("check", "two_objects", "--set", "seed=1") == 2
    assert "name a recipe" in capsys.readouterr().err
