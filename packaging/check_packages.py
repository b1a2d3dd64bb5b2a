"""Build wheel and sdist, install them in a clean environment and use them from an unrelated directory.

    python packaging/check_packages.py FOLDER        # new or empty; takes some minutes and 2 GB

Prints what is installed and how large it is, without and with the renderer, and leaves with an exception if
anything is not as it should be.
"""

import re
import subprocess
import sys
import zipfile
from email import message_from_bytes
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RELATIVE_LINK = re.compile(r"\]\((?!https?://)[^)]*\)")
ANALYSIS = """
import sys
import pcii
assert "site-packages" in pcii.__file__, pcii.__file__
dataset = pcii.sample()
sections = pcii.reconstruct(dataset.counts, z_mm=[540, 620])
assert sections.counts.sum() > 0
assert not {"mitsuba", "drjit"} & set(sys.modules)
"""


class Environment:
    """A virtual environment in which commands are run from a folder that has nothing to do with it."""

    def __init__(self, folder: Path, work: Path) -> None:
        self.bin, self.work = folder / "bin", work
        subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
        work.mkdir()

    def run(self, *words: object, code: int = 0) -> str:
        """What a command of the environment says; AssertionError unless it leaves with this exit code."""
        program, *arguments = map(str, words)
        done = subprocess.run(
            [str(self.bin / program), *arguments], cwd=self.work, capture_output=True, text=True, check=False
        )
        assert done.returncode == code, f"{words}: {done.returncode}\n{done.stdout}\n{done.stderr}"
        return done.stdout + done.stderr

    def install(self, *what: object) -> None:
        """Install packages with pip, quietly."""
        self.run("python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *what)

    def megabytes(self) -> int:
        """Size of all that is installed."""
        files = [file for file in self.bin.parent.rglob("*") if file.is_file() and not file.is_symlink()]
        return round(sum(file.stat().st_size for file in files) / 1e6)


def built(folder: Path) -> Path:
    """The wheel, built from the source tree; AssertionError unless one built from the sdist is the same."""
    builder = Environment(folder / "builder", folder / "building")
    builder.install("hatchling")
    dist = folder / "dist"
    subprocess.run([builder.bin / "python", "-m", "hatchling", "build", "-d", dist], cwd=ROOT, check=True)
    (sdist,), (wheel,) = dist.glob("*.tar.gz"), dist.glob("*.whl")
    builder.run("python", "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", folder / "again", sdist)
    (other,) = (folder / "again").glob("*.whl")
    assert contents(wheel) == contents(other), "the sdist lacks files of the wheel"
    return wheel


def contents(wheel: Path) -> dict[str, int]:
    """Checksum of every file of a wheel, without its own list of them."""
    with zipfile.ZipFile(wheel) as files:
        return {info.filename: info.CRC for info in files.infolist() if not info.filename.endswith("RECORD")}


def check_metadata(wheel: Path) -> None:
    """AssertionError if something is missing that the package page shows, or a link there leads nowhere."""
    with zipfile.ZipFile(wheel) as files:
        (name,) = (name for name in files.namelist() if name.endswith(".dist-info/METADATA"))
        metadata = message_from_bytes(files.read(name))
    page = metadata.get_payload()
    assert isinstance(page, str)
    assert len(page) > 1000
    assert not RELATIVE_LINK.findall(page), "the package page has links into the source tree"
    for field in ("Author", "Summary", "License-Expression", "Keywords", "Requires-Python"):
        assert metadata[field], field


def check_analysis(clean: Environment) -> None:
    """Without the renderer: all of `pcii`, and one sentence of `simgen` on what is missing."""
    clean.run("python", "-c", ANALYSIS)
    clean.run("pcii", "sample", "-o", "sample")
    clean.run("pcii", "run", "sample", "-o", "results", "--method", "brightness")
    assert "files match" in clean.run("pcii", "verify", "results")
    for words in (["scenes"], ["generate", "sample", "-o", "made"]):
        said = clean.run("simgen", *words, code=2)
        assert "[render]" in said, said


def check_rendering(clean: Environment) -> None:
    """With the renderer: a scene and a recipe to start from, and the dataset of the recipe."""
    clean.run("simgen", "doctor")
    assert "two_objects" in clean.run("simgen", "scenes")
    clean.run("simgen", "new-scene", "mine", "--from", "two_objects")
    clean.run("simgen", "new-recipe", "mine")
    smaller = [word for value in ("grid.height=64", "grid.width=96") for word in ("--set", value)]
    clean.run("simgen", "generate", "data_recipes/mine.toml", "-o", "made", *smaller)
    assert "files match" in clean.run("simgen", "verify", "made")


def main(folder: Path) -> None:
    """Build, install and try; print sizes."""
    folder.mkdir(parents=True, exist_ok=True)
    wheel = built(folder)
    check_metadata(wheel)
    clean = Environment(folder / "clean", folder / "elsewhere")
    clean.install(wheel)
    print(f"{wheel.name}: {wheel.stat().st_size / 1e6:.1f} MB; analysis installs {clean.megabytes()} MB")
    check_analysis(clean)
    clean.install(f"{wheel}[render]")
    print(f"with the renderer {clean.megabytes()} MB")
    check_rendering(clean)


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
