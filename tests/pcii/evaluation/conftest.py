import pytest


@pytest.fixture(autouse=True)
def without_plots(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each plot of a page takes half a second: those of what a module makes once are drawn."""
    for name in ("accuracy_plot", "_calibration_plot"):
        monkeypatch.setattr(f"pcii.evaluation.evaluation_page.{name}", lambda *_: "data:image/png;base64,")
