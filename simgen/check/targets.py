"""`simgen check`: what it and `preview` look at, a scene or a recipe by name or path, and findings on photons
of each object and voxel, on size, memory and time."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pcii.base import InputError
from pcii.types import NEGLIGIBLE_LOSS, channel_count, clipped_mean
from simgen.base import suggestion
from simgen.check.scene_probe import Facts, Finding, ObjectFacts, probe_scene
from simgen.check.sight import depth_findings, sight_findings
from simgen.dataset import (
    Prepared,
    available_bytes,
    in_bytes,
    peak_bytes,
    prepare,
    prepare_scene,
    product_bytes,
    shortage,
)
from simgen.photons import PHOTON_COST, SAMPLE_COST, SCALAR_PHOTON_COST, SCALAR_SAMPLE_COST
from simgen.spec import (
    Recipe,
    Render,
    Scene,
    Sweep,
    drawn_scenes,
    is_clear,
    is_drawn,
    is_scene,
    load_sweep,
    recipe_file,
    recipe_names,
    scene_names,
)

GLASS_DEPTH = 8
"""Longest light path with which a scene with glass is looked at: through a ball or a pane and back."""
MIN_PHOTONS = 100
"""Fewest photons, over all views, that show an object."""
MIN_VOXEL_COUNTS = 0.1
MAX_OTHER_SHARE = 0.5
"""Share of the photons that may come from no object, and of the counts that no photon made."""
LEAST_NAMED_SHARE = 0.0005
"""Smaller shares are not named: they would be printed as 0.0 %."""
USUAL_SHARE = 0.25
"""Share of the candidates that is kept where a photon costs `PHOTON_COST`; where fewer are, it costs more."""


def lint(
    name_or_path: str,
    overrides: Sequence[str] = (),
    scene_number: int | None = None,
    *,
    trust_python: bool = False,
) -> tuple[str, list[Finding]]:
    """A line that says what was checked, and all findings; see `load_target` for the parameters.

    Raises `InputError` for files that are not valid.
    """
    sweep, recipe_folder = _sweep_of(name_or_path, overrides, trust_python)
    target = _target_of(sweep, recipe_folder, scene_number)
    grid, sensor = target.recipe.grid, target.recipe.sensor
    views = f"{grid.rows} x {grid.cols} views of {grid.height} x {grid.width} pixels"
    pitch = f"pitch {grid.pitch_mm[0]:g} x {grid.pitch_mm[1]:g} mm"
    first = f"; of {', '.join(sweep.fields)} the first value" if sweep.axes else ""
    line = f"{target.recipe.title or target.scene.title}: {views}, {pitch}, {sensor.bayer or 'mono'}{first}"
    # So that it cannot even be looked at:
    if lack := shortage(target.recipe, None, available_bytes(), target.map_counts):
        return line, [Finding("bad", "memory", lack)]
    return line, findings(probe_scene(target))


def findings(facts: Facts) -> list[Finding]:
    """All findings, in the order in which one would mend them."""
    return [*sight_findings(facts), *depth_findings(facts), *_photon_findings(facts), *_cost_findings(facts)]


def load_target(
    target: Scene | str | Path,
    overrides: Sequence[str] = (),
    scene_number: int | None = None,
    *,
    trust_python: bool = False,
) -> Prepared:
    """A recipe with its scene, from a scene or from the name or path of either.

    A scene is looked at as by a recipe that says nothing else: with the paper's camera grid, and with
    longer light paths if there is glass in it. A name of both a scene and a recipe means the scene; with
    .toml at its end, the recipe. `scene_number` says which drawn scene is meant, the first unless it says so;
    of other fields with several values the first is taken. `trust_python` runs a Python function that a
    recipe file names. Raises `InputError` for what is missing or not valid.
    """
    if isinstance(target, Scene):
        return _with_long_paths(prepare_scene(Recipe(scene="as given"), target))
    return _target_of(*_sweep_of(str(target), overrides, trust_python), scene_number)


def _target_of(sweep: Sweep, recipe_folder: Path | None, scene_number: int | None) -> Prepared:
    """The recipe of a sweep's first values with its scene; of a bare scene the folder is None."""
    recipe = sweep.recipe(0)
    if scene_number is None and recipe.scene_number is None and is_drawn(recipe.scene, recipe_folder):
        scene_number = 0
    if scene_number is not None:
        recipe = recipe.model_copy(update={"scene_number": scene_number})
    target = prepare(recipe, recipe_folder)
    return _with_long_paths(target) if recipe_folder is None else target


def _with_long_paths(target: Prepared) -> Prepared:
    """The same, with longer light paths if there is glass in the scene."""
    if not any(is_clear(thing.material.finish) for thing in target.scene.objects):
        return target
    return replace(target, recipe=target.recipe.model_copy(update={"render": Render(max_depth=GLASS_DEPTH)}))


def _sweep_of(name_or_path: str, overrides: Sequence[str], trust_python: bool) -> tuple[Sweep, Path | None]:
    """The recipe that a name or path means, and its folder; of a scene one without other fields, and None."""
    if is_scene(name_or_path):
        if overrides:
            raise InputError(f"--set: {name_or_path!r} is a scene, without cameras of its own; name a recipe")
        return Sweep({"scene": name_or_path}, (), name_or_path, Path()), None
    if recipe_file(name_or_path) is None:
        hint = suggestion(Path(name_or_path).stem, {*recipe_names(), *scene_names(), *drawn_scenes()})
        raise InputError(f"there is no scene or recipe {name_or_path!r}{hint}")
    sweep = load_sweep(name_or_path, overrides, trust_python=trust_python)
    return sweep, sweep.recipe_folder


def _photon_findings(facts: Facts) -> Iterator[Finding]:
    """Photons of each object, of what is none, saturation, dark counts; none without counts or light."""
    if facts.plan is None or facts.luminance <= 0 or not facts.plan.photons_per_view > 0:
        return
    total = _photons_per_view(facts, np.sign(facts.colour_share))  # a colour without light has none
    if facts.visible_objects:
        yield from (_object_finding(facts, thing, total) for thing in facts.visible_objects)
        yield from _other_findings(facts, total)
        yield from _saturation_findings(facts)
    sensor, grid = facts.target.recipe.sensor, facts.grid
    dark = (sensor.dark_counts + sensor.hot_pixel_share * sensor.hot_pixel_counts) * grid.height * grid.width
    dark += facts.target.map_counts / grid.view_count
    if dark > MAX_OTHER_SHARE * (dark + total):
        text = f"{_number(dark)} dark counts per view, {dark / (dark + total):.0%} of all counts"
        yield Finding("warn", "photons", text, "take more light, or a sensor with fewer")


def _other_findings(facts: Facts, total: float) -> Iterator[Finding]:
    """Which share of the photons comes from no object, and which from objects that count in no score."""
    shares = {name: _photons_per_view(facts, share) / total for name, share in facts.other_shares.items()}
    whole = sum(shares.values())
    if whole >= LEAST_NAMED_SHARE:
        parts = (f"{name} {part:.1%}" for name, part in shares.items() if part >= LEAST_NAMED_SHARE)
        text = f"{whole:.1%} of the photons come from no object: {', '.join(parts)}"
        remedy = "set visible = false of the light from all around, darken the others, or take more light"
        is_much = whole > MAX_OTHER_SHARE
        yield Finding("warn", "photons", text, remedy) if is_much else Finding("ok", "photons", text)
    unscored = [thing for thing in facts.visible_objects if not thing.is_scored]
    if unscored:
        part = sum(_photons_per_view(facts, thing.light_share) for thing in unscored) / total
        yield Finding("ok", "photons", f"{part:.1%} of the photons come from objects that count in no score")


def _photons_per_view(facts: Facts, light_share: np.ndarray) -> float:
    """Counts that a view is expected to have of what sends these shares (C,) of the light in each colour.

    A budget per view is shared by all colours in proportion to their light, one per channel is each
    colour's own. What the sensor does not detect is left out.
    """
    assert facts.plan is not None
    sensor, photons = facts.target.recipe.sensor, facts.target.recipe.photons
    channels = channel_count(sensor.bayer)
    weights = np.full(channels, 1 / channels) if photons.scope == "channel" else facts.colour_share
    efficiency = np.array(sensor.quantum_efficiency)
    if sensor.bayer is None:
        efficiency = efficiency[1:2]
    return float(facts.plan.photons_per_view * (weights * efficiency * light_share).sum())


def _object_finding(facts: Facts, thing: ObjectFacts, total: float) -> Finding:
    views = facts.grid.view_count
    per_view = _photons_per_view(facts, thing.light_share)
    per_voxel = _per_pixel(facts, thing) * views
    text = (
        f"{thing.name}: {_number(per_view)} per view ({per_view / total:.1%}), {_number(per_view * views)} "
        f"in all, {per_voxel:.2g} per voxel"
    )
    factor = max(MIN_PHOTONS / max(per_view * views, 1e-9), MIN_VOXEL_COUNTS / max(per_voxel, 1e-9))
    if factor <= 1:
        return Finding("ok", "photons", text)
    remedy = f"expose {factor:.2g} times as long"
    if facts.target.recipe.photons.scope != "exposure":
        budget = facts.target.recipe.photons.budget * factor
        step = 10 ** max(0, math.floor(math.log10(budget)) - 1)
        remedy = f"photons.budget = {math.ceil(budget / step) * step}"
    return Finding("warn", "photons", text, f"{remedy}, or larger pixels")


def _per_pixel(facts: Facts, thing: ObjectFacts) -> float:
    """Counts of one view's pixel, over the whole exposure, where it sees the object."""
    pixels = facts.grid.height * facts.grid.width
    return _photons_per_view(facts, thing.light_share) / max(thing.film_share * pixels, 1e-9)


def _saturation_findings(facts: Facts) -> Iterator[Finding]:
    """What frames of few bits lose of the object that is brightest on the film."""
    sensor = facts.target.recipe.sensor
    limit = sensor.readout.most_per_frame
    if limit is None:
        return
    brightest = max(facts.visible_objects, key=lambda thing: _per_pixel(facts, thing))
    per_frame = _per_pixel(facts, brightest) / sensor.frames
    lost = 1 - float(clipped_mean(np.array(per_frame), limit)) / per_frame if per_frame > 0 else 0.0
    text = f"{brightest.name}: {per_frame:.2g} photons per pixel and frame, of which {lost:.1%} saturate"
    if lost <= NEGLIGIBLE_LOSS:
        yield Finding("ok", "photons", text)
    else:
        yield Finding("warn", "photons", text, "raise sensor.frames, or take less light")


def _number(value: float) -> str:
    """A whole number where it is large, three digits where it is small."""
    return f"{value:,.0f}" if 10 <= value < 1e7 else f"{value:.3g}"


def _cost_findings(facts: Facts) -> list[Finding]:
    """What will be written and what it takes, before compression and to an order of magnitude."""
    recipe, plan, dark = facts.target.recipe, facts.plan, facts.target.map_counts
    sizes = product_bytes(recipe, plan)
    size = ", ".join(f"{name} {in_bytes(of_name)}" for name, of_name in sizes.items()) or "only a manifest"
    lack = shortage(recipe, plan, facts.memory_bytes, dark)
    peak, room = in_bytes(peak_bytes(recipe, plan, dark)), in_bytes(facts.memory_bytes)
    memory = f"{peak} at the peak, of {room} available"
    return [
        Finding("ok", "size", f"{size}, before compression"),
        Finding("ok", "memory", memory) if lack is None else Finding("bad", "memory", lack),
        Finding("ok", "time", f"{_way(facts)}in the order of {_in_time(_seconds(facts))} on this machine"),
    ]


def _way(facts: Facts) -> str:
    """How photons and images are made, as the beginning of a sentence."""
    plan, ways = facts.plan, []
    if plan is not None and plan.thins:
        ways.append("photons one by one (thinning)")
        if not plan.keeps_origins:
            ways.append("too many to keep their origins")
    elif plan is not None:
        ways.append(f"counts drawn from views of {plan.samples} samples per pixel")
        if plan.why_rendered:
            ways.append(f"since {plan.why_rendered}")
    if facts.target.recipe.products.radiance != "none":
        ways.append("full-light images")
    return f"{', '.join(ways)}; " if ways else ""


def _seconds(facts: Facts) -> float:
    """Time of rendering and of photons, from the probe's speed; nothing else is counted."""
    grid, products, plan = facts.grid, facts.target.recipe.products, facts.plan
    pixels = grid.height * grid.width
    spent_s = facts.hit_s * pixels * (products.truth + grid.view_count * bool(products.view_truth))
    samples = facts.target.recipe.render.samples_per_pixel if products.radiance != "none" else 0
    if plan is not None and not plan.thins:
        samples = plan.samples
    spent_s += facts.path_s * samples * pixels * grid.view_count
    if plan is not None and plan.thins:
        cost = PHOTON_COST / SAMPLE_COST if facts.is_compiled else SCALAR_PHOTON_COST / SCALAR_SAMPLE_COST
        share = USUAL_SHARE if plan.known_places is None else plan.kept_share
        paths_per_photon = cost * max(USUAL_SHARE / share, 1.0)
        spent_s += facts.path_s * paths_per_photon * plan.photons_per_view * grid.view_count
    return spent_s


def _in_time(spent_s: float) -> str:
    """A time in the unit that suits it, with one digit; no less than a second."""
    units = ((86400, "days"), (3600, "hours"), (60, "minutes"))
    size_s, unit = next(((size_s, unit) for size_s, unit in units if spent_s >= 2 * size_s), (1, "s"))
    return f"{float(f'{max(spent_s, 1) / size_s:.1g}'):g} {unit}"
