"""Sweeps: jobs of many configurations or motions, evaluated in parts by workers on one machine or many.

    job = Job.load("reach.yaml")
    run(job, workers=2)            # parts/*.parquet and manifest.json in the job's output

The result depends only on the job, not on the number of workers, on lost workers, or on interruptions of the run.
docs/sweeps.md lists the keys of a job; clearance.ray runs it on many machines. Requires pyarrow.
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
    """Runs a job, or the rest of it, in processes on this machine.

    output: a folder that replaces the job's own.
    workers: number of processes. The default, 0, starts one per core available to this process.
    threads: threads of each worker's engine.
    backend: backend of each worker's engine; answers have the same bits on all.
    progress: stream for lines with the rate and the remaining time, or None.

    Raises JobError for an invalid job, SweepError for a run that cannot continue. Written parts are kept.
    """
    plan = prepare(job, None if output is None else Path(output), backend, threads)
    count = workers or max(1, len(os.sched_getaffinity(0)) // max(threads, 1))
    return drive(plan, lambda: Processes(plan.spec, plan.packed, count), Progress(progress))
