"""A worker, in any kind of process: evaluates parts, and checks rows of parts."""

from __future__ import annotations

import math
import os
import socket
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, Union

import numpy as np

from .._errors import ClearanceError
from .._front.engine import Engine
from .._words import Status
from ._generators import Rows, split_mix
from ._job import columns_of
from ._parts import read_part, write_part
from ._scenes import Packed, unpack

_AT_ONCE = {False: 4096, True: 512}  # configurations, motions per query; more only need more memory
_NAMED = 3  # differences listed in an error
#: From these tolerances on, covers answer states of `least`: bits depend on the moment at which covers are made.
_BY_COVERS = {"abs_tol": 1e-4, "rel_tol": 1e-3}
_COVERS_WITHIN_S = 3600.0  # a minute for a robot of meshes, on an idle core
#: States from which on covers decide queries of at most so many pairs; those of more need a full block.
_DECIDED, _FEW_PAIRS = 256, 4096


@dataclass(frozen=True)
class Spec:
    """Input of a worker, in addition to the scene."""

    rows: Rows
    requested: dict[str, Any]  #: arguments of distances() or motions()
    columns: tuple[str, ...]
    positions: bool
    part_rows: int
    check: float
    folder: Path  #: folder of the parts
    backend: str = "cpu"
    threads: int = 1

    def index(self, part: int) -> np.ndarray:
        """Returns the (n,) rows of a part."""
        first = part * self.part_rows
        return np.arange(first, min(first + self.part_rows, self.rows.count))

    def checked(self, part: int) -> np.ndarray:
        """Returns the (n,) rows of a part that are checked: a fixed pseudo-random selection."""
        index = self.index(part)
        count = math.ceil(self.check * len(index))
        return np.sort(index[np.argsort(split_mix(part, index.astype(np.uint64)), kind="stable")[:count]])


@dataclass(frozen=True)
class Part:
    """A task that evaluates the rows of a part and writes them."""

    part: int


@dataclass(frozen=True)
class Check:
    """A task that evaluates some rows of a written part again, and compares them with the file."""

    part: int
    digest: str


@dataclass(frozen=True)
class Done:
    """A written part."""

    part: int
    rows: int
    size: int  #: bytes
    digest: str


@dataclass(frozen=True)
class Checked:
    """The result of a check."""

    part: int
    rows: int
    differences: tuple[str, ...]  #: row, column and both values of the first few; empty if equal, bit for bit


@dataclass(frozen=True)
class Failed:
    """A task, or a worker's start, with a permanent failure."""

    text: str


Task = Union[Part, Check]
Outcome = Union[Done, Checked, Failed]


class Performs(Protocol):
    """Interface of workers for pools."""

    def perform(self, task: Task) -> Outcome: ...


class Worker:
    """An engine with the scene, and the query of the job."""

    def __init__(self, spec: Spec, packed: Packed):
        self.spec = spec
        decides = spec.requested["reduce"] == "any"
        is_wide = any(spec.requested.get(name, 0.0) >= least for name, least in _BY_COVERS.items())
        self.engine = Engine(
            unpack(packed),
            backend=spec.backend,  # type: ignore[arg-type]
            threads=spec.threads,
            covers="off" if is_wide and not decides else "background",
        )
        # Covers may decide rows that the exact engine leaves unresolved.
        if decides and not self.engine.wait_covers(_COVERS_WITHIN_S):
            raise ClearanceError(f"covers are not made after {_COVERS_WITHIN_S:.0f} s")

    def perform(self, task: Task) -> Outcome:
        """Executes a task. Returns errors instead of raising them, since they would occur on every worker."""
        try:
            return self._answer(task.part) if isinstance(task, Part) else self._check(task)
        except (ClearanceError, OSError) as error:
            return Failed(f"part {task.part}, on {machine()}: {error}")
        except Exception:
            return Failed(f"part {task.part}, on {machine()}: {traceback.format_exc()}")

    def _answer(self, part: int) -> Done:
        index = self.spec.index(part)
        size, digest = write_part(self.spec.folder, part, answer(self.engine, self.spec, index))
        return Done(part, len(index), size, digest)

    def _check(self, task: Check) -> Checked:
        index = self.spec.checked(task.part)
        held = read_part(self.spec.folder, task.part, task.digest)
        place = index - task.part * self.spec.part_rows
        now = answer(self.engine, self.spec, index)
        differences = differences_of({name: column[place] for name, column in held.items()}, now)
        return Checked(task.part, len(index), tuple(differences))


def answer(engine: Engine, spec: Spec, index: np.ndarray) -> dict[str, np.ndarray]:
    """Returns the flat columns of some rows, which depend only on these rows if the engine has all covers or none."""
    at_once = _AT_ONCE[spec.rows.motions]
    blocks = [_block(engine, spec, index[i : i + at_once]) for i in range(0, len(index), at_once)]
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}


def _block(engine: Engine, spec: Spec, index: np.ndarray) -> dict[str, np.ndarray]:
    rows = spec.rows.at(index)
    count = len(index)
    evaluated = np.concatenate([rows, np.repeat(rows[:1], _states_missing(engine, spec, count), axis=0)])
    fields = ["verdict" if name == "free" else name for name in spec.columns]
    requested = {**spec.requested, "fields": list(dict.fromkeys(fields))}
    moving = evaluated.reshape(*evaluated.shape[:-1], -1, 7) if "bodies" in requested else evaluated
    if spec.rows.motions:
        result = engine.motions(moving[:, 0], moving[:, 1], **requested)
    else:
        result = engine.distances(configurations=moving, **requested)
    columns = {"row": index.astype(np.int64)}
    if spec.positions:
        columns.update(_positions(rows, spec.rows.motions))
    for name in spec.columns:
        column = result.verdict == Status.BEYOND if name == "free" else getattr(result, name)
        if column.dtype.kind == "f":
            column = np.where(np.isnan(column), np.nan, column)  # backends can differ in the bits of NaN
        flat = column[:count].reshape(count, -1)
        names = columns_of(name, column.shape[1:])
        columns.update((each, np.ascontiguousarray(flat[:, i])) for i, each in enumerate(names))
    return columns


def _states_missing(engine: Engine, spec: Spec, count: int) -> int:
    """Returns how many more states a query needs, so that covers decide a state in any part and any check."""
    if spec.rows.motions or spec.requested["reduce"] != "any" or count == _AT_ONCE[False]:
        return 0
    bodies = len(engine.bodies)
    return max(0, (_DECIDED if bodies * (bodies - 1) // 2 <= _FEW_PAIRS else _AT_ONCE[False]) - count)


def _positions(rows: np.ndarray, motions: bool) -> Iterator[tuple[str, np.ndarray]]:
    ends = {"start": rows[:, 0], "end": rows[:, 1]} if motions else {"position": rows}
    for end, values in ends.items():
        yield from ((f"{end}_{i}", np.ascontiguousarray(values[:, i])) for i in range(values.shape[1]))


def differences_of(held: dict[str, np.ndarray], now: dict[str, np.ndarray]) -> Iterator[str]:
    """Returns the first few bitwise differences between two answers for the same rows."""
    if list(held) != list(now):
        yield f"columns {', '.join(held)} and {', '.join(now)}"
        return
    found = 0
    for name, column in held.items():
        again = now[name].astype(column.dtype, copy=False)
        bits = [np.ascontiguousarray(each).view(np.uint8).reshape(len(each), -1) for each in (column, again)]
        for i in np.flatnonzero((bits[0] != bits[1]).any(axis=1))[: _NAMED - found]:
            found += 1
            yield f"row {now['row'][i]}, {name}: {column[i]!r} is written, {again[i]!r} comes again"


def machine() -> str:
    """Returns the name of this machine and process, for errors."""
    return f"{socket.gethostname()} (process {os.getpid()})"


def host_of(name: str) -> str:
    """Returns the machine in a name of machine()."""
    return name.partition(" (process ")[0]
