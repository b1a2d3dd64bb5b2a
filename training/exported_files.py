"""The trained network as the two files that `pcii` runs, and back."""

from pathlib import Path

import torch  # pyright: ignore[reportMissingImports]
from torch import Tensor, nn  # pyright: ignore[reportMissingImports]

from pcii.depth import NetworkInputs
from training.layers import SurfaceNetwork

OPSET = 18

Axes = dict[str, dict[int, str]]
"""Names of axes by the names of arrays."""


def export(network: SurfaceNetwork, folder: Path) -> None:
    """Write `trunk.onnx` and `head.onnx` into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    network.cpu().eval()
    # The network is traced by an example, and these are axes whose sizes may differ from the example's.
    blocks, cells = {1: "planes", 2: "rows", 3: "columns"}, {1: "planes", 2: "cell_rows", 3: "cell_columns"}
    features = {0: "planes", 2: "cell_rows", 3: "cell_columns"}
    of_cells = dict.fromkeys(("features", "cell_logit", "cell_mask"), features)
    maps = [torch.ones(1, 5, *sides) for sides in ((64, 32), (64, 32), (32, 16), (32, 16))]
    inputs, axes = (*maps, torch.ones(1, 1), torch.zeros(1, 5, 2)), (blocks, blocks, cells, cells, {})
    names = dict(zip(NetworkInputs._fields, (*axes, {1: "planes"}), strict=True))
    outputs = of_cells | {"nothing": {2: "cell_rows", 3: "cell_columns"}}
    _write(network.trunk, inputs, folder / "trunk.onnx", names, outputs)
    with torch.no_grad():
        *inputs, _ = network.trunk(*inputs)
    names = of_cells | {"evidence": blocks, "brightness": blocks}
    outputs = {"logit": blocks, "mask": blocks}
    _write(network.head, (*inputs, *maps[:2]), folder / "head.onnx", names, outputs)


def _write(module: nn.Module, example: tuple[Tensor, ...], file: Path, inputs: Axes, outputs: Axes) -> None:
    """Write a part of the network, with the names of inputs and outputs and of their axes."""
    torch.onnx.export(
        module,
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
        weights = part.state_dict()
        for one in onnx.load(folder / f"{name}.onnx").graph.initializer:
            if one.name in weights:
                weights[one.name] = torch.from_numpy(numpy_helper.to_array(one).copy())
        part.load_state_dict(weights)
