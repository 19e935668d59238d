"""Generators of rows. Row i depends only on i, so that any worker can generate any part.

A generator has `count`, `width` (numbers per configuration), `motions` (whether a row has two ends), and `at(index)`,
which returns the rows of an (n,) index as float64 (n, width), or (n, 2, width) for motions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Optional, Protocol

import numpy as np

from ._errors import JobError, SweepError
from ._parts import digest_of_file

_PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71, 73, 79, 83, 89, 97, 101)


class Rows(Protocol):
    """Interface of generators."""

    @property
    def count(self) -> int: ...
    @property
    def width(self) -> int: ...
    @property
    def motions(self) -> bool: ...
    def at(self, index: np.ndarray) -> np.ndarray: ...
    def identity(self) -> dict[str, Any]:
        """Returns the parts of its content that are not in the job file."""
        ...


@dataclass(frozen=True)
class Box:
    """The range of joint positions: one interval per joint, radians or metres."""

    lower: np.ndarray  #: (J,) float64
    upper: np.ndarray  #: (J,) float64

    def at(self, share: np.ndarray) -> np.ndarray:
        """Returns (n, J) positions at fractions from 0 to 1 of the intervals; 1 is exactly the upper limit."""
        inside = np.minimum(self.lower + share * (self.upper - self.lower), self.upper)
        return np.where(share >= 1.0, self.upper, inside)


@dataclass(frozen=True)
class _InBox:
    box: Box

    motions = False

    @property
    def width(self) -> int:
        return len(self.box.lower)

    def identity(self) -> dict[str, Any]:
        return {"lower": self.box.lower.tolist(), "upper": self.box.upper.tolist()}


@dataclass(frozen=True)
class Uniform(_InBox):
    """Independent positions, uniform over the box, from SplitMix64 (Steele, Lea, Flood 2014) with random access."""

    count: int
    seed: int

    def at(self, index: np.ndarray) -> np.ndarray:
        places = index.astype(np.uint64)[:, None] * np.uint64(self.width) + np.arange(self.width, dtype=np.uint64)
        return self.box.at((split_mix(self.seed, places) >> np.uint64(11)).astype(np.float64) * 2.0**-53)


@dataclass(frozen=True)
class Halton(_InBox):
    """Points of the Halton sequence in the box, without its first, which is a corner."""

    count: int
    first: int

    def at(self, index: np.ndarray) -> np.ndarray:
        number = index.astype(np.int64) + (self.first + 1)
        return self.box.at(np.stack([_radical_inverse(number, prime) for prime in _PRIMES[: self.width]], axis=1))


@dataclass(frozen=True)
class Grid(_InBox):
    """Every combination of equally spaced positions, both limits included; the last joint varies fastest."""

    counts: tuple[int, ...]

    @property
    def count(self) -> int:
        return math.prod(self.counts)

    def at(self, index: np.ndarray) -> np.ndarray:
        rest = index.astype(np.int64)
        share = np.empty((len(rest), self.width))
        for joint in reversed(range(self.width)):
            steps = self.counts[joint]
            rest, digit = np.divmod(rest, steps)
            share[:, joint] = digit / (steps - 1) if steps > 1 else 0.5
        return self.box.at(share)


@dataclass
class ArrayFile:
    """Rows of a memory-mapped .npy file."""

    path: Path
    width: int
    motions: bool
    what: str
    _array: Optional[np.ndarray] = field(default=None, repr=False)

    def __post_init__(self) -> None:
        try:
            array = np.load(self.path, mmap_mode="r", allow_pickle=False)
        except (OSError, ValueError) as error:
            raise JobError(f"{self.what}: {self.path} cannot be read as .npy: {error}") from None
        ends = 2 if self.motions else 1
        if array.dtype.kind != "f" or array.ndim < 2 or math.prod(array.shape[1:]) != ends * self.width:
            raise JobError(
                f"{self.what}: expected floating-point rows of {ends * self.width} numbers "
                f"({'start and end of ' if self.motions else ''}{self.width} each), "
                f"got {array.dtype} of shape {array.shape}"
            )
        if not len(array):
            raise JobError(f"{self.what}: expected at least one row, got shape {array.shape}")
        self._array = array

    @property
    def count(self) -> int:
        return 0 if self._array is None else len(self._array)

    def at(self, index: np.ndarray) -> np.ndarray:
        assert self._array is not None
        shape = (len(index), 2, self.width) if self.motions else (len(index), self.width)
        return np.ascontiguousarray(self._array[index], dtype=np.float64).reshape(shape)

    def identity(self) -> dict[str, Any]:
        return {"file": digest_of_file(self.path)}

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_array": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.__post_init__()


@dataclass
class ParquetFile:
    """Rows of some columns of a Parquet file, with one row group in memory at a time."""

    path: Path
    width: int
    motions: bool
    what: str
    columns: Optional[list[str]] = None
    _file: Any = field(default=None, repr=False)
    _group: Any = field(default=None, repr=False)  #: number and rows of the cached row group

    def __post_init__(self) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            self._file = pq.ParquetFile(self.path)
        except (OSError, pa.ArrowInvalid) as error:
            raise JobError(f"{self.what}: {self.path} cannot be read as Parquet: {error}") from None
        schema = self._file.schema_arrow
        names = schema.names if self.columns is None else self.columns
        wanted = self.width * (2 if self.motions else 1)
        for name in names:
            if name not in schema.names:
                raise JobError(f"{self.what}: there is no column {name!r}; there are {', '.join(schema.names)}")
            if not pa.types.is_floating(schema.field(name).type):
                raise JobError(f"{self.what}: expected numbers, but column {name!r} is {schema.field(name).type}")
        if len(names) != wanted:
            raise JobError(f"{self.what}: expected {wanted} columns, got {len(names)}: {', '.join(names)}")
        if not self.count:
            raise JobError(f"{self.what}: expected at least one row, got none")
        self.columns = list(names)
        sizes = [self._file.metadata.row_group(i).num_rows for i in range(self._file.num_row_groups)]
        self._ends = np.cumsum(sizes)

    @property
    def count(self) -> int:
        return int(self._file.metadata.num_rows)

    def at(self, index: np.ndarray) -> np.ndarray:
        rows = np.empty((len(index), self.width * (2 if self.motions else 1)))
        groups = np.searchsorted(self._ends, index, side="right")
        for group in np.unique(groups):
            here = groups == group
            first = self._ends[group - 1] if group else 0
            rows[here] = self._read(int(group))[index[here] - first]
        return rows.reshape(len(index), 2, self.width) if self.motions else rows

    def _read(self, group: int) -> np.ndarray:
        if self._group is None or self._group[0] != group:
            table = self._file.read_row_group(group, columns=self.columns)
            columns = [table.column(name) for name in self.columns or ()]
            if any(column.null_count for column in columns):
                raise SweepError(f"{self.what}: {self.path} has rows without a number in row group {group}")
            self._group = group, np.stack([column.to_numpy().astype(np.float64) for column in columns], axis=1)
        rows: np.ndarray = self._group[1]
        return rows

    def identity(self) -> dict[str, Any]:
        return {"file": digest_of_file(self.path)}

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_file": None, "_group": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.__post_init__()


def split_mix(seed: int, places: np.ndarray) -> np.ndarray:
    """Returns uint64 random numbers, one for each uint64 position in the seed's sequence."""
    with np.errstate(over="ignore"):
        start = _mixed(np.array([seed], dtype=np.uint64) + np.uint64(0x9E3779B97F4A7C15))
        return _mixed(start + (places + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15))


def _mixed(z: np.ndarray) -> np.ndarray:
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    mixed: np.ndarray = z ^ (z >> np.uint64(31))
    return mixed


def _radical_inverse(number: np.ndarray, base: int) -> np.ndarray:
    """Returns the radical inverses of numbers in a base, as a quotient of integers that float64 represents exactly.

    Leading zeros multiply numerator and denominator by the same factor, so the result does not depend on the array.
    """
    mirrored, scale, rest = np.zeros_like(number), 1, number
    while np.any(rest):
        rest, digit = np.divmod(rest, base)
        mirrored, scale = mirrored * base + digit, scale * base
        if scale > 1 << 53:
            raise SweepError(f"halton: point {int(number.max())} has more digits in base {base} than float64 holds")
    return mirrored / np.float64(scale)
