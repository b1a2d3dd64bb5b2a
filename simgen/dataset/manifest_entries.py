"""What the manifest says of a dataset: recipe, scene, software, and what work was skipped."""

from dataclasses import asdict
from typing import Any

from simgen.cameras.rig import Rig
from simgen.dataset.prepared import Prepared
from simgen.dataset.rendered_views import background_paths_saved
from simgen.dataset.software import versions
from simgen.renderer.mitsuba_scene import RenderScene

RGB_UNIT = "linear sRGB whose luminance is in cd/m^2"
SPECTRAL_UNIT = "cd/m^2 of light of 555 nm that gives as many photons to a pixel that detects them all"


def description(prepared: Prepared, render_scene: RenderScene) -> dict[str, Any]:
    """What a dataset is made from and with."""
    recipe, scene = prepared.recipe, prepared.scene
    channels = 3 if render_scene.filters is None else len(render_scene.filters.sensitivity)
    return {
        "title": recipe.title or scene.title,
        "grid": asdict(recipe.grid.camera_grid()),
        "cfa": recipe.cfa,
        "frames": recipe.sensor.frames,
        "bits": recipe.sensor.bits,
        "radiance_channels": {"none": None, "mosaic": 1, "rgb": channels}[recipe.products.radiance],
        "radiance_unit": SPECTRAL_UNIT if recipe.is_spectral else RGB_UNIT,
        "objects": {str(number): name for number, name in render_scene.names.items()},
        "analysis": recipe.analysis.model_dump(mode="json"),
        "recipe": prepared.recipe_of_data,
        "scene": scene.model_dump(mode="json"),
        "versions": versions(),
    }


def skipped(
    prepared: Prepared,
    photons: dict[str, Any] | None,
    shadow_rays: int | None,
    render_scene: RenderScene,
    rig: Rig,
) -> list[dict[str, Any]]:
    """What was not done: what, why, and how much work that saved, and its unit.

    `photons` is what the manifest says of them, `shadow_rays` how many were traced to count the cameras that
    see a point; both None if there was no such work.
    """
    recipe, products = prepared.recipe, prepared.recipe.products
    grid = recipe.grid.camera_grid()
    pixels = grid.view_count * grid.height * grid.width
    found: list[dict[str, Any]] = []

    def add(what: str, why: str, saved: int, unit: str) -> None:
        found.append({"what": what, "why": why, "saved": saved, "unit": unit})

    if photons is not None and photons.get("paths", 0) < photons.get("dense_paths_instead", 0):
        saved = photons["dense_paths_instead"] - photons["paths"]
        add("rendering for the photon counts", "photons are drawn one by one", saved, "light paths")
    if products.radiance == "none" and (photons is None or photons["method"] == "thinning"):
        paths = pixels * recipe.render.samples_per_pixel
        add("radiance images", "the recipe does not ask for them", paths, "light paths")
    elif products.radiance == "mosaic" and recipe.cfa is not None:
        what = "two of three colours of the radiance images"
        add(what, "the Bayer pattern hides them", 8 * pixels, "bytes before compression")
    renders_for_photons = photons is not None and photons["method"] == "dense"
    if products.radiance != "none" and not renders_for_photons:
        saved = background_paths_saved(render_scene, rig, recipe.render)
        if saved:
            why = f"the recipe asks for {recipe.render.background_samples_per_pixel} per pixel there"
            add("samples where no object can be seen", why, saved, "light paths")
    if shadow_rays is not None:
        what = "visibility of some points"
        add(what, "no shape can stand in the way", pixels - shadow_rays, "rays")
    elif products.truth:
        add("visibility", "the recipe does not ask for it", pixels, "rays at most")
    if not products.view_truth:
        add("truth of every view", "the recipe does not ask for it", pixels, "first hits")
    return found
