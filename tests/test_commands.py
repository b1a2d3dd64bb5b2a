"""The commands as a user types them: results, what is printed, exit codes, one sentence for bad input."""

import itertools
import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import zarr
from cyclopts import App
from hostile_names import NAMES

from pcii.app import commands as pcii_cli
from pcii.app.step_commands import depths_mm
from pcii.base import Stages, answer_json, command_line, say, say_next, visible
from pcii.store import MARKER, SAMPLE
from simgen.app import commands as simgen_cli


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of the dataset that ships: 5 x 5 views of 96 x 144 with 2000 photons each."""
    out = tmp_path_factory.mktemp("results") / "sample"
    assert command_line.run(pcii_cli.app, ["run", str(SAMPLE), "-o", str(out)]) == 0
    return out


def refusal(app: object, arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The one sentence with which a command refuses bad input."""
    assert command_line.run(app, arguments) == 2  # type: ignore[arg-type]
    message = capsys.readouterr().err.strip()
    assert message.startswith("error: ")
    assert "\n" not in message
    return message


def test_score_json_is_as_in_the_contract(results: Path) -> None:
    score = json.loads((results / "score.json").read_text())
    assert list(score) == ["dataset", "planes", "objects", "depth", "bounds", "readout"]
    keys = "z_mm method object truth iou precision recall f1 boundary_f photon_precision photon_recall"
    for row in score["planes"]:
        assert {*keys.split(), "entropy_before", "entropy_after"} <= set(row)
        assert row["truth"] in ("object", "pixel")
    assert {(row["z_mm"], row["method"]) for row in score["planes"]} == {
        (z, method) for z in (540.0, 620.0) for method in ("three-step", "posterior")
    }
    assert [row["name"] for row in score["objects"]] == ["ball", "bird"]
    contract = ["mae_mm", "median_mm", "bad_1px", "bad_3px", "coverage"]
    assert list(score["depth"])[:5] == contract
    # The objects are textured and 50 000 photons tell their depth to within a tenth of a pixel.
    assert all(0 < row["depth_sigma_px"] < 0.1 for row in score["bounds"]["objects"])


def test_table_1_holds_and_objects_are_found_on_the_sample(results: Path) -> None:
    score = json.loads((results / "score.json").read_text())
    ball, bird = (row["entropy"] for row in score["objects"])
    assert ball["540"] < ball["620"]
    assert bird["620"] < bird["540"]
    # About 0.1 better than this.
    least = {"posterior": 0.85, "three-step": 0.83}
    for row in score["planes"]:
        if row["truth"] == "object":
            assert row["iou"] > least[row["method"]], row


def test_steps_one_by_one_give_the_same_score(results: Path, tmp_path: Path) -> None:
    out, data = str(tmp_path / "steps"), str(SAMPLE)
    for method in ("three-step", "posterior"):
        command = ["segment", data, "--z-mm", "540", "--z-mm", "620", "--method", method, "-o", out]
        assert command_line.run(pcii_cli.app, command) == 0
    assert command_line.run(pcii_cli.app, ["depth", data, "-o", out]) == 0
    assert command_line.run(pcii_cli.app, ["reconstruct", data, "--z-mm", "580", "-o", out]) == 0
    assert command_line.run(pcii_cli.app, ["score", data, out]) == 0
    one, other = (json.loads((Path(d) / "score.json").read_text()) for d in (out, results))
    by_name = [
        sorted(s["planes"], key=lambda row: (row["method"], row["z_mm"], row["truth"])) for s in (one, other)
    ]
    assert by_name[0] == by_name[1]
    assert one["depth"] == other["depth"]
    assert one["bounds"]["objects"] == other["bounds"]["objects"]
    assert (tmp_path / "steps" / "section_580mm.png").is_file()


def test_bad_input_to_simgen_is_refused_in_one_sentence(capsys, tmp_path: Path) -> None:
    recipe, out = tmp_path / "r.toml", tmp_path / "out"
    generate = ["generate", str(recipe), "-o", str(out)]
    for text, message in (('scene = "nowhere"\n', "no scene 'nowhere'"), ("scene = ", "not valid TOML")):
        recipe.write_text(text)
        assert message in refusal(simgen_cli.app, generate, capsys)
    recipe.write_text('scene = "two_objects"\n')
    assert "holds something else" in refusal(simgen_cli.app, [*generate[:3], str(tmp_path)], capsys)
    refusal(simgen_cli.app, ["generate"], capsys)
    refusal(simgen_cli.app, [*generate, "--colour"], capsys)
    assert not out.exists()


def test_bad_input_to_pcii_is_refused_in_one_sentence(capsys, tmp_path: Path) -> None:
    data, out = str(SAMPLE), str(tmp_path / "out")
    message = refusal(pcii_cli.app, ["reconstruct", data, "--subpixel", "1.5", "-o", out], capsys)
    assert "--subpixel: expected a whole number, got '1.5'" in message
    message = refusal(pcii_cli.app, ["run", data, "--z-mm", "540", "--z-mm", "0.62", "-o", out], capsys)
    assert "z_mm: 0.62 mm is so near that no views overlap" in message
    assert "no such dataset" in refusal(pcii_cli.app, ["run", str(tmp_path / "no"), "-o", out], capsys)
    (tmp_path / "thesis.tex").touch()
    assert "holds something else" in refusal(pcii_cli.app, ["run", data, "-o", str(tmp_path)], capsys)
    assert not Path(out).exists()


def test_results_and_datasets_are_verified_by_one_command(results: Path, capsys, tmp_path: Path) -> None:
    for app, folder in itertools.product((simgen_cli.app, pcii_cli.app), (SAMPLE, results)):
        assert command_line.run(app, ["verify", str(folder)]) == 0
        assert "files match the manifest" in capsys.readouterr().out
        assert command_line.run(app, ["verify", str(folder), "--json"]) == 0
        answer = json.loads(capsys.readouterr().out)
        assert (answer["files"] > 10, answer["fault"]) == (True, None)
    broken = tmp_path / "broken"
    shutil.copytree(results, broken)
    (broken / "report.html").write_text("<p>better figures</p>")
    for app in (simgen_cli.app, pcii_cli.app):
        assert command_line.run(app, ["verify", str(broken)]) == 2
        last = capsys.readouterr().err.splitlines()[-1]  # progress comes before
        assert last.startswith(f"error: {broken / 'report.html'}: truncated or changed")
        assert command_line.run(app, ["verify", str(broken), "--json"]) == 2
        answer = json.loads(capsys.readouterr().out)
        assert answer["files"] is None
        assert f"{broken / 'report.html'}: truncated or changed" in answer["fault"]
    assert "no such" in refusal(pcii_cli.app, ["verify", str(tmp_path / "nowhere")], capsys)


@pytest.mark.renders
def test_results_are_of_one_light(nested_dataset: Path, capsys, tmp_path: Path) -> None:
    data, totals = str(nested_dataset), []
    for budget in ([], ["--budget", "400"], ["--budget", "120"], ["--budget", "30"]):
        out = tmp_path / "-".join(["out", *budget[1:]])
        command = ["reconstruct", data, "--z-mm", "580", "-o", str(out), *budget]
        assert command_line.run(pcii_cli.app, command) == 0
        group = zarr.open_group(out / "sections.zarr", mode="r")
        totals.append(int(np.asarray(group["counts"]).sum()))
    assert totals[0] == totals[1]
    # Of 6 views of 64 x 60 pixels with 0.01 dark counts each; at 580 mm some fall beside the section.
    full = [6 * budget + 6 * 64 * 60 * 0.01 for budget in (400, 120, 30)]
    assert all(0.6 * most < total < 1.1 * most for total, most in zip(totals[1:], full, strict=True))
    command = ["depth", data, "-o", str(tmp_path / "depth"), "--budget"]
    assert command_line.run(pcii_cli.app, [*command, "120"]) == 0
    capsys.readouterr()
    assert "of another dataset or light" in refusal(pcii_cli.app, [*command, "30"], capsys)
    assert "there are 30, 120, 400" in refusal(pcii_cli.app, [*command, "31"], capsys)


@pytest.mark.parametrize("app", [simgen_cli.app, pcii_cli.app])
def test_help_of_every_command_has_examples_that_can_be_typed(app: App, capsys, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    commands = [[name] for name in app if not name.startswith("-")]
    commands += [[name, inner] for (name,) in commands for inner in app[name] if not inner.startswith("-")]
    for command in commands:
        assert command_line.run(app, [*command, "--help"]) == 0
        page = re.sub(r" *\\ *\n *", " ", capsys.readouterr().out)
        for noise in ("--no-", "--empty-", "[default: ()]", "[default: False]", "\x1b"):
            assert noise not in page, command
        examples = re.findall(rf"^ *{app.name[0]} ({command[0]} .*?) *$", page, re.MULTILINE)
        assert examples, command
        for example in examples:
            app.parse_args(shlex.split(example.split(" > ")[0]), exit_on_error=False, print_error=False)


@pytest.mark.renders
def test_doctor_and_schema_answer(capsys: pytest.CaptureFixture[str]) -> None:
    for command, answer in (
        ("doctor", "Rendering will run with"),
        ("schema scene", '"additionalProperties": false'),
        ("schema recipe", '"additionalProperties": false'),
    ):
        assert command_line.run(simgen_cli.app, command.split()) == 0
        assert answer in capsys.readouterr().out


@pytest.mark.renders
def test_export_writes_the_photons_of_a_budget(nested_dataset: Path, tmp_path: Path) -> None:
    command = ["export", str(nested_dataset), "--format", "events", "-o", str(tmp_path / "out")]
    assert command_line.run(simgen_cli.app, [*command, "--budget", "30"]) == 0
    with np.load(tmp_path / "out" / "events.npz") as arrays:
        total = int(arrays["n"].sum())
        assert arrays["photon_z_mm"].shape == (total,)
    # 6 views of 30 photons and 64 x 60 pixels of 0.01 dark counts: 410 counts, give or take 20.
    assert abs(total - 410) < 100


ON = "stopped; the same command goes on from here"


@pytest.mark.renders
def test_a_stopped_generate_says_so_and_goes_on(tmp_path: Path) -> None:
    out = tmp_path / "small"
    # A process that heeds Ctrl-C, whoever started this one.
    script = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
    script += "from simgen.app.commands import main; sys.exit(main())"
    settings = ["--set", "render.samples_per_pixel=4", "--set", "grid.rows=2", "--set", "grid.cols=3"]
    command = ["generate", "small", "-o", str(out), *settings]
    process = subprocess.Popen([sys.executable, "-c", script, *command], stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 120
    while not (out / "radiance" / "view_00_01.exr").exists():
        assert time.monotonic() < end
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors.splitlines()[-1]) == (130, ON)
    assert "Traceback" not in errors
    assert command_line.run(simgen_cli.app, command) == 0
    assert command_line.run(simgen_cli.app, ["verify", str(out)]) == 0


@pytest.mark.parametrize(("resuming", "sentence"), [(["work"], ON), ([], "stopped")])
def test_a_stop_that_became_another_exception_is_a_stop(resuming: list[str], sentence: str, capsys) -> None:
    app = command_line.command_app("works", "Works.")

    @app.command
    def work() -> None:
        try:
            os.kill(os.getpid(), signal.SIGINT)
        except KeyboardInterrupt:
            raise RuntimeError("as Dr.Jit raises it") from None

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    assert command_line.run(app, ["work"], resuming=resuming) == 130
    assert signal.signal(signal.SIGINT, before) is signal.default_int_handler
    assert capsys.readouterr().err == f"{sentence}\n"


@pytest.mark.parametrize("verb", ["run", "evaluate", "verify"])
def test_an_unfinished_dataset_is_named_with_the_command_that_goes_on(
    verb: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    begun, out = tmp_path / "sets" / "begun", tmp_path / "out"
    begun.mkdir(parents=True)
    (begun / MARKER).write_text("{}")
    named = begun.parent if verb == "evaluate" else begun
    more = [] if verb == "verify" else ["-o", str(out)]
    assert command_line.run(pcii_cli.app, [verb, str(named), *more]) == 2
    sentence = "unfinished; the same `simgen generate` command goes on from here"
    assert capsys.readouterr().err == f"error: {begun}: {sentence}\n"
    assert not out.exists()


def test_depths_as_they_are_typed() -> None:
    assert len(depths_mm("500:501:0.1")) == 11  # 0.1 is not exact in binary
    for wrong in ("500:700", "700:500:20", "500:700:0", "a:b:c", "1:2:1e-9"):
        with pytest.raises(ValueError, match=r"start:stop:step|larger step"):
            depths_mm(wrong)


def test_control_characters_in_names_do_not_reach_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    app = command_line.command_app("works", "Works.")

    @app.command
    def fail(name: str) -> None:
        answer_json({name: 1})
        say(f"object {name}")
        with Stages() as report:
            report(name, 1, 1)
        raise RuntimeError(name)

    for name in NAMES:
        assert command_line.run(app, ["fail", "--", name]) == 1
        printed = capsys.readouterr()
        lines = (printed.out + printed.err).split("\n")
        assert [visible(line) for line in lines] == lines
        assert json.JSONDecoder().raw_decode(printed.out)[0] == {name: 1}


def test_a_terminal_has_bars_and_the_command_to_type_next(capsys, monkeypatch) -> None:
    for stream in ("stdout", "stderr"):
        monkeypatch.setattr(f"sys.{stream}.isatty", lambda: True)
    with Stages() as report:
        for done in (0, 2):
            report("[red] rows", done, 3)
    say_next("pcii", "run", "a file")
    printed = capsys.readouterr()
    assert "[red] rows" in printed.err
    assert "2/3" in printed.err
    assert printed.out == "next:  pcii run 'a file'\n"
