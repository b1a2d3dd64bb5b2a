"""Terms of publication, as a recipe states them."""

from typing import Annotated

from pydantic import Field

from pcii.exporting.publication_terms import Terms
from simgen.base.strict_models import Strict, Title


class Publication(Strict):
    """Terms under which the data may be used. Only the dataset's card says them: no data depend on them."""

    licence: Annotated[Title, Field(min_length=1)] = Terms.licence
    """Name of a licence in the SPDX list, such as "CC-BY-4.0", or the URL of another one."""
    creators: Annotated[tuple[Title, ...], Field(min_length=1)] = Terms.creators
    """Who made the data."""
    citation: Title = Terms.citation
    """How to cite the data."""
    url: Title = ""
    """Where the data are."""

    def terms(self) -> Terms:
        """The same as the type that cards are written with."""
        return Terms(**self.model_dump())
