"""report.html in headless Chromium: the slider, and nothing fetched, logged or cut off."""

import base64
import hashlib
import html
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from report_outcomes import Written

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
pytestmark = [pytest.mark.slow, pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")]
LOOK = """
const faults = [], all = (selector) => [...document.querySelectorAll(selector)];
for (const kind of ["error", "securitypolicyviolation"])
    addEventListener(kind, (event) => faults.push(event.message || event.blockedURI), true);
function look() {
    const slider = document.querySelector("#plane"), states = [];
    for (let value = 0; slider && value <= slider.max; value++) {
        slider.value = value;
        slider.dispatchEvent(new Event("input", {bubbles: true}));
        states.push([all("#look .frame img").filter((image) => !image.hidden).map((image) => image.alt),
            document.querySelector("#depth-shown").textContent, slider.getAttribute("aria-valuetext")]);
    }
    const fetched = performance.getEntriesByType("resource").map((entry) => entry.name);
    return {states, faults, fetched: fetched.filter((name) => !name.startsWith("data:")),
        text: document.body.innerText, overflow_px: document.documentElement.scrollWidth - innerWidth,
        wide: all(".wide").every((box) => box.getBoundingClientRect().right <= innerWidth)};
}
addEventListener("load", () => { document.title = JSON.stringify(look()); });
"""


def look_at(page: str, width: int, folder: Path) -> dict[str, Any]:
    """What `LOOK` finds on a copy of the page, whose policy names it beside the page's own script."""
    own = base64.b64encode(hashlib.sha256(LOOK.encode()).digest()).decode()
    policy = page.replace("script-src '", f"script-src 'sha256-{own}' '", 1)
    copy = folder / "report.html"
    copy.write_text(policy.replace("<title>", f"<script>{LOOK}</script><title>", 1), encoding="utf-8")
    command = [str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", f"--window-size={width},1000"]
    command += [f"--user-data-dir={folder / 'profile'}", "--dump-dom", copy.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    (title,) = re.findall("<title>(.*?)</title>", done.stdout, re.DOTALL)
    return json.loads(html.unescape(title))


@pytest.mark.parametrize(("name", "width"), [("full", 1200), ("full", 500), ("counts", 500), ("light", 1200)])
def test_the_slider_moves_and_nothing_is_fetched_logged_or_cut_off(
    reports: dict[str, Written], name: str, width: int, tmp_path: Path
) -> None:
    seen = look_at(reports[name].page, width, tmp_path)
    assert (seen["faults"], seen["fetched"], seen["wide"]) == ([], [], True)
    assert seen["overflow_px"] <= 0
    assert "NaN" not in seen["text"]
    depths = [float(text.split()[0]) for _, text, _ in seen["states"]]
    assert len(depths) > 2
    assert depths == sorted(set(depths))
    assert all(images == [text] and text == spoken for images, text, spoken in seen["states"])
