"""The sample dataset is small, whole, what its recipe gives, and enough for all of `pcii run`."""

from pathlib import Path

import numpy as np
import pytest

import pcii
from pcii.app import commands as pcii_cli
from pcii.base import command_line
from pcii.store.sample_dataset import SAMPLE
from pcii.store.verification import verify

LARGEST_BYTES = 2_000_000


def test_the_sample_is_small_and_whole() -> None:
    files = [file for file in SAMPLE.rglob("*") if file.is_file()]
    assert sum(file.stat().st_size for file in files) < LARGEST_BYTES
    assert verify(SAMPLE) == len(files) - 2  # but for the manifest and README.md


def test_the_sample_has_all_that_an_analysis_uses() -> None:
    data = pcii.sample()
    assert data.name == "sample"
    assert data.truth is not None
    assert data.truth.photons is not None
    assert data.views is not None
    # 25 views of 2000 photons, Poisson: a standard deviation of 224.
    assert abs(data.counts.total - 25 * 2000) < 5 * 224


def test_a_copy_is_a_dataset_of_its_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "new" / "copy"
    assert command_line.run(pcii_cli.app, ["sample", "-o", str(out)]) == 0
    assert verify(out) == verify(SAMPLE)
    assert command_line.run(pcii_cli.app, ["sample", "-o", str(out)]) == 2
    assert f"error: {out}: holds something else; name a new or empty folder" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.renders
def test_the_sample_is_what_its_recipe_gives(tmp_path: Path) -> None:
    import simgen

    recipe = simgen.load_recipe("sample")
    simgen.generate(recipe, tmp_path / "made")
    made, kept = pcii.open_dataset(tmp_path / "made"), pcii.sample()
    assert kept.manifest["recipe"] == recipe.recipe.model_dump(mode="json", exclude={"publication"})
    assert kept.manifest["scene"] == made.manifest["scene"]
    if made.manifest["files"] == kept.manifest["files"]:
        return
    # Another renderer, or another processor: the same geometry but for pixels on an outline, the same light
    # but for its noise, and other photons of the same rate.
    assert made.truth is not None
    assert kept.truth is not None
    same = made.truth.object_id == kept.truth.object_id
    assert same.mean() > 0.999
    np.testing.assert_allclose(made.truth.z_mm[same], kept.truth.z_mm[same], rtol=1e-4)
    for k, l in np.ndindex(5, 5):
        totals = [int(data.counts.view(k, l).sum()) for data in (made, kept)]
        assert abs(totals[0] - totals[1]) < 5 * np.sqrt(2 * 2000)
    assert made.views is not None
    assert kept.views is not None
    light = [data.views.view(2, 2).astype(float) for data in (made, kept) if data.views is not None]
    np.testing.assert_allclose(light[0].mean(), light[1].mean(), rtol=0.02)
