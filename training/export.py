"""Write trained weights as the files that `pcii` runs.

python -m training.export weights.pt [--out pcii/depth/weights]
"""

import argparse
from pathlib import Path

import torch
from torch import Tensor, nn

from pcii.depth.network_inputs import NetworkInputs
from pcii.depth.surface_network import WEIGHTS
from training.layers import WIDTHS, SurfaceNetwork

OPSET = 18


def main() -> None:
    """Export the weights named on the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("weights", type=Path)
    parser.add_argument("--out", type=Path, default=WEIGHTS)
    arguments = parser.parse_args()
    network = SurfaceNetwork().eval()
    network.load_state_dict(torch.load(arguments.weights, weights_only=True, map_location="cpu"))
    export(network, arguments.out)


def export(network: SurfaceNetwork, folder: Path) -> None:
    """Write `trunk.onnx` and `head.onnx` into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    Z, h, w = 5, 64, 32
    blocks, cells = {1: "planes", 2: "rows", 3: "columns"}, {1: "planes", 2: "cell_rows", 3: "cell_columns"}
    evidence, surface = torch.zeros(1, Z, h, w), torch.zeros(1, Z, h // 2, w // 2)
    inputs = (evidence, torch.ones_like(evidence), torch.ones_like(surface), surface, torch.ones(1, 1))
    features = {0: "planes", 2: "cell_rows", 3: "cell_columns"}
    outputs = dict.fromkeys(("features", "cell_logit", "cell_mask"), features)
    outputs["nothing"] = {2: "cell_rows", 3: "cell_columns"}
    names = NetworkInputs._fields
    _write(
        network.trunk,
        (*inputs, torch.zeros(1, Z, 2)),
        folder / "trunk.onnx",
        dict(zip(names, (blocks, blocks, cells, cells, {}, {1: "planes"}), strict=True)),
        outputs,
    )
    of_cells = torch.zeros(Z, 1, h // 2, w // 2)
    parts = torch.zeros(Z, WIDTHS[0], h // 2, w // 2), of_cells, of_cells, evidence, evidence
    axes = dict.fromkeys(("features", "cell_logit", "cell_mask"), features)
    axes |= {"evidence": blocks, "brightness": blocks}
    _write(network.head, parts, folder / "head.onnx", axes, {"logit": blocks, "mask": blocks})


def _write(
    module: nn.Module,
    example: tuple[Tensor, ...],
    file: Path,
    inputs: dict[str, dict[int, str]],
    outputs: dict[str, dict[int, str]],
) -> None:
    """Write a part of the network, with the names of axes whose sizes may differ from the example's."""
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


if __name__ == "__main__":
    main()
