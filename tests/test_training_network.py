"""Training from examples to files: requests, steps, and the same masks from what is exported."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from pcii.depth import NetworkInputs, run_network, surface_network
from pcii.types import CameraGrid, PhotonCounts, Truth, depth_of_total_disparity_mm
from training.examples import example_of, read_example, write_example
from training.requests import NOT_COUNTED, draw_request, targets_of

GRID = CameraGrid(rows=3, cols=3, pitch_mm=(5, 5), focal_mm=50, pixel_mm=0.0704, height=64, width=128)
TOTAL_PX = 8.0


def write_examples(folder: Path) -> None:
    """Two examples of a square with texture before nothing, and of one with the same number of planes."""
    z_mm = depth_of_total_disparity_mm(GRID, np.array([TOTAL_PX]))[0]
    shape = GRID.shape_HW
    is_square = np.zeros(shape, bool)
    is_square[16:48, 32:96] = True
    truth = Truth(np.where(is_square, z_mm, np.inf), is_square.astype(np.int16), {1: "square"})
    rng = np.random.default_rng(1)
    light = 0.01 + np.where(is_square, 40 * rng.random(shape) ** 4, 0)
    shifts = (np.arange(3) - 1) * round(TOTAL_PX / 2)
    # A camera further right sees the square further left.
    films = [[np.roll(light, (-down, -right), axis=(0, 1)) for right in shifts] for down in shifts]
    for number in range(2):
        counts = PhotonCounts.from_dense(rng.poisson(films), GRID)
        example = example_of(counts, truth, np.array([z_mm]), np.random.default_rng(2))
        write_example(example, folder / f"square_draw_{number}_0.npy")


def test_an_example_is_read_as_it_was_written(tmp_path: Path) -> None:
    write_examples(tmp_path)
    for file in tmp_path.iterdir():
        example, mapped = read_example(file), read_example(file, is_mapped=True)
        assert example.keys() == mapped.keys()
        for name, values in example.items():
            np.testing.assert_array_equal(mapped[name], values)
        (median, _, share), (named,) = example["objects"][0], example["named_planes"]
        assert median == pytest.approx(named)
        assert share == 0.25
        inside = example["object_number"] == 1
        assert inside.sum() == 32 * 64
        assert np.nanmax(abs(example["plane"][inside] - named)) < 1e-5
        assert np.isnan(example["plane"][~inside]).all()
        # The evidence is largest at the square's plane.
        nats = example["evidence"][:, 10:22, 20:44].astype(float).sum(axis=(1, 2))
        assert abs(nats.argmax() - named) <= 1


@pytest.mark.filterwarnings("ignore")  # of PyTorch's exporter, which traces
def test_what_is_trained_and_exported_says_the_same_masks(tmp_path: Path, monkeypatch) -> None:
    torch = pytest.importorskip("torch", reason="needs PyTorch, the extra `train`")
    pytest.importorskip("onnx", reason="needs onnx, the extra `train`")
    from training.batches import DEVICE, Examples
    from training.exported_files import export, load_exported
    from training.fit import Training
    from training.layers import SurfaceNetwork
    from training.losses import mask_log_probability

    torch.manual_seed(0)
    write_examples(tmp_path)
    network = SurfaceNetwork()
    load_exported(network, surface_network.WEIGHTS)
    examples = Examples(tmp_path)
    examples.max_values = 50_000
    assert len(examples.parts) == 2
    training = Training(network, tmp_path / "depth.pt")
    with ThreadPoolExecutor(1) as pool:
        batches = examples.draw_batches(np.random.default_rng(0), pool)
        losses = [training.step(next(batches), 0.5).item() for _ in range(4)]
    assert np.isfinite(losses).all()
    training.fit(examples, 1e-6)  # one step more, and the state is written
    assert Training(SurfaceNetwork(), tmp_path / "depth.pt").steps == training.steps == 5

    planes = np.array([0.7, 3.0])
    batch = examples.batch([0], 32, np.random.default_rng(3))
    inputs = NetworkInputs(*(part[0].cpu().numpy() for part in batch.inputs))
    requested = torch.from_numpy(planes.astype(np.float32)).to(DEVICE)[None]
    with torch.no_grad():
        depth, masks = training.averaged(*batch.inputs)
        expected = mask_log_probability(masks, depth, requested).exp()[0, :-1].cpu().numpy()
    export(training.averaged, tmp_path / "weights")
    monkeypatch.setattr(surface_network, "WEIGHTS", tmp_path / "weights")
    outputs = run_network(inputs, planes)
    np.testing.assert_allclose(outputs.in_focus, expected, atol=1e-4)
    np.testing.assert_allclose(outputs.no_surface, depth[0, -1].exp().cpu().numpy(), atol=1e-4)
    assert expected.max() > 0.01


# Median plane, planes that it reaches over, share of the film.
NEAR, FAR, BETWEEN = ((plane, 3.0, 0.1) for plane in (11.0, 39.0, 19.0))
LEANING, AWAY = (12.0, 20.0, 0.1), (60.0, 2.0, 0.1)


def test_an_object_belongs_to_the_nearest_requested_plane_or_to_none() -> None:
    objects = np.array([NEAR, FAR, BETWEEN, LEANING, AWAY], np.float32)
    targets = targets_of(objects, np.array([10.0, 40.0]))
    assert targets.tolist() == [2, 0, 1, NOT_COUNTED, NOT_COUNTED, 2]
    assert (targets_of(objects, np.zeros(0)) == NOT_COUNTED).all()


def test_walls_are_requested_as_often_as_not_and_planes_stay_within_the_sweep() -> None:
    objects = np.array([NEAR, (50.0, 4.0, 0.6)], np.float32)
    rng = np.random.default_rng(1)
    requests = [draw_request(objects, np.array([10.0, 90.0]), 64, rng) for _ in range(2000)]
    planes = [request.planes for request in requests]
    assert all(((each >= 0) & (each <= 63)).all() for each in planes)
    # A request is left out in 15 % of examples, and the wall in half of the others.
    share = np.mean([50.0 in each for each in planes])
    assert abs(share - 0.85 / 2) < 4 * np.sqrt(0.25 / 2000)
    with_all = [request for request in requests if request.planes.tolist() == [10.0, 50.0]]
    assert all(request.targets.tolist() == [2, 0, 1] for request in with_all)
