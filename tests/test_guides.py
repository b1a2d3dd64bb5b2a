"""The pages do what they say: their blocks run, and what they name exists."""

import re
import shutil
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_args
from unittest.mock import create_autospec

import numpy as np
import pytest
from cyclopts import CycloptsError
from guide_blocks import APPS, PAGES, ROOT, SHELL_SIGNS, blocks, run_page, words
from make_your_own_images import photograph
from pydantic import BaseModel
from tiny import TINY_RECIPE

import pcii
import simgen
from pcii.figures import write_png
from pcii.store import SAMPLE, Terms, write_card
from simgen.spec import Recipe, override

DOCS = ROOT / "docs"
SLOW = {"first_hour.md", "your_own_images.md"}
RUN = {page.name: page for page in PAGES if any(block.language == "python" for block in blocks(page))}


GRID = [f"grid.{key}={value}" for key, value in TINY_RECIPE["grid"].items()]
TINY = [*GRID, "products.radiance=none"]
"""Makes of any recipe one that takes a second."""


def given_cameras(request: pytest.FixtureRequest) -> None:
    errors = ["grid.errors.position_sd_mm=[0.3,0.3,0.3]", "products.counts=false"]
    simgen.generate(simgen.load_recipe("paper", [*TINY, *errors]), "out/imperfect")


def given_collections(request: pytest.FixtureRequest) -> None:
    simgen.generate_collection("paper", "out/dimmer", [*TINY, "photons.budget=[100,300]"])


def given_training(request: pytest.FixtureRequest) -> None:
    """The training set of the page on collections, but two scenes of it."""
    (recipe,) = (block.text for block in blocks(DOCS / "collections.md") if "# training.toml" in block.text)
    Path("training.toml").write_text(recipe, encoding="utf-8")
    simgen.generate_collection("training.toml", "out/training", ["scene_number={ range = [0, 2] }"])


def given_exchange(request: pytest.FixtureRequest) -> None:
    shutil.copytree(request.getfixturevalue("nested_dataset"), "out/small")
    write_card(Path("out/small"), Terms())
    shown: list[Any] = []
    viewer = SimpleNamespace(add_image=lambda image, **_: shown.append(image), shown=shown)
    request.getfixturevalue("monkeypatch").setitem(
        sys.modules, "napari", SimpleNamespace(Viewer=lambda: viewer, viewer=viewer)
    )


def given_cluster(request: pytest.FixtureRequest) -> None:
    monkeypatch = request.getfixturevalue("monkeypatch")
    monkeypatch.setattr(simgen, "generate_collection", create_autospec(simgen.generate_collection))
    cluster = SimpleNamespace(scheduler_address="tcp://127.0.0.1:8786", scale=lambda *, jobs: None)
    monkeypatch.setitem(sys.modules, "dask_jobqueue", SimpleNamespace(SLURMCluster=lambda **options: cluster))


def given_imported_scenes(request: pytest.FixtureRequest) -> None:
    Path("scenes/set_table").mkdir(parents=True)
    shutil.copy(ROOT / "scenes" / "set_table" / "set_table.glb", "scenes/set_table")


def given_plugins(request: pytest.FixtureRequest) -> None:
    """The package of the page, as if `pip install -e .` had been run."""
    (table,) = (block.text for block in blocks(DOCS / "plugins.md") if block.language == "toml")
    about = Path("my_methods-0.1.dist-info")
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: my-methods\nVersion: 0.1\n")
    lines = [
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in points.items())
        for group, points in tomllib.loads(table)["project"]["entry-points"].items()
    ]
    (about / "entry_points.txt").write_text("\n".join(lines))
    request.getfixturevalue("monkeypatch").syspath_prepend(str(Path.cwd()))
    request.addfinalizer(lambda: sys.modules.pop("my_methods", None))


def given_your_own_images(request: pytest.FixtureRequest) -> None:
    Path("out/example/photos").mkdir(parents=True)
    cameras = pcii.Optics(pitch_mm=(2, 2), focal_mm=35, sensor_mm=36).grid((5, 5, 480, 640))
    for k, l in np.ndindex(5, 5):
        write_png(Path(f"out/example/photos/{l}_{k}.png"), photograph(cameras, k, l))


GIVEN: dict[str, Callable[[pytest.FixtureRequest], None]] = {
    "cameras.md": given_cameras,
    "collections.md": given_collections,
    "training.md": given_training,
    "exchange.md": given_exchange,
    "cluster.md": given_cluster,
    "scenes.md": lambda _: Path("scenes/mine").mkdir(parents=True),
    "imported_scenes.md": given_imported_scenes,
    "plugins.md": given_plugins,
    "your_own_images.md": given_your_own_images,
}
"""What a page finds in the working folder, beside `out/sample`."""


def check_exchange(names: dict[str, Any]) -> None:
    dataset = pcii.open_dataset("out/small")
    stack = np.array([[dataset.counts.view(k, l) for l in range(3)] for k in range(2)])
    np.testing.assert_array_equal(names["dense"], stack)
    assert dataset.truth is not None
    np.testing.assert_array_equal(names["photons"]["truth_z_mm"], dataset.truth.z_mm)
    np.testing.assert_array_equal(names["truth"].z_mm, dataset.truth.z_mm)
    assert sys.modules["napari"].viewer.shown[0].shape == (2, 64, 60, 3)


def check_plugins(names: dict[str, Any]) -> None:
    assert names["focus"].in_focus.any(axis=(1, 2)).all()
    assert all(row["iou"] > 0.6 for row in names["score"].planes)  # 0.74 and 0.81, of one draw of photons
    assert names["score"].depth["bad_3px"] < 0.2  # 0.07


def check_training(names: dict[str, Any]) -> None:
    """Examples have sections and evidence of parts of the film, and the planes of its surfaces."""
    example = names["example"]
    assert len(names["examples"]) == 2
    assert example["sections"].shape == (17, 3, 48, 48)
    assert example["evidence"].shape == (17, 24, 24)
    assert example["sections"].sum() > 0
    assert 0 <= example["plane"].max() < 17


def check_cluster(names: dict[str, Any]) -> None:
    (call,) = names["simgen"].generate_collection.call_args_list
    assert call.kwargs["executor"].scheduler == "tcp://127.0.0.1:8786"


CHECKS = {
    "training.md": check_training,
    "exchange.md": check_exchange,
    "plugins.md": check_plugins,
    "cluster.md": check_cluster,
}
"""What is to come of a page, beside that it runs."""


def case(name: str) -> object:
    marks = [pytest.mark.renders] if "import simgen" in RUN[name].read_text() or name in GIVEN else []
    marks += [pytest.mark.slow] if name in SLOW else []
    return pytest.param(name, id=name, marks=marks)


@pytest.mark.guide
@pytest.mark.parametrize("name", [case(name) for name in RUN])
def test_a_page_runs(name: str, tmp_path: Path, monkeypatch, request: pytest.FixtureRequest) -> None:
    monkeypatch.chdir(tmp_path)
    if name != "first_hour.md":  # which begins in an empty folder
        shutil.copytree(SAMPLE, "out/sample")
    if name in GIVEN:
        GIVEN[name](request)
    names = run_page(RUN[name])
    if name in CHECKS:
        CHECKS[name](names)


def test_the_recipes_of_the_guide_are_valid() -> None:
    whole, sweep = (block.text for block in blocks(DOCS / "recipes.md") if block.language == "toml")
    assert Recipe.model_validate(tomllib.loads(whole)).photons.nested == (100, 300)
    assert tomllib.loads(sweep)["photons"]["budget"] == [100, 300, 1000]


def tables_of(model: type[BaseModel], name: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Each table of a recipe by its dotted name, with the defaults of its keys; ... for what has none."""
    defaults = {}
    for key, field in model.model_fields.items():
        kinds = [field.annotation, *get_args(field.annotation)]
        inner = [kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel)]
        for kind in inner:
            yield from tables_of(kind, f"{name}.{key}".lstrip("."))
        if not inner:
            defaults[key] = ... if field.is_required() else field.default
    yield name, defaults


def test_the_guide_to_recipes_has_every_key_with_its_default() -> None:
    _, *sections = re.split(r"^### (.+)$", (DOCS / "recipes.md").read_text(), flags=re.MULTILINE)
    written = {}
    for heading, text in zip(sections[::2], sections[1::2], strict=True):
        rows = re.findall(r"^\| `(\w+)` \|[^|]+\| (?:`(.+?)`|(\w+)) \|", text, re.MULTILINE)
        values = {"required": ..., "none": None}
        written[heading.strip("`[]").removeprefix("The recipe itself")] = {
            key: values[word] if word else tomllib.loads(f"value = {value}")["value"]
            for key, value, word in rows
        }
    listed = {
        name: {key: [*value] if isinstance(value, tuple) else value for key, value in defaults.items()}
        for name, defaults in tables_of(Recipe)
    }
    assert written == listed


def test_the_terms_of_the_guide_to_exchange_are_valid() -> None:
    (table,) = (block.text for block in blocks(DOCS / "exchange.md") if block.language == "toml")
    recipe = Recipe.model_validate({"scene": "blank", **tomllib.loads(table)})
    assert recipe.publication.licence == "CC-BY-4.0"
    values: dict[str, Any] = {"scene": "blank"}
    override(values, ["publication.licence=CC0-1.0"])
    assert Recipe.model_validate(values).publication.terms().licence == "CC0-1.0"


def test_sentences_that_the_guide_explains_are_said() -> None:
    text = (DOCS / "what_to_do.md").read_text()
    sources = [file.read_text() for room in ("pcii", "simgen") for file in (ROOT / room).rglob("*.py")]
    text_of_sources = re.sub(r'"\s*\n\s*f?"', "", "".join(sources))  # sentences that go on in the next line
    sentences = re.findall(r"^\| `([^`]+)` \|", text, re.MULTILINE)
    assert len(sentences) > 12
    assert [sentence for sentence in sentences if sentence not in text_of_sources] == []


INLINE = re.compile(r"(?<!`)`((?:simgen|pcii) [^`]+)`(?!`)")
LINK = re.compile(r"\]\((?!https?://)([^)#\s]+)")
COMMON = {"--help"}
"""Options that every command has, and that its own parser does not know."""
by_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.name))


def commands(line: str) -> Iterator[list[str]]:
    """The commands of a line, of which `simgen` and `pcii` alone are given, without the shell's signs."""
    part: list[str] = []
    for word in [*words(line), ";"]:
        if set(word) <= SHELL_SIGNS:
            if part:
                yield part
            part = []
        else:
            part.append(word.removeprefix(".venv/bin/"))


@by_page
def test_commands_of_blocks_are_understood(page: Path) -> None:
    for block in blocks(page):
        for line in block.commands():
            if not re.match(r"(\.venv/bin/)?(simgen|pcii) ", line):
                continue
            for program, *arguments in commands(line):
                if program in APPS:
                    known = [word for word in arguments if word not in COMMON]
                    try:
                        APPS[program].parse_args(known, exit_on_error=False, print_error=False)
                    except CycloptsError as fault:
                        pytest.fail(f"{page.name}: {line.strip()}: {fault}")


@by_page
def test_commands_and_options_of_sentences_exist(page: Path) -> None:
    for text in INLINE.findall(page.read_text(encoding="utf-8")):
        program, command, *rest = text.split()
        app = APPS[program]
        if command.startswith("-"):
            continue
        assert command in app, f"{page.name}: {text}"
        parser = app[command]
        if parser.default_command is None and rest:  # a group of commands, such as `simgen benchmark make`
            assert rest[0] in parser, f"{page.name}: {text}"
            parser = parser[rest.pop(0)]
        options = [] if parser.default_command is None else parser.assemble_argument_collection()
        known = {name for each in options for name in each.names} | COMMON
        for word in rest:
            if re.match(r"--?[a-z]", word):
                assert word.split("=")[0] in known, f"{page.name}: {text}"


@by_page
def test_tables_are_toml(page: Path) -> None:
    for block in blocks(page):
        if block.language == "toml":
            keys = re.findall(r"^(\w+) = ", block.text, re.MULTILINE)
            alternatives = len(keys) > 1 == len({*keys})
            for table in block.text.splitlines() if alternatives else [block.text]:
                tomllib.loads(table)


@by_page
def test_links_lead_to_files(page: Path) -> None:
    for link in LINK.findall(page.read_text(encoding="utf-8")):
        target = (page.parent / link).resolve()
        assert target.exists(), f"{page.name}: {link}"
        if page.is_relative_to(DOCS):  # Sphinx refuses a link to a page that is not part of the site
            assert target.suffix != ".md" or target.is_relative_to(DOCS), f"{page.name}: {link}"
