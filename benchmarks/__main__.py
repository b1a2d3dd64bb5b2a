"""The command behind `make bench`: run studies, compare their ratios, publish the page."""

import argparse
import json
import sys
import time
from datetime import UTC, datetime
from pathlib import Path

from benchmarks import paper_scene
from benchmarks.guard import REFERENCE, losses, reference_of
from benchmarks.machine import commit, in_words, machine, versions, was_busy
from benchmarks.page import table_markdown, tables_of, write_page
from benchmarks.quoted import add, add_benchmark, add_study, read_figures, write_figures
from benchmarks.results import Record, Size, Study, read_record, write_record
from benchmarks.studies import STUDIES
from pcii.base import InputError, write_json_safely

PAGE = Path(__file__).resolve().parent.parent / "docs" / "benchmarks.md"


def main() -> int:
    """Run the command line; gives the exit code: 1 for a lost ratio, 2 for bad input."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    studies = {study.name: study for study in STUDIES}
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"{', '.join(studies)}; guard; publish")
    parser.add_argument("--full", action="store_true", help="full size: hours instead of minutes")
    parser.add_argument("--out", type=Path, default=Path("out/bench"), help="folder of results (%(default)s)")
    options = parser.parse_args()
    try:
        if options.names == ["guard"]:
            return guard(options.out)
        if options.names == ["publish"]:
            return publish(options.out)
        for name in options.names:
            if name not in studies:
                raise InputError(f"NAME: there is no study named {name!r}; use {', '.join(studies)}")
        for name in options.names or studies:
            measure(studies[name], "full" if options.full else "quick", options.out)
        write_page(options.out / PAGE.name, STUDIES, records_in(options.out))
        print(f"The page is {options.out / PAGE.name}.")
    except InputError as fault:
        print(f"error: {fault}", file=sys.stderr)
        return 2
    return 0


def measure(study: Study, size: Size, out: Path) -> Record:
    """Run one study and write its results; print its tables as Markdown."""
    print(f"{study.title} ({study.name}, {size}) ...", flush=True)
    place, start = machine(), time.perf_counter()
    if was_busy(place):
        print(f"{place['cores_in_use']} cores are in use by others: seconds will be too long", flush=True)
    date = datetime.now(UTC).isoformat(timespec="seconds")
    measured = study.measure(**study.sizes[size])
    record = Record(study.name, size, date, time.perf_counter() - start, place, versions(), measured)
    write_record(out, record)
    for title, table in tables_of(measured.rows).items():
        print(f"\n{title}\n\n{table_markdown(table)}", flush=True)
    print(f"\n{study.reading(measured)}\n", flush=True)
    return record


def records_in(out: Path) -> list[Record]:
    """Records of all studies that have run; `InputError` if none has."""
    paths = [out / f"{study.name}.json" for study in STUDIES]
    records = [read_record(path) for path in paths if path.is_file()]
    if not records:
        raise InputError(f"{out}: there are no results of studies; make them by `make bench`")
    return records


def guard(out: Path) -> int:
    """Compare the ratios of the results with the committed table; 1 if one was lost."""
    records, reference = records_in(out), json.loads(REFERENCE.read_text(encoding="utf-8"))
    for record in records:
        entry = reference.get(record.study)
        if entry is not None and entry["size"] != record.size:
            print(f"{record.study}: is of {record.size} size, and the table of {entry['size']}; not compared")
    lost = losses(records, reference)
    for sentence in lost:
        print(f"lost: {sentence}")
    if not lost:
        print("no ratio has lost more than 25 %")
    return 1 if lost else 0


def publish(out: Path) -> int:
    """Write the page of the guide, the table of ratios and the figures that pages quote from the results.

    What is missing of the paper's scene is measured; submissions to the benchmark are read beside the folder.
    """
    records = records_in(out)
    content = read_figures()
    for record in records:
        add_study(content, record)
    place = {"machine": in_words(machine()), "date": f"{datetime.now(UTC):%Y-%m-%d}", "commit": commit()}
    command = {"command": f"python -m benchmarks publish, {paper_scene.SEEDS} draws of photons"}
    add(content, "paper", command | place, paper_scene.measure(out / paper_scene.FOLDER))
    add_benchmark(content, out.parent / "submissions")
    write_page(PAGE, STUDIES, records)
    write_json_safely(REFERENCE, reference_of(records))
    write_figures(content)
    print(f"wrote {PAGE.name}, its figures, those of all pages, and the reference of the guard")
    return 0


if __name__ == "__main__":
    sys.exit(main())
