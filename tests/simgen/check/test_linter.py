"""`simgen check`: each verdict on facts made by hand, and the probe on small scenes."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lit_scenes import ball

from pcii.base import command_line
from pcii.core.camera_grid import CameraGrid
from pcii.core.focal_planes import FocalPlanes
from pcii.core.photon_counts import PhotonCounts
from pcii.sections.reconstruction import reconstruct
from simgen.app import commands as cli
from simgen.cameras.disparities import (
    apart_px,
    colour_samples,
    disparities_px,
    mending_depth_mm,
    mending_pitch_mm,
    share_seen_by_all,
    shares_without,
    shifts_px,
)
from simgen.check.costs import cost_findings, in_time, seconds
from simgen.check.depths import (
    alias_findings,
    depth_findings,
    disparity_findings,
    focus_findings,
    focus_share,
    no_planes_findings,
    overlap_findings,
    separation_findings,
)
from simgen.check.expected_photons import photon_findings, photons_per_view
from simgen.check.scene_facts import Facts, Finding, ObjectFacts
from simgen.check.scene_probe import coarser, probe_scene
from simgen.check.sight import sight_findings
from simgen.check.targets import findings
from simgen.dataset.prepared import Prepared, needs_of
from simgen.dataset.resources import in_bytes, peak_bytes, product_bytes
from simgen.photons.counting_plan import Plan
from simgen.spec.recipe import Recipe
from simgen.spec.scene import Scene

PAPER: dict[str, Any] = {"scene": "two_objects"}
EVEN = np.full(3, 0.25)


def thing(name: str, *z_mm: float, share: float = 0.1, light: np.ndarray = EVEN, **more: Any) -> ObjectFacts:
    near, far = (min(z_mm), max(z_mm)) if z_mm else (500.0, 510.0)
    return ObjectFacts(name, np.array(z_mm), share, light, body_z_mm=(near, far), **more)


def facts(*objects: ObjectFacts, recipe: dict[str, Any] | None = None, **more: Any) -> Facts:
    plan = Plan(thins=True, samples=8, photons_per_view=1000.0, noise=0.0, normaliser_error=0.0)
    known = {
        "luminance": 1.0,
        "colour_share": np.array([0.25, 0.5, 0.25]),
        "elsewhere": {},
        "plan": plan,
        "path_s": 1e-7,
        "hit_s": 1e-7,
    }
    full = Recipe.model_validate(PAPER | (recipe or {}))
    return Facts(
        grid=full.grid.camera_grid(),
        sensor=full.sensor,
        photons=full.photons,
        render=full.render,
        analysis=full.analysis,
        needs=needs_of(full),
        objects=objects,
        **(known | more),
    )


def paper_grid(**changes: Any) -> CameraGrid:
    return replace(Recipe.model_validate(PAPER).grid.camera_grid(), **changes)


def at_disparity(pixels: float, **more: Any) -> tuple[CameraGrid, float]:
    """A grid and a depth with so many px of disparity per camera in both axes."""
    grid = CameraGrid(rows=4, cols=4, pitch_mm=(5.0, 5.0), focal_mm=50.0, pixel_mm=0.05, height=32, width=32)
    return replace(grid, **more), 5000 / pixels


def verdicts(found: list[Finding]) -> list[str]:
    return [finding.verdict for finding in found]


def test_objects_of_the_paper_are_15_px_of_blur_apart() -> None:
    by_hand = 9 * (50 * 5 / 0.0352) * (1 / 540 - 1 / 620)
    assert apart_px(paper_grid(), 540, 620) == pytest.approx(by_hand)
    (finding,) = separation_findings(facts(thing("ball", 540), thing("bird", 620)))
    assert finding.verdict == "ok"
    assert "15.27 px" in finding.text


def test_separation_is_that_of_the_longer_axis() -> None:
    grid = paper_grid(rows=2, cols=10)
    assert apart_px(grid, 540, 620) == pytest.approx(15.27, abs=0.005)
    assert apart_px(replace(grid, pitch_mm=(5.0, 90.0)), 540, 620) == pytest.approx(2 * 15.27, abs=0.01)


@pytest.mark.parametrize(("apart", "verdict"), [(3.01, "ok"), (2.99, "warn"), (0.51, "warn"), (0.49, "note")])
def test_near_objects_are_warned_of_and_one_plane_is_not(apart: float, verdict: str) -> None:
    spread = 9 * 50 * 5 / 0.0352
    far = 1 / (1 / 540 - apart / spread)
    (finding,) = separation_findings(facts(thing("a", 540), thing("b", far)))
    assert finding.verdict == verdict


def test_moving_an_object_as_told_mends_the_separation() -> None:
    (finding,) = separation_findings(facts(thing("a", 540), thing("b", 545)))
    assert finding.verdict == "warn"
    depth = 545 + float(finding.remedy.split("move b ")[1].split(" mm further")[0])
    assert apart_px(paper_grid(), 540, depth) == pytest.approx(3, abs=0.2)  # told in whole millimetres


def test_of_many_pairs_the_close_ones_are_told() -> None:
    objects = [thing(f"o{n:02d}", 500 + 40 * n) for n in range(12)] + [thing("close", 502)]
    found = separation_findings(facts(*objects))
    assert verdicts(found) == ["warn", "ok"]
    assert "close" in found[0].text
    assert found[1].text.startswith("11 more")


def test_too_little_disparity_and_too_much() -> None:
    (flat,) = disparity_findings(facts(thing("a", 600, 606)))
    assert flat.verdict == "warn"  # 9 * 7102 * (1/600 - 1/606) = 1.05 px
    assert "1.1 px of blur" in flat.text
    assert "a pitch of" in flat.remedy
    (card,) = disparity_findings(facts(thing("a", 540, 540.001)))
    assert card.remedy == "all is at one depth"  # no pitch of kilometres
    deep = disparity_findings(facts(thing("a", 540, 620)))
    assert verdicts(deep) == ["ok"]
    near = disparity_findings(facts(thing("a", 6.9, 7.1)))  # 7102 / 6.9 = 1029 px of 1024
    assert verdicts(near) == ["ok", "bad"]
    assert verdicts(disparity_findings(facts(thing("a", 7.1, 7.5)))) == ["ok"]


def test_one_camera_has_no_disparity_to_speak_of() -> None:
    found = depth_findings(facts(thing("a", 540), recipe={"grid": {"rows": 1, "cols": 1}}))
    assert verdicts(found) == ["note"]


def test_share_in_focus_is_what_blurs_by_one_pixel() -> None:
    # At 540 mm 1 px of half blur is 2 px of 63920 px mm / z: 1/540 - 1/z = 2/63920 at 549.3 mm.
    whole = thing("a", 540, 545, 549, 550)
    assert focus_share(facts(whole), whole, 540) == 0.75
    found = focus_findings(facts(whole, recipe={"analysis": {"z_mm": [540, 620]}}))
    assert verdicts(found) == ["ok", "warn"]
    assert "75% of it in focus at 540 mm" in found[0].text
    assert "no object is in focus at the plane 620 mm" in found[1].text


def test_depths_that_nobody_names_are_warned_of() -> None:
    found = no_planes_findings(facts(thing("a", 540), thing("b", 620)))
    assert verdicts(found) == ["warn"]
    assert found[0].remedy == "add planes_mm = [540, 620] to the scene"
    assert not no_planes_findings(facts(thing("a", 540), recipe={"analysis": {"z_mm": [540]}}))


def test_objects_outside_the_depth_range_are_named() -> None:
    analysis = {"z_mm": [540], "z_range_mm": [450, 541]}
    found = focus_findings(facts(thing("in", 540), thing("out", 539, 545), recipe={"analysis": analysis}))
    assert found[-1].verdict == "warn"
    assert "part of out is outside" in found[-1].text
    assert found[-1].remedy == "analysis.z_range_mm = [450, 545]"


@pytest.mark.parametrize("z_range_mm", [[0.45, 0.75], [541, 600]])
def test_a_depth_range_without_any_object_is_bad(z_range_mm: list[float]) -> None:
    recipe = {"analysis": {"z_mm": [540], "z_range_mm": z_range_mm}}
    found = focus_findings(facts(thing("one", 500, 540), thing("two", 601), recipe=recipe))
    assert found[-1].verdict == "bad"
    assert found[-1].remedy == "analysis.z_range_mm = [500, 601]"


def test_views_overlap_by_hand() -> None:
    grid, z = at_disparity(4.0, cols=3)  # column shifts -4, 0, 4; row shifts -6, -2, 2, 6
    assert [shift.tolist() for shift in shifts_px(grid, z)] == [[-6, -2, 2, 6], [-4, 0, 4]]
    assert share_seen_by_all(grid, z) == (32 - 12) / 32 * (32 - 8) / 32
    few = overlap_findings(facts(thing("a", 200)))  # 9 * 35.5 px of 1024 in both axes: 47 %
    assert verdicts(few) == ["warn"]
    assert verdicts(overlap_findings(facts(thing("a", 540)))) == ["ok"]


def test_disparities_agree_with_the_reconstruction() -> None:
    # Two independent ways to the same shifts, of which a half pixel is the hard case.
    for pixels in (0.5, 1.0, 2.5, 3.2, 7.77):
        grid, z = at_disparity(pixels, rows=5, shear_px=(0.3, -1.0))
        for own, other in zip(
            shifts_px(grid, z), FocalPlanes.at_depths(grid, z).whole_shifts_px, strict=True
        ):
            np.testing.assert_array_equal(own, other[0])


@pytest.mark.parametrize("cfa", ["GRBG", "RGGB", "BGGR", "GBRG"])
@pytest.mark.parametrize("pixels", [1.0, 2.0, 2.3, 4.0])
def test_samples_of_each_colour_are_the_coverage_of_the_reconstruction(cfa: str, pixels: float) -> None:
    grid, z = at_disparity(pixels, rows=3, cols=5)
    empty = PhotonCounts.from_dense(np.zeros(grid.shape_KLHW, int), grid, cfa=cfa)
    middle = reconstruct(empty, z_mm=z).coverage[0, 16:18, 16:18]  # rows and columns 0 and 1 modulo 2
    np.testing.assert_array_equal(colour_samples(grid, cfa, z), middle)


def test_even_shifts_leave_colours_out() -> None:
    grid, z = at_disparity(4.0)
    np.testing.assert_array_equal(shares_without(grid, "GRBG", z), [0.75, 0.5, 0.75])
    mixed, z_mixed = at_disparity(3.0)
    np.testing.assert_array_equal(shares_without(mixed, "GRBG", z_mixed), [0, 0, 0])
    row, z_row = at_disparity(3.0, rows=1)  # columns mix, rows do not: two colours a row
    np.testing.assert_array_equal(shares_without(row, "GRBG", z_row), [0.5, 0, 0.5])


def test_remedies_for_aliasing_mend_it() -> None:
    grid, z = at_disparity(4.0)
    pitch, depth = mending_pitch_mm(grid, [z]), mending_depth_mm(grid, z)
    assert pitch is not None
    assert depth is not None
    assert not shares_without(replace(grid, pitch_mm=pitch), "GRBG", z).any()
    assert not shares_without(grid, "GRBG", depth).any()
    assert abs(pitch[0] - 5) < 1  # 4 px +- 1/3 mix four cameras: shifts of 6.5 px, say, round to 7
    assert mending_pitch_mm(replace(grid, rows=1), [z]) is None


def test_aliasing_is_told_with_its_remedy() -> None:
    even = 50 * 5 / 0.0352 / 12  # mm at which the paper's grid has 12 px per camera
    recipe = {"analysis": {"z_mm": [even]}}
    (finding,) = alias_findings(facts(thing("a", even), recipe=recipe))
    assert finding.verdict == "warn"
    assert "75% have no R, 50% have no G, 75% have no B" in finding.text
    assert "pitch of" in finding.remedy
    assert verdicts(alias_findings(facts(thing("a", 540)))) == ["ok"]
    assert alias_findings(facts(thing("a", even), recipe=recipe | {"sensor": {"cfa": "none"}})) == []


@pytest.mark.parametrize(
    ("object_facts", "verdict", "words"),
    [
        (thing("gone", corners_seen=0), "bad", "no camera sees gone"),
        (thing("aside", corners_seen=2), "warn", "the virtual centre does not"),
        (thing("edge", 540, corners_seen=3), "warn", "1 of 4 corner cameras do not see edge"),
        (thing("cut", 540, corners_cut=2), "warn", "cuts cut in 2 of 4"),
        (thing("floor", 540, corners_cut=4, centre_cut=True), "note", "runs beyond the film"),
        (thing("around", 540, encloses_camera=True), "bad", "a camera stands inside around"),
        (thing("whole", 540), "ok", "see all of whole"),
    ],
)
def test_sight_of_one_object(object_facts: ObjectFacts, verdict: str, words: str) -> None:
    finding, lights = sight_findings(facts(object_facts))
    assert finding.verdict == verdict
    assert words in finding.text
    assert lights.verdict == "ok"


def test_why_nothing_is_seen_of_an_object() -> None:
    behind = replace(thing("a", corners_seen=0), body_z_mm=(-60.0, -10.0))
    assert "behind the cameras" in sight_findings(facts(behind))[0].remedy
    beyond = replace(thing("a", corners_seen=0), body_z_mm=(900.0, 910.0))
    assert "behind the backdrop at 800 mm" in sight_findings(facts(beyond, backdrop_mm=800.0))[0].remedy


def test_darkness_and_lamps_that_face_away() -> None:
    dark = sight_findings(facts(thing("a", 540), luminance=0.0))[-1]
    assert (dark.verdict, dark.subject) == ("bad", "lights")
    away = sight_findings(facts(thing("a", 540), lamps_away=(2,)))[-1]
    assert away.verdict == "warn"
    assert "lights[1].target_mm" in away.remedy
    wall = sight_findings(facts(thing("a", 540), backdrop_mm=0.005))
    assert "bad" in verdicts(wall)


def test_photons_of_an_object_by_hand() -> None:
    # Of 1000 photons a view 1/4 R, 1/2 G, 1/4 B: 250 x 0.1 + 500 x 0.2 + 250 x 0.4 = 225.
    one = thing("a", 540, share=0.0225, light=np.array([0.1, 0.2, 0.4]))
    known = facts(one)
    assert photons_per_view(known, one.light_share) == pytest.approx(225)
    (finding,) = photon_findings(known)
    # 22500 over all views on 0.0225 x 1024^2 pixels: 0.954 each.
    assert finding.verdict == "note"
    assert "22.5%, 225 per view, 22,500 in all; 0.95 per voxel, a relative error of 102%" in finding.text


def test_photons_of_a_channel_and_quantum_efficiency() -> None:
    one = thing("a", 540, light=np.array([0.1, 0.2, 0.4]))
    by_channel = facts(one, recipe={"photons": {"scope": "channel"}})
    assert photons_per_view(by_channel, one.light_share) == pytest.approx(1000 / 3 * 0.7)
    half = facts(one, recipe={"sensor": {"quantum_efficiency": [0.5, 1.0, 0.25]}})
    assert photons_per_view(half, one.light_share) == pytest.approx(12.5 + 100 + 25)


def test_few_photons_are_warned_of_and_the_remedy_gives_enough() -> None:
    dim = thing("dim", 540, share=1e-6, light=np.full(3, 0.0009))  # 0.9 a view, 90 in all
    (finding,) = photon_findings(facts(dim))
    assert finding.verdict == "warn"
    budget = float(finding.remedy.split("photons.budget = ")[1].split()[0])
    assert 100 <= budget * 0.0009 * 100 < 115
    (enough,) = photon_findings(facts(replace(dim, light_share=np.full(3, 0.0011))))
    assert enough.verdict == "ok"


def test_a_wall_alone_is_not_told_to_be_darker() -> None:
    assert verdicts(photon_findings(facts(elsewhere={"backdrop": np.ones(3)}))) == ["ok"]


def test_light_beside_the_objects_and_dark_counts_are_told() -> None:
    one = thing("a", 540, share=0.01)
    found = photon_findings(facts(one, elsewhere={"backdrop": np.full(3, 0.75), "nothing": np.zeros(3)}))
    assert verdicts(found) == ["ok", "warn"]
    assert "backdrop: 75.0%" in found[1].text
    dark = photon_findings(facts(one, recipe={"sensor": {"dark_counts": 0.001}}))[-1]
    assert dark.verdict == "warn"  # 1049 a view beside 1000
    assert "51% of all counts" in dark.text


def test_what_saturates_is_told_of_the_brightest() -> None:
    small, large = thing("small", 540, share=0.001), thing("large", 620, share=0.1)
    found = photon_findings(facts(small, large, recipe={"sensor": {"frames": 100, "bits": 1}}))[-1]
    assert found.verdict == "ok"  # a quarter of 1000 photons on a thousandth of the pixels
    assert found.text == "small: 0.0024 photons per pixel and frame, of which 0.1% saturate"
    alone = photon_findings(facts(small, large, recipe={"sensor": {"bits": 1}}))[-1]
    assert alone.verdict == "warn"
    assert "0.24 photons per pixel and frame, of which 11.0% saturate" in alone.text
    assert "sensor.frames" in alone.remedy
    assert len(photon_findings(facts(small, large, recipe={"sensor": {"frames": 100}}))) == 2


def test_without_counts_or_light_there_is_nothing_to_say_of_photons() -> None:
    assert photon_findings(facts(thing("a", 540), plan=None)) == []
    assert photon_findings(facts(thing("a", 540), luminance=0.0)) == []


def test_sizes_memory_and_time_by_hand() -> None:
    recipe = {"products": {"radiance": "mosaic", "view_truth": True}, "render": {"samples_per_pixel": 2}}
    known = facts(recipe=recipe)
    pixels = 1024**2
    sizes = product_bytes(known.needs, known.plan)
    assert sizes == {"counts": 16 * 1e5, "radiance": 400 * pixels, "truth": 6 * 101 * pixels}
    assert peak_bytes(known.needs, known.plan) == 4e8 + 165 * pixels  # truth is written view by view
    paths = 1e-7 * (101 * pixels + 200 * pixels)
    assert seconds(known) == pytest.approx(paths + 1e-7 * 1.5 / 0.065 * 1e5)
    plan = Plan(thins=False, samples=5, photons_per_view=1e9, noise=0.0, normaliser_error=0.0)
    dense = facts(recipe={"products": {"truth": False}}, plan=plan)
    assert product_bytes(dense.needs, dense.plan) == {
        "counts": 1600.0 * pixels
    }  # a count in every pixel at most
    assert seconds(dense) == pytest.approx(1e-7 * 500 * pixels)
    assert "5 samples per pixel" in cost_findings(dense)[-1].text


def test_too_much_memory_is_warned_of() -> None:
    # A view's first hits take 165 B a pixel, 173 MB of 1024 x 1024, and the renderer 400 MB.
    for room, verdict in ((170e6, "bad"), (180e6, "warn"), (700e6, "warn"), (740e6, "ok")):
        assert verdicts(cost_findings(facts(memory_bytes=room))) == ["ok", verdict, "ok"]


def test_too_little_disk_is_warned_of() -> None:
    recipe = {"products": {"radiance": "rgb"}}  # 100 views of 12 MB, of which at least half is written
    for room, verdict in ((620e6, "warn"), (640e6, "ok")):
        assert cost_findings(facts(recipe=recipe, disk_bytes=room))[0].verdict == verdict


def test_sizes_and_times_read_well() -> None:
    assert [in_bytes(n) for n in (0, 999, 1500, 419_430_400)] == ["0 B", "1000 B", "1.5 kB", "420 MB"]
    assert [in_time(s) for s in (0.01, 71, 260, 9000, 1e6)] == [
        "1 s",
        "70 s",
        "4 minutes",
        "2 hours",
        "10 days",
    ]


def probed(
    objects: list[dict[str, Any]], lights: list[dict[str, Any]], recipe: dict[str, Any], **more: Any
) -> Facts:
    scene = Scene.model_validate({"title": "test", "objects": objects, "lights": lights} | more)
    return probe_scene(Prepared(Recipe.model_validate({"scene": "test"} | recipe), scene, Path(), None))


GRID = {"rows": 2, "cols": 2, "pitch_mm": [10.0, 10.0], "pixel_mm": 0.8, "height": 64, "width": 64}
SKY = {"type": "uniform", "luminance_cd_m2": 100.0}
AWAY = {
    "type": "area",
    "position_mm": (0, 0, 100),
    "target_mm": (0, 0, -100),
    "width_mm": 10,
    "height_mm": 10,
    "luminance_cd_m2": 10.0,
}


def test_glass_needs_longer_paths() -> None:
    (finding,) = (f for f in sight_findings(facts(thing("a", 540), glass=("a",))) if f.subject == "glass")
    assert finding.verdict == "warn"
    assert "paths of 3 segments" in finding.text
    deep = facts(thing("a", 540), recipe={"render": {"max_depth": 6}}, glass=("a",))
    assert not [f for f in sight_findings(deep) if f.subject == "glass"]


@pytest.mark.renders
def test_the_probe_finds_what_is_hidden_behind_and_beside() -> None:
    objects = [
        ball("front", 0, 500, (0.5, 0.5, 0.5)),
        ball("hidden", 0, 900, (0.5, 0.5, 0.5)),
        ball("behind", 0, -500, (0.5, 0.5, 0.5)),
        ball("beside", 5000, 500, (0.5, 0.5, 0.5)),
    ]
    known = probed(objects, [SKY, AWAY], {"grid": GRID})
    _, hidden, behind, beside = known.objects
    assert not hidden.z_mm.size
    assert not beside.z_mm.size
    assert beside.corners_seen == 0
    assert behind.body_z_mm == pytest.approx((-620, -380))
    assert known.lamps_away == ()  # a ball stands behind the cameras, where the lamp points
    bad = {f.text.split()[-1]: f.remedy for f in sight_findings(known) if f.verdict == "bad"}
    assert set(bad) == {"hidden", "behind", "beside"}
    assert probed(objects[:1], [SKY, AWAY], {"grid": GRID}).lamps_away == (2,)


@pytest.mark.renders
def test_the_probe_sees_the_share_of_light() -> None:
    # A white and a black ball of the same size under an even sky.
    objects = [ball("white", -130, 600, (1, 1, 1)), ball("black", 130, 600, (0, 0, 0))]
    known = probed(objects, [SKY], {"grid": GRID, "render": {"max_depth": 2}})
    white, black = known.objects
    np.testing.assert_allclose(black.light_share, 0, atol=0.01)  # but for pixels at its border
    total = white.light_share + black.light_share + known.elsewhere["nothing"]
    np.testing.assert_allclose(total, 1, rtol=1e-5)
    # The white ball is as bright as the sky, and the black one is missing from the whole. Border pixels
    # are counted by their centres, which is wrong by some per cent on so coarse a film.
    expected = white.film_share / (1 - black.film_share)
    np.testing.assert_allclose(white.light_share, expected, rtol=0.05)
    walled = probed(objects, [SKY], {"grid": GRID}, backdrop={"z_mm": 900.0}).elsewhere
    assert walled["backdrop"].min() > 0.005  # a dark wall, beside a white ball
    assert not walled["nothing"].any()
    assert not walled["a lamp in view"].any()


@pytest.mark.renders
def test_a_camera_inside_an_object_and_a_scene_in_the_dark() -> None:
    lamp = AWAY | {"position_mm": (900, 0, 500), "target_mm": (1800, 0, 500)}
    around = probed([ball("shell", 0, 0, (0.5, 0.5, 0.5))], [SKY], {"grid": GRID})
    assert around.objects[0].encloses_camera
    assert "bad" in verdicts(findings(around))
    dark = probed([ball("a", 0, 500, (0.5, 0.5, 0.5))], [lamp], {"grid": GRID})
    assert dark.luminance == 0
    assert any(f.verdict == "bad" and f.subject == "lights" for f in findings(dark))
    turned = lamp | {"target_mm": (0, 0, 500)}
    assert probed([ball("a", 0, 500, (0.5, 0.5, 0.5))], [turned], {"grid": GRID}).luminance > 0


def test_a_coarser_film_has_the_same_field_of_view() -> None:
    small = coarser(paper_grid(shear_px=(2.0, 4.0)), 256)
    assert (small.height, small.width, small.shear_px) == (256, 256, (0.5, 1.0))
    assert small.pixel_mm * 256 == pytest.approx(0.0352 * 1024)
    assert disparities_px(small, 540)[0] == pytest.approx(50 * 5 / 0.0352 / 540 / 4 - 0.5)
    assert coarser(small, 512) == small


@pytest.mark.renders
def test_the_small_recipe_passes(capsys: pytest.CaptureFixture[str]) -> None:
    assert command_line.run(cli.app, ["check", "small", "--set", "seed=3", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    # Its shifts at 540 mm are multiples of 12 px but for rounding: -30, -18, -6, 6, 18, 30.
    assert {row["subject"] for row in told if row["verdict"] != "ok"} == {"colours"}
    assert any("ball (5" in row["text"] and "7.6" in row["text"] for row in told)
    assert command_line.run(cli.app, ["check", "two_objects"]) == 0
    assert "10 x 10 views" in capsys.readouterr().out


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
    for target in (tmp_path, file):
        assert command_line.run(cli.app, ["check", str(target)]) == 1
        said = capsys.readouterr()
        assert "no camera sees lost -> it is behind the cameras" in said.out
        assert said.err == ""
    file.write_text(text.replace("radius_mm", "radius"))
    assert command_line.run(cli.app, ["check", str(tmp_path)]) == 2
    assert "radius" in capsys.readouterr().err
    for wrong in ("nowhere", str(tmp_path / "no.toml")):
        assert command_line.run(cli.app, ["check", wrong]) == 2
        assert "there is no scene or recipe" in capsys.readouterr().err
    assert command_line.run(cli.app, ["check", "two_objects", "--set", "seed=1"]) == 2
    assert "name a recipe" in capsys.readouterr().err
