"""The work that is skipped, each skip as a pair: the result with it, and without it.

A pair takes a `World`, a small random scene, and gives named arrays; what both give must be the same, byte by
byte. `photons, not pixels` alone is another draw of the same distribution (the study of photon images has its
distances).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from unittest.mock import patch

import numpy as np

from benchmarks.peers.dense_photons import drawn_counts, rendered_mosaic
from pcii.base import silent
from pcii.sections import extend, reconstruct, reconstruction
from pcii.store import MANIFEST, TRUTH, open_dataset
from pcii.types import FocalPlanes, PhotonCounts, Sections, sense
from simgen.dataset import Prepared, generate, prepare
from simgen.dataset.generation import Reuse, make
from simgen.photons import Capture, Plan, explore, thin_photons
from simgen.renderer import RenderScene
from simgen.spec import Recipe
from simgen.truth import first_hits_at_centre, truth_file, visible_views

Arrays = Mapping[str, np.ndarray]
DEPTH = f"{TRUTH}/z_mm"
"""Part of a dataset that holds the depth."""
BRIGHT = 2.0
"""Photons per pixel of counts that are kept as images."""


@dataclass(frozen=True, eq=False)
class World:
    """A small scene and its recipe, a folder for what is made of it, and what is ready before the clock."""

    recipe: Recipe
    recipe_folder: Path
    folder: Path

    def prepare_all(self) -> None:
        """Make all that pairs have in common, so that neither of a pair is charged for it."""
        for name in ("reuse", "explored", "images", "known"):
            getattr(self, name)

    @cached_property
    def prepared(self) -> Prepared:
        """The recipe with its scene."""
        return prepare(self.recipe, self.recipe_folder)

    @cached_property
    def scene(self) -> RenderScene:
        """The scene in the renderer."""
        return self.prepared.render_scene()

    @cached_property
    def capture(self) -> Capture:
        """Scene and cameras."""
        recipe = self.recipe
        return Capture(self.scene, recipe.grid.camera_grid(), recipe.cfa, recipe.photons, seed=3)

    @cached_property
    def explored(self) -> Plan:
        """What is found out about the light."""
        return explore(self.capture)

    @cached_property
    def images(self) -> np.ndarray:
        """Dense counts (K, L, H, W) of plenty of light."""
        shape = self.capture.grid.shape_KLHW
        return np.random.default_rng(self.recipe.seed).poisson(BRIGHT, shape)

    @cached_property
    def few(self) -> np.ndarray:
        """Dense counts of little light."""
        return np.random.default_rng(self.recipe.seed).poisson(0.01, self.capture.grid.shape_KLHW)

    @cached_property
    def events(self) -> PhotonCounts:
        """The same as events."""
        k, l, i, j = np.nonzero(self.few)
        n = self.few[k, l, i, j]
        return PhotonCounts.from_events(k, l, i, j, n, self.capture.grid, cfa=self.recipe.cfa)

    @cached_property
    def known(self) -> Sections:
        """Sections of little light at the first half of `planes`."""
        return reconstruct(self.events, self.planes.take(slice(0, len(self.planes) // 2)))

    @cached_property
    def reuse(self) -> Reuse:
        """What is left of the dataset that was made first, in the folder "first"."""
        reuse = Reuse()
        self.made("first", reuse)
        return reuse

    @cached_property
    def planes(self) -> FocalPlanes:
        """Sixteen planes between the ends of the recipe's range."""
        return FocalPlanes.at_depths(self.capture.grid, np.linspace(450, 750, 16))

    def made(self, name: str, reuse: Reuse | None = None, **products: object) -> Path:
        """A new dataset of the recipe with other products; the folder must not exist yet."""
        changed = self.recipe.products.model_copy(update=products)
        recipe = self.prepared.recipe.model_copy(update={"products": changed})
        folder = self.folder / name
        make(replace(self.prepared, recipe=recipe), folder, silent, reuse or Reuse())
        return folder


@dataclass(frozen=True)
class Skip:
    """What is skipped; `on` skips it and `off` does it all. `exact`: they give the same bytes."""

    name: str
    on: Callable[[World, str], Arrays]
    off: Callable[[World, str], Arrays]
    exact: bool = True


def content_of(folder: Path, part: str = "") -> Arrays:
    """Bytes of the files of a dataset, or of a part of it, but its manifest; by name."""
    files = sorted(file for file in (folder / part).rglob("*") if file.is_file() and file.name != MANIFEST)
    return {str(file.relative_to(folder)): np.frombuffer(file.read_bytes(), np.uint8) for file in files}


def _sums(sections: Sections) -> Arrays:
    return {"counts": sections.counts.astype(np.int64), "coverage": sections.coverage}


def _of_dense(world: World, images: np.ndarray, share: float) -> Arrays:
    """Sections of dense counts, added as images if more than this share of the pixels has photons."""
    counts = PhotonCounts.from_dense(images, world.capture.grid, cfa=world.recipe.cfa)
    with patch.object(reconstruction, "DENSE_SHARE", share):
        return _sums(reconstruct(counts, world.planes))


def _visible(world: World, *, tests_all: bool) -> Arrays:
    hits = first_hits_at_centre(world.scene, world.capture.grid)
    if not tests_all:
        return {"views": visible_views(world.scene, world.capture.grid, hits)[0]}
    with patch.object(truth_file, "_can_be_blocked", lambda _, __, start: np.ones(len(start), bool)):
        return {"views": visible_views(world.scene, world.capture.grid, hits)[0]}


def _drawn(world: World, explored: Plan | None) -> Arrays:
    return dict(thin_photons(world.capture, explored)[0].columns())


def _mosaics(folder: Path, cfa: str | None) -> Arrays:
    """The mosaics of a dataset's radiance images."""
    dataset = open_dataset(folder)
    views = np.ndindex(dataset.grid.rows, dataset.grid.cols)
    assert dataset.views is not None
    images = [np.asarray(dataset.views.radiance[k, l]) for k, l in views]
    return {"mosaic": np.array([sense(image, cfa) for image in images])}


def _dense(world: World) -> Arrays:
    views = range(world.capture.grid.view_count)
    rng = np.random.default_rng(3)
    mosaics = [rendered_mosaic(world.capture, view, 16, 1 + view) for view in views]
    return {
        "n": np.array([drawn_counts(m, world.recipe.cfa, world.recipe.photons.budget, rng) for m in mosaics])
    }


def _second(world: World, name: str, reuse: Reuse) -> Arrays:
    """A dataset that differs from `world.first` in its seed alone, made with what that one left."""
    recipe = world.prepared.recipe.model_copy(update={"seed": world.recipe.seed + 1})
    make(replace(world.prepared, recipe=recipe), world.folder / name, silent, reuse)
    return content_of(world.folder / name)


def _finished(world: World) -> Arrays:
    generate(world.recipe, world.recipe_folder, world.folder / "first")
    return content_of(world.folder / "first")


SKIPS = (
    Skip(
        "photons, not pixels: thinning instead of 16 samples a pixel",
        lambda w, _: _drawn(w, w.explored),
        lambda w, _: _dense(w),
        exact=False,
    ),
    Skip(
        "exploration known: it does not depend on the seed",
        lambda w, _: _drawn(w, w.explored),
        lambda w, _: _drawn(w, None),
    ),
    Skip(
        "radiance images that nobody asked for",
        lambda w, n: content_of(w.made(n, radiance="none"), TRUTH),
        lambda w, n: content_of(w.made(n, radiance="rgb"), TRUTH),
    ),
    Skip(
        "colours that the Bayer pattern hides",
        lambda w, n: _mosaics(w.made(n, radiance="mosaic"), w.recipe.cfa),
        lambda w, n: _mosaics(w.made(n, radiance="rgb"), w.recipe.cfa),
    ),
    Skip(
        "visibility that nobody asked for",
        lambda w, n: content_of(w.made(n, visibility=False), DEPTH),
        lambda w, n: content_of(w.made(n, visibility=True), DEPTH),
    ),
    Skip(
        "truth of every view that nobody asked for",
        lambda w, n: content_of(w.made(n), DEPTH),
        lambda w, n: content_of(w.made(n, view_truth=("z_mm", "object_id")), DEPTH),
    ),
    Skip(
        "shadow rays of points that nothing can hide",
        lambda w, _: _visible(w, tests_all=False),
        lambda w, _: _visible(w, tests_all=True),
    ),
    Skip(
        "what datasets of one scene have in common",
        lambda w, n: _second(w, n, w.reuse),
        lambda w, n: _second(w, n, Reuse()),
    ),
    Skip("datasets that are finished", lambda w, _: _finished(w), lambda w, n: content_of(w.made(n))),
    Skip(
        "empty pixels: sections from events instead of images",
        lambda w, _: _sums(reconstruct(w.events, w.planes)),
        lambda w, _: _of_dense(w, w.few, -1.0),
    ),
    Skip(
        "events one by one: images of dense counts instead",
        lambda w, _: _of_dense(w, w.images, 0.0),
        lambda w, _: _of_dense(w, w.images, 1.0),
    ),
    Skip(
        "planes that are known: extend instead of anew",
        lambda w, _: _sums(extend(w.known, w.events, w.planes)),
        lambda w, _: _sums(reconstruct(w.events, w.planes)),
    ),
)
