import pytest


@pytest.fixture(autouse=True)
def without_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each plot of a page takes half a second: those of what a module makes once are drawn."""
    monkeypatch.setattr("pcii.evaluation.evaluation_page.figure_uri", lambda _: "data:image/png;base64,")
