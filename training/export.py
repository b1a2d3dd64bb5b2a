"""Write trained weights as the files that `pcii` runs.

python -m training.export weights.pt [--out pcii/depth/weights]
"""

import argparse
from pathlib import Path

import torch

from pcii.depth.surface_network import WEIGHTS
from training.layers import WIDTHS, DepthNetwork

OPSET = 18


def main() -> None:
    """Export the weights named on the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("weights", type=Path)
    parser.add_argument("--out", type=Path, default=WEIGHTS)
    arguments = parser.parse_args()
    network = DepthNetwork().eval()
    network.load_state_dict(torch.load(arguments.weights, weights_only=True))
    export(network, arguments.out)


def export(network: DepthNetwork, folder: Path) -> None:
    """Write `trunk.onnx` and `head.onnx` into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    Z, h, w = 5, 64, 32
    blocks, cells = {0: "planes", 1: "rows", 2: "columns"}, {0: "planes", 1: "cell_rows", 2: "cell_columns"}
    evidence, surface = torch.zeros(Z, h, w), torch.zeros(Z, h // 2, w // 2)
    inputs = (evidence, torch.ones(Z, h, w), torch.ones(Z, h // 2, w // 2), surface, torch.ones(1))
    names = ["evidence", "brightness", "coverage", "surface", "light"]
    features = {0: "planes", 2: "cell_rows", 3: "cell_columns"}
    torch.onnx.export(
        network.trunk,
        inputs,
        folder / "trunk.onnx",
        input_names=names,
        output_names=["features", "cell_logit", "nothing"],
        dynamic_axes={
            **dict(zip(names, (blocks, blocks, cells, cells), strict=False)),
            "features": features,
            "cell_logit": features,
            "nothing": {2: "cell_rows", 3: "cell_columns"},
        },
        opset_version=OPSET,
        dynamo=False,
    )
    parts = torch.zeros(Z, WIDTHS[0], h // 2, w // 2), torch.zeros(Z, 1, h // 2, w // 2)
    names = ["features", "cell_logit", "evidence", "brightness"]
    torch.onnx.export(
        network.head,
        (*parts, evidence, evidence),
        folder / "head.onnx",
        input_names=names,
        output_names=["logit"],
        dynamic_axes=dict(zip([*names, "logit"], (features, features, blocks, blocks, blocks), strict=True)),
        opset_version=OPSET,
        dynamo=False,
    )


if __name__ == "__main__":
    main()
