"""report.html in headless Chromium: the slider, its toggles, and nothing fetched or cut off."""

from collections.abc import Iterator

import pytest
from chromium import CHROMIUM, Page, browser_page
from report_outcomes import Written

from pcii.app.pipeline import Outcome
from pcii.app.report_pictures import Pictures

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


def test_the_slider_moves_through_the_depths(browser: Page, full: Outcome) -> None:
    photons = f"photon counts, smoothed by {Pictures.of(full).smoothing_px:g} px"
    assert browser.value(SHOWN) == [f"section at 500 mm, {photons}"]
    browser.click("#plane")  # the middle
    middle = browser.text("#depth-shown")
    assert browser.value(SHOWN) == [f"section at {middle}, {photons}"]
    browser.press_right()
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
    browser.press_right()
    between = browser.text("#depth-shown")
    browser.click('input[name="points"][value="1"]')
    assert browser.text("#depth-shown") in ("500 mm", "700 mm")
    assert browser.value("document.querySelector('#plane').max") == "1"
    browser.click('input[name="points"][value="all"]')
    assert browser.text("#depth-shown") == between
    assert not browser.faults


@pytest.mark.parametrize(("name", "width"), [("full", 1200), ("full", 400), ("counts", 400), ("light", 1200)])
def test_nothing_is_fetched_logged_or_cut_off(
    browser: Page, reports: dict[str, Written], name: str, width: int
) -> None:
    browser.requests.clear()
    browser.open(reports[name].path, width)
    assert not browser.faults
    fetched = [url for url in browser.requests if not url.startswith("data:")]
    assert set(fetched) == {reports[name].path.as_uri()}
    assert browser.value("document.documentElement.scrollWidth") <= width
    # Tables that are too wide scroll in their own box.
    wide = "[...document.querySelectorAll('.wide')].every(d => d.getBoundingClientRect().right <= innerWidth)"
    assert browser.value(wide)
    assert "NaN" not in browser.value("document.body.innerText")
