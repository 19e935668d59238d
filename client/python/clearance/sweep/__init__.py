"""Many rows: a job of configurations or motions, answered in parts by many workers, on one machine or many.

    job = Job.load("reach.yaml")
    run(job, workers=2)            # parts/*.parquet and manifest.json in the job's output

The result depends on the job alone: not on how many workers there were, which of them were lost, or how often the run
was killed and went on. docs/sweep.md has the keys of a job; clearance.ray is the same on many machines. Needs pyarrow.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Optional, TextIO, Union

from .._words import BackendWord
from ._errors import JobError, SweepError
from ._job import Job
from ._plan import Plan, prepare
from ._processes import Processes
from ._progress import Progress
from ._run import Summary, drive

__all__ = ["Job", "JobError", "Plan", "Summary", "SweepError", "prepare", "run"]


def run(
    job: Job,
    output: Union[str, Path, None] = None,
    workers: int = 0,
    threads: int = 1,
    backend: BackendWord = "cpu",
    progress: Optional[TextIO] = None,
) -> Summary:
    """Does a job, or what is left of it, in processes of this machine.

    output: a folder, in place of the job's own.
    workers: processes; 0: one for each core that this process may use.
    threads: of each worker's engine.
    backend: of each worker's engine; answers have the same bits on all.
    progress: where lines on rate and time left go; None: nowhere.

    Raises JobError for a job that cannot be done, SweepError for a run that cannot go on; what it has written stays.
    """
    plan = prepare(job, None if output is None else Path(output), backend, threads)
    count = workers or max(1, len(os.sched_getaffinity(0)) // max(threads, 1))
    return drive(plan, lambda: Processes(plan.spec, plan.packed, count), Progress(progress))
