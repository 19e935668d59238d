"""Results of queries: columns as numpy arrays."""

from __future__ import annotations

from typing import Any, Optional, Protocol

import numpy as np

from .._arguments import did_you_mean
from .._names import names_of
from .._words import BY_JOINT, COLUMNS, FIELD_MASKS, KNOWN_FIELDS, Field, Reduce, Status, row_shape
from .attributes import AnswerAttribute, ColumnAttribute

_ROWS_ALONE = frozenset(int(reduce) for reduce in (Reduce.WITHIN, Reduce.MIN, Reduce.ANY))  # (R,) or (K,)


#: Members of Result that describe it, in addition to the columns.
_NUMBERS = ("fields", "rows", "total", "configurations", "pairs", "joints", "scene_revision",
            "snapshot_revision", "snapshot_stamp_ns", "snapshot_sequence", "pose_age_ns", "engine_ns", "server_ns",
            "backend")  # fmt: skip


class PairSource(Protocol):
    """The members of a query that a result uses."""

    @property
    def k(self) -> int: ...
    def pairs_at(self, revision: int) -> np.ndarray: ...
    def body_names(self) -> tuple[str, ...]: ...


class Result:
    """The answer to one query.

    The columns' shapes begin with (K, P) for reduce="none", (K, N) for "nearest", (K,) for "min" and "any" and (R,) for
    "within", where K counts configurations (1 without), P pairs, N bodies (min(k, P) with `k`) and R the pairs found.
    Metres, world frame.
    A column that was not requested raises AttributeError. Columns are created on first access, over memory that is
    reused once all of them are gone. Can be pickled.

    The bounds are certified: the exact distance of the stored convex parts at the given poses lies in [lower, upper].
    """

    distance: np.ndarray = ColumnAttribute("float64: upper if apart, 0 or lower if overlapping; NaN for a bad pose")  # type: ignore[assignment]
    lower: np.ndarray = ColumnAttribute("float64: certified lower bound; -inf for a bad pose")  # type: ignore[assignment]
    upper: np.ndarray = ColumnAttribute("float64: certified upper bound; +inf for a bad pose")  # type: ignore[assignment]
    status: np.ndarray = ColumnAttribute("uint8: values of clearance.Status")  # type: ignore[assignment]
    flags: np.ndarray = ColumnAttribute("uint16: bits of clearance.Flag")  # type: ignore[assignment]
    point_a: np.ndarray = ColumnAttribute("(..., 3) float64: witness point on a, world frame; NaN where there is none")  # type: ignore[assignment]
    point_b: np.ndarray = ColumnAttribute("(..., 3) float64: witness point on b, world frame; NaN where there is none")  # type: ignore[assignment]
    normal: np.ndarray = ColumnAttribute("(..., 3) float64: unit, from a towards b: the direction that proves lower")  # type: ignore[assignment]
    pieces: np.ndarray = ColumnAttribute("(..., 2) uint32: index of the nearest piece within a and b")  # type: ignore[assignment]
    gradient: np.ndarray = ColumnAttribute(
        "(..., 2, 6) float64, of a, of b: by a turn about its own origin (m/rad), by a shift (m/m); world axes"
    )  # type: ignore[assignment]
    gradient_joints: np.ndarray = ColumnAttribute(
        "(..., J) float64: by the position of each of the query's joints, in their order (m/rad or m/m)"
    )  # type: ignore[assignment]
    hessian_joints: np.ndarray = ColumnAttribute(
        "(..., J, J) float64, symmetric: by the positions of two joints (m/rad^2, m/rad, 1/m); NaN where there is none"
    )  # type: ignore[assignment]
    rate: np.ndarray = ColumnAttribute("float64, m/s: of the distance at the given velocities; NaN if unknown")  # type: ignore[assignment]
    rate_bounds: np.ndarray = ColumnAttribute(
        "(..., 2) float64, m/s: certified interval of the one-sided derivatives by time; infinite if unknown"
    )  # type: ignore[assignment]
    curvature: np.ndarray = ColumnAttribute(
        "float64, m/s^2: second derivative by time while the velocities stay constant; NaN where there is none"
    )  # type: ignore[assignment]
    smooth_radius: np.ndarray = ColumnAttribute(
        "float64, metres of relative motion over which the same features stay the nearest: a lower bound for"
        " translations, an estimate if bodies turn; 0 where these change within rounding, NaN if undefined"
    )  # type: ignore[assignment]
    pair_lower: np.ndarray = ColumnAttribute("(..., 2) uint32: body ids of the pair whose lower bound is the row's")  # type: ignore[assignment]
    pair: np.ndarray = ColumnAttribute("(..., 2) uint32: body ids, as a column; see pairs")  # type: ignore[assignment]
    time: np.ndarray = ColumnAttribute("float64, 0 to 1: when in a motion the witness points are; NaN: no points")  # type: ignore[assignment]
    first_contact: np.ndarray = ColumnAttribute(
        "(..., 2) float64, 0 to 1: until when a motion is proved beyond its margins, and when within; inf: never"
    )  # type: ignore[assignment]
    steps: np.ndarray = ColumnAttribute("uint32: configurations evaluated for a motion")  # type: ignore[assignment]
    free_scale: np.ndarray = ColumnAttribute("float64: how far joints may move, in their weights; see free_scale()")  # type: ignore[assignment]
    verdict: np.ndarray = ColumnAttribute(
        'uint8, reduce="any" only: values of clearance.Status, as status, but OK for any pair proved within its margin'
    )  # type: ignore[assignment]
    bounds: np.ndarray = ColumnAttribute("(..., 2) float32: lower and upper, rounded outward")  # type: ignore[assignment]
    points32: np.ndarray = ColumnAttribute("(..., 2, 3) float32: points of a, of b from its body's origin; world axes")  # type: ignore[assignment]

    def __init__(self, answer: Any, reduce: int, source: PairSource):
        self._answer = answer
        self._reduce = reduce
        self._source = source

    fields: int = AnswerAttribute("Bits of clearance.Field: the columns that are there.")  # type: ignore[assignment]
    configurations: int = AnswerAttribute("K, at least 1.")  # type: ignore[assignment]
    total: int = AnswerAttribute(
        'Pairs found by reduce="within", also those past max_results; else the number of rows.'
    )  # type: ignore[assignment]
    snapshot_revision: int = AnswerAttribute("Revision of the poses that this answer saw.")  # type: ignore[assignment]
    snapshot_stamp_ns: int = AnswerAttribute("Newest publisher's stamp among those poses.")  # type: ignore[assignment]
    snapshot_sequence: int = AnswerAttribute("Its publisher's count of the update with that stamp; 0: not counted.")  # type: ignore[assignment]
    pose_age_ns: int = AnswerAttribute(
        "Nanoseconds from the receipt of the oldest pose to the query's begin; -1: none was received."
    )  # type: ignore[assignment]
    scene_revision: int = AnswerAttribute("Revision of the scene.")  # type: ignore[assignment]
    engine_ns: int = AnswerAttribute("Nanoseconds spent in the engine.")  # type: ignore[assignment]
    server_ns: int = AnswerAttribute("Nanoseconds spent in the daemon as a whole (0 in process).")  # type: ignore[assignment]
    backend: str = AnswerAttribute("The backend that answered.")  # type: ignore[assignment]

    @property
    def _lead(self) -> tuple[int, ...]:
        answer = self._answer
        if self._reduce == Reduce.NONE:
            return (answer.configurations, answer.pairs)
        if self._reduce == Reduce.NEAREST:
            k = answer.configurations
            return (k, answer.rows // k if k else 0)
        return (answer.rows,)

    @property
    def reduce(self) -> str:
        """The reduction of the query."""
        return Reduce(self._reduce).name.lower()

    @property
    def nonsmooth(self) -> np.ndarray:
        """Whether second derivatives jump at this state or do not exist: smooth_radius is not above 0."""
        return ~(self.smooth_radius > 0)

    @property
    def pairs(self) -> np.ndarray:
        """Body ids (a, b): (P, 2) for reduce="none", otherwise the pair of each row: (K, N, 2), (K, 2) or (R, 2).

        With `k` they are (K, min(k, P), 2). The value is clearance.NONE for a body without pairs (reduce="nearest"
        without `k`) and for a BEYOND row of "any". A query with the column verdict has no pairs unless it requests the
        column pair.
        """
        if self._reduce != Reduce.NONE:
            return self.pair
        pairs = self.__dict__.get("_pairs")
        if pairs is None:
            pairs = self.__dict__["_pairs"] = self._source.pairs_at(self.scene_revision)
        return pairs

    @property
    def all_free(self) -> bool:
        """Whether every configuration or motion of reduce="any" is proved free, by the column verdict.

        Takes a tenth of a microsecond, where a comparison of the column takes several.
        """
        return self._answer.all_free()

    @property
    def names(self) -> tuple[str, ...]:
        """The bodies' names by id, of the scene that the query's ids refer to."""
        return self._source.body_names()

    @property
    def pair_names(self) -> np.ndarray:
        """The names of `pairs`, in its shape: an array of str, and None where there is no body."""
        return names_of(self.pairs, self.names)

    def to_pandas(self) -> Any:
        """Returns a pandas.DataFrame with a row for each row of the columns, and bodies and statuses by name.

        Its columns are configuration, body_a and body_b, and those of the query; a column of several numbers a row
        becomes several, such as point_a_x. Requires pandas, which is imported by this call only.
        """
        from .frame import data_frame

        return data_frame(self)

    def to_arrow(self) -> Any:
        """Returns a pyarrow.Table with the columns of to_pandas(), for Polars, DuckDB or Parquet. Requires pyarrow."""
        from .frame import arrow_table

        return arrow_table(self)

    @property
    def neighbours(self) -> np.ndarray:
        """(K, N) uint32, for reduce="nearest": the nearest body of each body, or clearance.NONE."""
        if self._reduce != Reduce.NEAREST:
            raise AttributeError(f"neighbours: only for reduce='nearest', not for {self.reduce!r}")
        if self._source.k:
            raise AttributeError("neighbours: only for reduce='nearest' without k")
        own = np.arange(self._lead[1], dtype=np.uint32)
        return np.where(self.pair[..., 0] == own, self.pair[..., 1], self.pair[..., 0])

    @property
    def configuration(self) -> np.ndarray:
        """(R,) uint32: the configuration of each row of reduce="within"; otherwise 0 to K - 1."""
        found = self.__dict__.get("_configuration")
        if found is None:
            is_column = bool(self.fields & Field.CONFIGURATION)
            found = self._column("configuration") if is_column else np.arange(self.configurations, dtype=np.uint32)
            self.__dict__["_configuration"] = found
        return found

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """The columns of this result, by name."""
        names = [name for name, column in COLUMNS.items() if self.fields & (1 << column.bit)]
        return {name: self.configuration if name == "configuration" else getattr(self, name) for name in names}

    def _column(self, name: str) -> np.ndarray:
        column = COLUMNS[name]
        if not self._answer.fields >> column.bit & 1:
            have = ", ".join(n for n, c in COLUMNS.items() if self.fields & (1 << c.bit))
            raise AttributeError(f"the column {name!r} was not requested; fields were: {have}")
        answer = self._answer
        if isinstance(answer, _Restored):
            return answer.columns[name]
        lead = (answer.rows,) if self._reduce in _ROWS_ALONE else self._lead
        shape = lead if column.shape == () and name not in BY_JOINT else lead + self._row_shape(name)
        return np.ndarray(shape, column.dtype, answer, answer.offset(column.bit))

    def _row_shape(self, name: str) -> tuple[int, ...]:
        return row_shape(name, self._answer.joints)

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        """Pickles and copies the columns, the table of pairs and the names, without the engine or client."""
        numbers = {name: getattr(self._answer, name) for name in _NUMBERS}
        pairs, why_none = None, None
        try:
            pairs = self.pairs if self._reduce == Reduce.NONE else None
        except Exception as error:  # the scene has changed, or the daemon is gone; the columns are still valid
            why_none = error
        return _restored, (numbers, int(self._reduce), self.columns, pairs, why_none, self.names, self._source.k)

    def __repr__(self) -> str:
        names = ", ".join(n for n, c in COLUMNS.items() if self.fields & (1 << c.bit))
        return f"<clearance.Result {self.reduce} {self._lead}: {names}; {self.backend}, poses {self.snapshot_revision}>"


class _Restored:
    """Replaces the answer and the query in a restored Result."""

    def __init__(
        self,
        numbers: dict[str, Any],
        columns: dict[str, np.ndarray],
        pairs: Optional[np.ndarray],
        why_no_pairs: Optional[Exception],
        names: tuple[str, ...],
        k: int,
    ):
        self.__dict__.update(numbers)
        self.columns, self._pairs, self._why_no_pairs, self._names, self.k = columns, pairs, why_no_pairs, names, k

    def all_free(self) -> bool:
        return bool((self.columns["verdict"] == int(Status.BEYOND)).all())

    def pairs_at(self, revision: int) -> np.ndarray:
        if self._pairs is None:
            raise self._why_no_pairs or ValueError("pairs: this result was restored without them")
        return self._pairs

    def body_names(self) -> tuple[str, ...]:
        return self._names


def _restored(
    numbers: dict[str, Any],
    reduce: int,
    columns: dict[str, np.ndarray],
    pairs: Optional[np.ndarray],
    why_no_pairs: Optional[Exception],
    names: tuple[str, ...],
    k: int,
) -> Result:
    """Restores a Result from the state of __reduce__()."""
    state = _Restored(numbers, columns, pairs, why_no_pairs, names, k)
    return Result(state, reduce, state)


def fields_mask(fields: Any) -> int:
    """Returns the column bits of the names in `fields`."""
    if isinstance(fields, str):
        fields = (fields,)
    elif isinstance(fields, int) and not isinstance(fields, bool):
        if fields <= 0 or fields & ~KNOWN_FIELDS:
            raise ValueError(f"fields: unknown bits in {int(fields):#x}")
        return int(fields)
    try:
        names = list(fields)
    except TypeError:
        raise TypeError(f"fields: expected column names, got {fields!r}") from None
    mask = 0
    for name in names:
        bits = FIELD_MASKS.get(name) if isinstance(name, str) else None
        if bits is None:
            raise ValueError(
                f"fields: no column is named {name!r}; there are {', '.join(FIELD_MASKS)}"
                f"{did_you_mean(name, FIELD_MASKS)}"
            )
        mask |= bits
    if not mask:
        raise ValueError("fields: expected at least one column")
    return mask
