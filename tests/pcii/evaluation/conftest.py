import pytest


@pytest.fixture(autouse=True)
def without_plots(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each plot of a page takes half a second: those of what a module makes once are drawn."""
    target = "pcii.evaluation.evaluation_page.figure_uri"
    monkeypatch.setattr(target, lambda *_: "data:image/png;base64,")
