"""report.html in headless Chromium: slider, toggles, and a read-out that says what the arrays say."""

from collections.abc import Iterator

import numpy as np
import pytest
from chromium import CHROMIUM, Page, browser_page
from report_outcomes import COUNTS, FOUND, IDS, TRUTH, Written

from pcii.app.pipeline import Outcome
from pcii.app.report_pictures import Pictures
from pcii.sections.reconstruction import reconstruct

pytestmark = [pytest.mark.slow, pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")]
SHOWN = "[...document.querySelectorAll('#look .frame img')].filter(i => !i.hidden).map(i => i.alt)"


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    with browser_page(tmp_path_factory.mktemp("browser") / "profile") as page:
        yield page


@pytest.fixture
def full(browser: Page, reports: dict[str, Written]) -> Outcome:
    """The report with everything is open."""
    browser.open(reports["full"].path)
    return reports["full"].outcome


def read(browser: Page, name: str) -> str:
    return browser.text(f'.readout [data-read="{name}"]')


def test_the_slider_moves_through_the_depths(browser: Page, full: Outcome) -> None:
    photons = f"photon counts, smoothed by {Pictures.of(full).smoothing_px:g} px"
    assert browser.value(SHOWN) == [f"section at 500 mm, {photons}"]
    browser.click("#plane")  # the middle
    middle = browser.text("#depth-shown")
    assert browser.value(SHOWN) == [f"section at {middle}, {photons}"]
    browser.press("ArrowRight")
    after = browser.text("#depth-shown")
    assert float(after.split()[0]) > float(middle.split()[0])
    assert browser.value("document.querySelector('#plane').getAttribute('aria-valuetext')") == after
    assert browser.text("#shown") == f"section at {after}, {photons}"
    for place, depth in (("first", "500 mm"), ("last", "700 mm")):
        browser.click(f".jumps button:{place}-of-type")
        assert browser.text("#depth-shown") == browser.text('[aria-pressed="true"]') == depth
    assert not browser.faults


def test_toggles_change_light_points_and_comparison(browser: Page, full: Outcome) -> None:
    browser.click('input[name="light"][value="1"]')
    assert browser.value(SHOWN) == ["section at 500 mm, photon counts as they are"]
    browser.click('input[name="light"][value="2"]')
    assert browser.value(SHOWN) == ["section at 500 mm, full light"]
    browser.click('input[name="points"][value="0"]')
    assert browser.value(SHOWN) == ["section at 500 mm, full light", "kept by by hand"]
    browser.click("#compare")
    assert browser.value(SHOWN)[1:] == ["kept by by hand, compared with the truth"]
    # The truth has nothing to be compared with.
    browser.click('input[name="points"][value="1"]')
    assert browser.value(SHOWN)[1:] == ["in focus in truth"]
    assert browser.value("document.querySelector('#compare').disabled")
    # Masks are known at two planes only, and the plane before is found again.
    browser.click('input[name="points"][value="all"]')
    browser.click("#plane")
    browser.press("ArrowRight")
    between = browser.text("#depth-shown")
    browser.click('input[name="points"][value="1"]')
    assert browser.text("#depth-shown") in ("500 mm", "700 mm")
    assert browser.value("document.querySelector('#plane').max") == "1"
    browser.click('input[name="points"][value="all"]')
    assert browser.text("#depth-shown") == between
    assert not browser.faults


def test_the_read_out_says_what_the_arrays_say(browser: Page, full: Outcome) -> None:
    photons = reconstruct(COUNTS, 500).counts[0].sum(axis=-1)
    for row, col in ((20, 14), (20, 34), (5, 3), (39, 47), (0, 0)):
        browser.point("#look .frame", (col + 0.5) / 48, (row + 0.5) / 40)
        assert read(browser, "pixel") == f"{row}, {col}"
        assert read(browser, "counts") == str(photons[row, col])
        if IDS[row, col]:
            assert float(read(browser, "estimate").split()[0]) == pytest.approx(FOUND[row, col], abs=0.01)
            assert float(read(browser, "truth").split()[0]) == pytest.approx(TRUTH.z_mm[row, col], abs=0.01)
            error = float(read(browser, "error").replace("−", "-").split()[0])
            assert error == pytest.approx(FOUND[row, col] - TRUTH.z_mm[row, col], abs=0.02)
            assert read(browser, "confidence") == "0.75"
            assert read(browser, "object") == TRUTH.names[int(IDS[row, col])]
        else:
            assert (read(browser, "estimate"), read(browser, "truth")) == ("none", "nothing there")
            assert (read(browser, "error"), read(browser, "object")) == ("–", "none")


def test_the_cross_hair_moves_by_keys_on_every_picture(browser: Page, full: Outcome) -> None:
    browser.value("document.querySelectorAll('.frame')[2].focus()")
    browser.press("ArrowRight")
    browser.press("ArrowDown", shift=True)
    assert read(browser, "pixel") == "30, 25"
    said = browser.text("#said")
    assert said.startswith("row, column 30, 25; estimated depth")
    crosses = "[...document.querySelectorAll('.frame i')].map(i => [i.hidden, i.style.left])"
    assert np.unique(browser.value(crosses), axis=0).tolist() == [["False", "53.125%"]]
    for _ in range(3):
        browser.press("ArrowDown", shift=True)
    assert read(browser, "pixel") == "39, 25"  # the border


@pytest.mark.parametrize(("name", "width"), [("full", 1200), ("full", 400), ("counts", 400), ("light", 1200)])
def test_nothing_is_fetched_logged_or_cut_off(
    browser: Page, reports: dict[str, Written], name: str, width: int
) -> None:
    browser.requests.clear()
    browser.open(reports[name].path, width)
    browser.point("#look .frame")
    assert read(browser, "pixel") != "–"
    assert not browser.faults
    fetched = [url for url in browser.requests if not url.startswith("data:")]
    assert set(fetched) == {reports[name].path.as_uri()}
    assert browser.value("document.documentElement.scrollWidth") <= width
    # Tables that are too wide scroll in their own box.
    wide = "[...document.querySelectorAll('.wide')].every(d => d.getBoundingClientRect().right <= innerWidth)"
    assert browser.value(wide)
    assert "NaN" not in browser.value("document.body.innerText")
