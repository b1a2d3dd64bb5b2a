"""Under what terms a dataset is published, and who made it: what its card says and its data do not."""

from dataclasses import dataclass

PROJECT = "photon-integral-imaging"
LICENCE = "BSD-3-Clause"
"""Licence of this software and of the scenes that come with it, and of data unless another one is named."""
CREATOR = "The photon-integral-imaging authors"
CITATION = (
    "Photon-starved integral imaging: physically based data, reconstruction and defocus removal "
    f"({PROJECT}). {CREATOR}."
)
"""As CITATION.cff has it."""


@dataclass(frozen=True)
class Terms:
    """Licence, a name of the SPDX list or a URL; who made the data; how to cite them; where they are."""

    licence: str = LICENCE
    creators: tuple[str, ...] = (CREATOR,)
    citation: str = CITATION
    url: str = ""

    @property
    def licence_url(self) -> str:
        """Where the licence can be read.

        >>> Terms("CC-BY-4.0").licence_url
        'https://spdx.org/licenses/CC-BY-4.0.html'
        """
        return self.licence if "://" in self.licence else f"https://spdx.org/licenses/{self.licence}.html"
