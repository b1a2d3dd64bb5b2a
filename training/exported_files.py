"""The trained network as the two files that `pcii` runs, and back."""

from pathlib import Path

import torch  # pyright: ignore[reportMissingImports]
from torch import Tensor, nn  # pyright: ignore[reportMissingImports]

from pcii.depth.network_inputs import NetworkInputs
from training.layers import WIDTHS, SurfaceNetwork

OPSET = 18


def export(network: SurfaceNetwork, folder: Path) -> None:
    """Write `trunk.onnx` and `head.onnx` into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    Z, h, w = 5, 64, 32
    # Axes whose sizes may differ from those of the example by which a part is traced.
    blocks, cells = {1: "planes", 2: "rows", 3: "columns"}, {1: "planes", 2: "cell_rows", 3: "cell_columns"}
    features = {0: "planes", 2: "cell_rows", 3: "cell_columns"}
    of_cells = dict.fromkeys(("features", "cell_logit", "cell_mask"), features)
    evidence, surface = torch.zeros(1, Z, h, w), torch.zeros(1, Z, h // 2, w // 2)
    maps = evidence, torch.ones_like(evidence), torch.ones_like(surface), surface
    axes = blocks, blocks, cells, cells, {}, {1: "planes"}
    _write(
        network.trunk,
        (*maps, torch.ones(1, 1), torch.zeros(1, Z, 2)),
        folder / "trunk.onnx",
        dict(zip(NetworkInputs._fields, axes, strict=True)),
        of_cells | {"nothing": {2: "cell_rows", 3: "cell_columns"}},
    )
    logit = torch.zeros(Z, 1, h // 2, w // 2)
    _write(
        network.head,
        (logit.expand(-1, WIDTHS[0], -1, -1).clone(), logit, logit, evidence, evidence),
        folder / "head.onnx",
        of_cells | {"evidence": blocks, "brightness": blocks},
        {"logit": blocks, "mask": blocks},
    )


def _write(
    module: nn.Module,
    example: tuple[Tensor, ...],
    file: Path,
    inputs: dict[str, dict[int, str]],
    outputs: dict[str, dict[int, str]],
) -> None:
    """Write a part of the network, with the names of inputs and outputs and of their axes."""
    torch.onnx.export(
        module.cpu().eval(),
        example,
        file,
        input_names=list(inputs),
        output_names=list(outputs),
        dynamic_axes=inputs | outputs,
        opset_version=OPSET,
        dynamo=False,
    )


def load_exported(network: SurfaceNetwork, folder: Path) -> None:
    """Take the weights of `trunk.onnx` and `head.onnx`; layers that these do not have stay as they are."""
    import onnx  # pyright: ignore[reportMissingImports]
    from onnx import numpy_helper  # pyright: ignore[reportMissingImports]

    for part, name in ((network.trunk, "trunk"), (network.head, "head")):
        own = part.state_dict()
        for one in onnx.load(folder / f"{name}.onnx").graph.initializer:
            if one.name in own:
                own[one.name] = torch.from_numpy(numpy_helper.to_array(one).copy())
        part.load_state_dict(own)
