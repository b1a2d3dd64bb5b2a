"""Make a small dataset, open it, and check that it is whole. The folder to make it in may be an argument."""

import sys
from pathlib import Path

import pcii
import simgen

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/small-nested")
recipe = simgen.load_recipe("small", ["photons.nested=[1000]", "products.radiance=none"])
manifest = simgen.generate(recipe, folder)
print(f"{manifest['photons']['total']} photons by {manifest['photons']['method']}")

dataset = pcii.open_dataset(folder)
print(dataset)
print(dataset.at_light(pcii.Light(1000)).counts)
print(f"{pcii.verify(folder)} files are as they were written")
