"""Pages: HTML made from templates, whose content is escaped as text, and the files of an evaluation.

A page fetches nothing and runs nothing, or the one script that comes with its template, which its policy
names by hash.
"""

import base64
import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pcii.base.plain_text import visible
from pcii.base.safe_files import sweep_temporaries, write_bytes_safely
from pcii.evaluation.curves import AXES, accuracy_plot, calibration_plot
from pcii.evaluation.summary import means, over_scenes, with_yardsticks
from pcii.evaluation.tables import NOT_BETTER, TITLES, Table, tables_of
from pcii.store.folders import EVALUATION_FOLDER, ROWS, hash_file, list_files

if TYPE_CHECKING:
    from pandas import DataFrame

ABOUT_YARDSTICKS = (
    "Three look at no photon: (nothing) claims nothing and answers nowhere, (everything) claims the whole "
    "film at every plane, and (one depth) answers the depth that is right for most pixels, which only the "
    "truth tells. Sweeps are the simplest methods of depth. "
    f"{NOT_BETTER}: no better than the best of all these for the same scene and light."
)
NOTES = (
    "IoU compares masks with the objects that belong to each plane, and is a mean over planes that hold any. "
    "What leans through the depths belongs to no plane: it counts in the IoU of pixels, and in depth. In "
    "brackets: 95 % interval of the mean over seeds by Student's t, clipped to [0, 1] for shares, and of the "
    "logarithm of the mean for seconds and other values that are never negative.",
    "In bold: the best mean of the same scene and photons. Others may be as good: see the interval of the "
    "difference.",
    "p: two-sided sign-flip permutation test on the same datasets, without correction for multiple "
    "comparisons. Of n pairs it cannot be less than 2 / 2^n, so fewer than six never give 0.05.",
    "Over several scenes every scene counts once, as the mean over its seeds. Ranks are of the scenes and "
    "seeds that all methods have; their intervals and p are of the spread between scenes.",
    ABOUT_YARDSTICKS,
    "Depth: shares are of the objects' pixels, within 1 or 3 px of total disparity, and a missing answer is "
    "a wrong one, in the median too. Quadratic score: share within 1 px minus the Brier score of confidence; "
    "0 is who never answers, 1 who is always right and sure. Bound: the least standard deviation of the "
    "depth of an object as a whole (Cramér-Rao), median of the objects. ECE: how far confidence and the "
    "share of depths within 1 px are apart on average, over all answered pixels.",
)


def page(template: str, content: dict[str, Any], script: str | None = None) -> bytes:
    """A page in UTF-8 from a file in `templates`; it is an error if `content` lacks a name.

    `script` is a file there, and the only script that browsers run in the page: no content can be one.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    def as_visible_text(value: object) -> object:
        return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value

    loader = PackageLoader("pcii.evaluation")
    environment = Environment(
        loader=loader,
        autoescape=True,
        undefined=StrictUndefined,
        finalize=as_visible_text,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    own: dict[str, Any] = {"script": None}
    if script is not None:
        text = loader.get_source(environment, script)[0]
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")
        own = {"script": Markup(text), "script_hash": Markup(f"'sha256-{digest}'")}
    return environment.get_template(template).render(content, **own).encode()


def write_evaluation(
    out: Path, frame: "DataFrame", origin: Mapping[str, Any], others: Sequence[str] = ()
) -> None:
    """Write evaluation.html, means.csv and, last, evaluation.json with their hashes.

    `others` are further files to list. The caller keeps others from adding rows meanwhile.
    """
    sweep_temporaries(out)
    frame = with_yardsticks(frame)
    of_cells = means(frame)
    differing = ", ".join(origin["differing"])
    warning = f"Not all rows are of the same software ({differing}): name all datasets and methods again."
    content = {
        "warnings": [warning] if differing else [],
        "notes": NOTES,
        "plots": _plots(over_scenes(of_cells)),
        "tables": list(tables_of(frame, of_cells)),
        "origin": _origin_table(origin, hash_file(out / ROWS)),
    }
    files = {
        "evaluation.html": page("evaluation.html.j2", content),
        "means.csv": of_cells.to_csv(index=False).encode(),
    }
    for name, text in files.items():
        write_bytes_safely(out / name, text)
    EVALUATION_FOLDER.write(out, {**origin, "files": list_files(out, [ROWS, *files, *others])})


def _plots(table: "DataFrame") -> list[tuple[str, str]]:
    """Pictures of means by method and light, with what they show in words."""
    plots: list[tuple[str, str]] = []
    methods: list[str] = []
    for measure in TITLES:
        methods = sorted(table["method"][table["measure"] == measure].unique())
        plots.append((accuracy_plot(table, methods, measure), f"{AXES[measure]} against photons and time"))
    plots.append((calibration_plot(table, methods), "share of correct depths against confidence, by light"))
    return [(image, text) for image, text in plots if image]


def _origin_table(origin: Mapping[str, Any], rows_sha256: str) -> Table:
    """What an evaluation was made by; `rows_sha256` is that of its rows.jsonl."""
    rows = [
        ("measured", " to ".join(dict.fromkeys(origin["days"]))),
        ("machine", _counted(origin["machines"])),
        *((name, _counted(numbers)) for name, numbers in origin["software"].items()),
        ("SHA-256 of rows.jsonl", rows_sha256),
    ]
    return Table("How this was made", ("what", "value"), tuple(row for row in rows if row[1]), words=2)


def _counted(rows_by_text: Mapping[str, int]) -> str:
    """Texts, with the number of rows of each where they are several."""
    if len(rows_by_text) == 1:
        return next(iter(rows_by_text))
    return "; ".join(f"{text} ({rows} rows)" for text, rows in rows_by_text.items())
