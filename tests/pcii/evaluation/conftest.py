import pytest


@pytest.fixture(autouse=True)
def without_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each chart of a page takes half a second: those of what a module makes once are drawn."""
    page = "pcii.evaluation.evaluation_page"
    monkeypatch.setattr(f"{page}.accuracy_chart", lambda *_, **__: None)
    monkeypatch.setattr(f"{page}.figure_uri", lambda _: "data:image/png;base64,")
