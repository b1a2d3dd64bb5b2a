"""Named tuples whose fields are columns (N, ...) of one table, with an element for each of its rows."""

from collections.abc import Sequence
from typing import NamedTuple, TypeVar

import numpy as np

Table = TypeVar("Table", bound=NamedTuple)


def take_rows(table: Table, which: np.ndarray | slice) -> Table:
    """Some rows, by mask, index or slice."""
    return table._make(column[which] for column in table)


def join_rows(tables: Sequence[Table]) -> Table:
    """The rows of all tables, one after the other."""
    return tables[0]._make(map(np.concatenate, zip(*tables, strict=True)))
