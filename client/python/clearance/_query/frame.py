"""Results as tables of pandas and Arrow. Each is imported by its call only."""

from __future__ import annotations

from typing import Any, Callable

import numpy as np

from .._names import names_of
from .._words import BY_JOINT, Field, Reduce, Status

#: Suffixes of the numbers of a row, by their count or the column's name; otherwise from 0 on.
_SUFFIXES = {"bounds": ("lower", "upper"), "pieces": ("a", "b"), "first_contact": ("free_until", "hit"), 3: "xyz"}


#: Makes a column of words from their numbers and all words.
_Labelled = Callable[[np.ndarray, list[str]], Any]


def data_frame(result: Any) -> Any:
    """Implements to_pandas() of a Result."""
    import pandas

    return pandas.DataFrame(_table(result, pandas.Categorical.from_codes))


def arrow_table(result: Any) -> Any:
    """Implements to_arrow() of a Result."""
    import pyarrow

    return pyarrow.table(_table(result, pyarrow.DictionaryArray.from_arrays))


def _table(result: Any, labelled: _Labelled) -> dict[str, Any]:
    """Returns the columns of a table, by name."""
    has_pairs = result._reduce == Reduce.NONE or bool(result.fields & Field.PAIR)
    rows = result._answer.rows
    if result._reduce == Reduce.WITHIN:
        configuration = result.configuration
    else:
        k = result.configurations
        configuration = np.repeat(np.arange(k, dtype=np.uint32), rows // k if k else 0)
    table: dict[str, Any] = {"configuration": configuration}
    if has_pairs:
        pairs = result.pairs
        if result._reduce == Reduce.NONE:
            pairs = np.broadcast_to(pairs, (result.configurations, *pairs.shape))
        bodies = names_of(pairs.reshape(-1, 2), result.names)
        table.update(body_a=bodies[:, 0], body_b=bodies[:, 1])
    for name, column in result.columns.items():
        if name not in ("pair", "configuration"):
            table.update(_series(name, column, rows, result.names, labelled))
    return table


def _series(name: str, column: np.ndarray, rows: int, names: tuple[str, ...], labelled: _Labelled) -> dict[str, Any]:
    """Splits a column into one for each number of a row."""
    if name in ("status", "verdict"):
        labels = [status.name for status in Status]
        return {name: labelled(column.reshape(-1), labels)}
    if name == "pair_lower":
        lower = names_of(column.reshape(-1, 2), names)
        return {"lower_body_a": lower[:, 0], "lower_body_b": lower[:, 1]}
    flat = column.reshape(rows, -1)
    width = flat.shape[1]
    if width == 1 and name not in BY_JOINT:
        return {name: flat[:, 0]}
    suffixes = _SUFFIXES.get(name) or _SUFFIXES.get(width) or range(width)
    return {f"{name}_{suffix}": flat[:, i] for i, suffix in enumerate(suffixes)}
