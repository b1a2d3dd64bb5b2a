"""Make the sample dataset that comes with the package, of data_recipes/sample.toml."""

import shutil

import simgen
from pcii.store import SAMPLE, verify

LARGEST_BYTES = 2_000_000


def main() -> None:
    """Replace the sample by a new one, and say how large it is."""
    shutil.rmtree(SAMPLE, ignore_errors=True)
    simgen.generate(simgen.load_recipe("sample"), SAMPLE)
    size = sum(file.stat().st_size for file in SAMPLE.rglob("*") if file.is_file())
    if size >= LARGEST_BYTES:
        raise SystemExit(f"{SAMPLE}: {size} bytes; it may have {LARGEST_BYTES}, so make the recipe smaller")
    print(f"{SAMPLE}: {verify(SAMPLE)} files, {size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
