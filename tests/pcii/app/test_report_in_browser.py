"""report.html in headless Chromium: the slider, and nothing fetched or cut off."""

from collections.abc import Iterator

import pytest
from chromium import CHROMIUM, Page, browser_page
from report_outcomes import Written

pytestmark = [pytest.mark.slow, pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")]
SHOWN = "[...document.querySelectorAll('#look .frame img')].filter(i => !i.hidden).map(i => i.alt)"


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    with browser_page(tmp_path_factory.mktemp("browser") / "profile") as page:
        yield page


def test_the_slider_moves_through_the_depths(browser: Page, reports: dict[str, Written]) -> None:
    browser.open(reports["full"].path)
    assert browser.value(SHOWN) == [browser.text("#depth-shown")]
    browser.click("#plane")  # between the two in the middle of four
    middle = browser.text("#depth-shown")
    assert browser.value(SHOWN) == [middle]
    browser.press_right()
    after = browser.text("#depth-shown")
    assert browser.value(SHOWN) == [after]
    assert float(after.split()[0]) > float(middle.split()[0])
    assert browser.value("document.querySelector('#plane').getAttribute('aria-valuetext')") == after
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
