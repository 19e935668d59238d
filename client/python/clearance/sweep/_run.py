"""A run: distributes parts to workers until all are complete, and replaces lost workers."""

from __future__ import annotations

import contextlib
from collections import Counter, deque
from dataclasses import dataclass, field
from pathlib import Path
from typing import Callable, Optional, Protocol, Union

from ._errors import SweepError
from ._journal import Journal
from ._plan import Plan
from ._progress import Progress
from ._work import Check, Checked, Done, Failed, Outcome, Part, Task, host_of

DEPTH = 2  #: tasks per worker: the current one and the next
_LOSSES = 3  #: maximum lost workers for one part, or consecutively at their start


@dataclass(frozen=True)
class Ready:
    """A worker has loaded its scene."""

    worker: int
    machine: str


@dataclass(frozen=True)
class Result:
    """A worker has completed the oldest of its tasks."""

    worker: int
    outcome: Outcome


@dataclass(frozen=True)
class Lost:
    """A worker and its tasks are lost. The pool is starting another, with a new number."""

    worker: int
    text: str


Event = Union[Ready, Result, Lost]


class Pool(Protocol):
    """Processes with workers, on one machine or many."""

    @property
    def size(self) -> int: ...
    def submit(self, worker: int, task: Task) -> None: ...
    def wait(self) -> Event:
        """Waits for the next event, and returns it."""
        ...

    def close(self) -> None: ...


@dataclass(frozen=True)
class Summary:
    """Result of a run."""

    rows: int
    parts: int
    made: int  #: parts made by this run; the others existed
    checked: int  #: rows evaluated twice by this run
    lost: int  #: number of lost workers
    output: Path


@dataclass
class _Dispute:
    """A part whose check found different rows."""

    check: Check
    opinions: list[tuple[str, tuple[str, ...]]] = field(default_factory=list)  #: machine, differences


class Run:
    """The state of one run. `go()` executes it."""

    def __init__(self, plan: Plan, pool: Pool, journal: Journal, progress: Progress):
        self._plan, self._pool, self._journal, self._progress = plan, pool, journal, progress
        self._parts = deque(part for part in range(plan.parts) if part not in journal.done)
        # The worker that made each part in this run; parts of earlier runs have none.
        self._made_by: dict[int, int] = {}
        unchecked = (done for part, done in journal.done.items() if part not in journal.checked)
        self._checks = deque(Check(done.part, done.digest) for done in unchecked) if plan.spec.check else deque()
        self._dispute: Optional[_Dispute] = None
        self._asked: set[int] = set()  # workers that have checked the disputed part
        self._machines: dict[int, str] = {}
        self._tasks: dict[int, deque[Task]] = {}
        self._losses: Counter[int] = Counter()
        self._lost_in_a_row = 0
        self._lost = self._checked = 0

    def go(self) -> Summary:
        made = len(self._parts)
        while self._parts or self._checks or self._dispute or any(self._tasks.values()):
            for worker in self._tasks:
                self._fill(worker)
            self._take(self._pool.wait())
        self._journal.write_manifest()
        self._progress.end()
        rows, parts = self._plan.rows, self._plan.parts
        return Summary(rows, parts, made, self._checked, self._lost, self._plan.output)

    def _fill(self, worker: int) -> None:
        tasks = self._tasks[worker]
        while len(tasks) < DEPTH:
            task = self._next(worker)
            if task is None:
                return
            tasks.append(task)
            self._pool.submit(worker, task)

    def _next(self, worker: int) -> Optional[Task]:
        """Prefers checks to parts, so that errors show early and few checks wait."""
        alone = self._pool.size == 1
        if self._dispute is not None:
            if worker in self._asked:
                return None  # makes no parts before the dispute is resolved
            self._asked.add(worker)
            return self._dispute.check
        for check in self._checks:
            if alone or self._is_other(worker, check.part):
                self._checks.remove(check)
                return check
        return Part(self._parts.popleft()) if self._parts else None

    def _is_other(self, worker: int, part: int) -> bool:
        """Whether a worker is on another machine than a part's maker or, with one machine, is another worker."""
        maker = self._made_by.get(part)
        if maker is None:
            return True
        hosts = {host_of(self._machines[number]) for number in self._tasks}
        if len(hosts) > 1:
            return host_of(self._machines[worker]) != host_of(self._machines[maker])
        return worker != maker

    def _take(self, event: Event) -> None:
        if isinstance(event, Ready):
            self._machines[event.worker] = event.machine
            self._tasks[event.worker] = deque()
        elif isinstance(event, Lost):
            self._take_loss(event)
        else:
            if event.worker not in self._tasks:
                assert isinstance(event.outcome, Failed)  # at its start
                raise SweepError(event.outcome.text)
            task = self._tasks[event.worker].popleft()
            self._lost_in_a_row = 0
            self._take_outcome(event.worker, task, event.outcome)

    def _take_loss(self, event: Lost) -> None:
        self._lost += 1
        self._lost_in_a_row += 1
        machine = self._machines.get(event.worker, "a worker that had not started")
        self._progress.say(f"lost {machine}: {event.text}")
        tasks = self._tasks.pop(event.worker, deque())
        for place, task in enumerate(tasks):
            if isinstance(task, Part):
                self._parts.appendleft(task.part)
            elif self._dispute is None:
                self._checks.appendleft(task)
            self._losses[task.part] += place == 0  # the current task
            if self._losses[task.part] >= _LOSSES:
                text = f"{_LOSSES} workers were lost over it; the last, {machine}: {event.text}"
                raise SweepError(f"part {task.part}: {text}")
        if self._lost_in_a_row >= _LOSSES + self._pool.size:
            raise SweepError(f"workers are lost one after the other; the last, {machine}: {event.text}")

    def _take_outcome(self, worker: int, task: Task, outcome: Outcome) -> None:
        machine = self._machines[worker]
        if isinstance(outcome, Failed):
            raise SweepError(outcome.text)
        if isinstance(outcome, Done):
            self._journal.add(outcome, machine)
            self._made_by[outcome.part] = worker
            if self._plan.spec.check:
                self._checks.append(Check(outcome.part, outcome.digest))
            self._progress.add(outcome.rows)
            return
        assert isinstance(task, Check)
        self._take_check(worker, task, outcome)

    def _take_check(self, worker: int, task: Check, outcome: Checked) -> None:
        machine = self._machines[worker]
        if self._dispute is None:
            if not outcome.differences:
                self._journal.add_check(outcome, machine)
                self._checked += outcome.rows
                return
            maker = self._made_by.get(task.part)
            self._dispute, self._asked = _Dispute(task), {worker} if maker is None else {worker, maker}
        elif self._dispute.check.part != task.part:
            return  # a dispute ends the run
        self._dispute.opinions.append((machine, outcome.differences))
        if len(self._dispute.opinions) == 2 or self._pool.size <= len(self._asked):
            self._settle(self._dispute)

    def _settle(self, dispute: _Dispute) -> None:
        """Drops the parts of the machines whose answers may be wrong, and raises an error that names them."""
        part = dispute.check.part
        maker = self._journal.makers[part]
        (second, differences), *others = dispute.opinions
        suspects = {maker, second}
        text = f"{maker} wrote it, {second} computed it again; without a third machine it is unknown which is wrong"
        if others:
            third, found = others[0]
            suspects = {maker} if found == differences else {maker, second, third} if found else {second}
            text = f"{maker}, {second} and {third} all give different answers"
            if len(suspects) == 1:
                text = f"{min(suspects)} stands alone among {maker}, who wrote it, {second} and {third}"
        dropped = [number for number in self._journal.done if self._journal.makers[number] in suspects]
        for number in dropped:
            self._journal.drop(number)
        raise SweepError(
            f"part {part}: rows computed again differ from the written ones: {'; '.join(differences)}. {text}. "
            f"When the job goes on, the {len(dropped)} parts of {' and '.join(sorted(suspects))} are computed again"
        )


def drive(plan: Plan, start_pool: Callable[[], Pool], progress: Progress) -> Summary:
    """Runs the rest of a job with the workers of a pool, and writes the manifest."""
    with contextlib.closing(Journal(plan)) as journal, contextlib.closing(start_pool()) as pool:
        progress.start(plan.rows, sum(done.rows for done in journal.done.values()))
        return Run(plan, pool, journal, progress).go()
