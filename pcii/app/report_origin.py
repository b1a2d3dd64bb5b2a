"""How a report was made: commands, dates, machine, recipe, versions, hashes, and what was skipped."""

import json
import shlex
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from pcii.app.command_options import budget_words
from pcii.app.pipeline import Outcome
from pcii.depth.methods import DEFAULT_METHOD
from pcii.evaluation.method_names import depth_name
from pcii.evaluation.provenance import machine, software_of
from pcii.evaluation.tables import Table
from pcii.store.manifests import DatasetManifest


def origin(outcome: Outcome, smoothing_px: float | None) -> dict[str, Any]:
    """Content of the last part of a report: tables of names and values, savings, and the recipe as JSON.

    `smoothing_px` is what was asked for.
    """
    manifest = outcome.dataset.manifest
    recipe = {name: manifest[name] for name in ("recipe", "scene") if manifest.get(name)}
    return {
        "data": _of_dataset(manifest, outcome.dataset.name),
        "analysis": _of_analysis(outcome, smoothing_px),
        "skipped": _skipped(manifest),
        "recipe": json.dumps(recipe, indent=1, ensure_ascii=False).splitlines() if recipe else [],
    }


def _of_dataset(manifest: DatasetManifest, name: str) -> list[tuple[str, str]]:
    """Rows (name, value) on how the dataset was made."""
    recipe, backend, photons = (manifest.get(key) or {} for key in ("recipe", "backend", "photons"))
    rows = [("folder", name)]
    rows += [(key, str(manifest[key])) for key in ("origin", "licence", "citation") if manifest.get(key)]
    if _has(recipe, "scene", "seed"):
        rows.append(("scene", f"{recipe['scene']}, seed {recipe['seed']}"))
    if backend:
        samples = (recipe.get("render") or {}).get("samples_per_pixel")
        each = f", {samples} samples per pixel" if samples is not None else ""
        rows.append(("renderer", f"Mitsuba {backend['mitsuba']}, {backend['variant']}{each}"))
    method = photons.get("method")
    if method == "thinning" and _has(photons, "paths", "total", "dense_paths_instead"):
        value = (
            f"drawn one by one: {photons['paths']:,} light paths for {photons['total']:,} photons, where "
            f"rendering every pixel would have taken at least {photons['dense_paths_instead']:,}"
        )
        rows.append(("photons", value))
    elif method == "dense" and _has(photons, "samples_per_pixel", "rendering_noise"):
        value = (
            f"drawn from rendered views of {photons['samples_per_pixel']} samples per pixel, whose noise "
            f"adds at most {100 * photons['rendering_noise']:.2g} % to the variance of the counts"
        )
        rows.append(("photons", value))
    if manifest.get("timings_s"):
        rows.append(("time", _stages(manifest["timings_s"], 1)))
    if manifest.get("versions"):
        rows.append(("software", _versions(manifest["versions"])))
    if manifest.get("identity"):
        rows.append(("identity", manifest["identity"]))
    files = len(manifest["files"])
    rows.append(("files", f"{files:,}, each with its SHA-256 in manifest.json; pcii verify compares them"))
    return rows


def _has(part: Mapping[str, Any], *names: str) -> bool:
    return all(part.get(name) is not None for name in names)


def _of_analysis(outcome: Outcome, smoothing_px: float | None) -> list[tuple[str, str]]:
    """Rows (name, value) on the analysis that this report shows."""
    methods = (*(focus.method for focus in outcome.focus), depth_name(outcome.depth_method))
    versions = {name: text for method in methods for name, text in software_of(method).items()}
    now = datetime.now(UTC)
    beside = "; steps ran side by side" if outcome.focus else ""
    return [
        ("command", _command(outcome, smoothing_px)),
        ("date", f"{now:%Y-%m-%d %H:%M} UTC"),
        ("machine", machine()),
        ("time", _stages(outcome.timings_s, 2) + beside),
        ("software", _versions(versions)),
    ]


def _command(outcome: Outcome, smoothing_px: float | None) -> str:
    """The command that makes the same report, with all that it may leave out; folders by their names."""
    words = ["pcii", "run", outcome.dataset.name, "-o", "RESULTS"]
    for z in outcome.sections.z_mm:
        words += ["--z-mm", f"{z:.17g}" if float(f"{z:g}") != z else f"{z:g}"]
    for focus in outcome.focus:
        words += ["--method", focus.method]
    if outcome.depth_method != DEFAULT_METHOD:
        words += ["--depth-method", outcome.depth_method]
    if smoothing_px is not None:
        words += ["--smoothing-px", f"{smoothing_px:g}"]
    return shlex.join([*words, *budget_words(outcome.dataset)])


def _skipped(manifest: DatasetManifest) -> Table:
    """What the simulation did not do, why it could leave it out, and what that saved."""
    rows: list[tuple[str, str, str]] = []
    for skip in manifest.skipped:
        if skip["unit"].startswith("bytes"):
            rows.append((skip["what"], skip["why"], f"{skip['saved'] / 1e6:,.1f} MB{skip['unit'][5:]}"))
        else:
            rows.append((skip["what"], skip["why"], f"{skip['saved']:,.0f} {skip['unit']}"))
    return Table("Left out by the simulation", ("what", "why", "saved"), tuple(rows), words=3)


def _versions(versions: Mapping[str, str]) -> str:
    return ", ".join(f"{name} {number}" for name, number in versions.items())


def _stages(seconds: Mapping[str, float], digits: int) -> str:
    each = ", ".join(f"{name} {value:.{digits}f}" for name, value in seconds.items())
    return f"{sum(seconds.values()):.1f} s ({each})"
