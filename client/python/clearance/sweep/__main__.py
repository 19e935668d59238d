"""clearance sweep JOB.yaml: runs a job of many rows, or the rest of it."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Optional

from . import JobError, Summary, SweepError, run
from ._job import Job

_EPILOG = """\
The same command resumes an interrupted run: complete parts are kept.
Exit codes: 0 done    1 the run cannot go on    2 the command line or the job is wrong    130 ended by Ctrl-C"""


def main(arguments: Optional[Sequence[str]] = None) -> int:
    parser = argparse.ArgumentParser(
        prog="clearance sweep",
        description="Answers a job of many configurations or motions in parts, as Parquet with a manifest.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("job", type=Path, help="job file (YAML, or JSON)")
    parser.add_argument("--output", type=Path, help="folder, in place of the job's own")
    parser.add_argument("--workers", type=_count, default=0, help="how many (default: one a core)")
    parser.add_argument("--threads", type=_count, default=1, help="of each worker (default 1)")
    parser.add_argument("--backend", choices=["cpu", "cuda", "auto"], default="cpu", help="of each worker")
    on_ray = "on Ray: the cluster at ADDRESS ('auto': the one that runs), or one that is started on this machine"
    parser.add_argument("--ray", nargs="?", const="local", metavar="ADDRESS", help=on_ray)
    parser.add_argument("--quiet", action="store_true", help="no progress")
    options = parser.parse_args(arguments)
    try:
        done = _run(options)
    except JobError as error:
        print(f"clearance sweep: {error}", file=sys.stderr)
        return 2
    except (SweepError, OSError, ImportError) as error:
        print(f"clearance sweep: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("clearance sweep: ended; the same command goes on from here", file=sys.stderr)
        return 130
    print(
        f"{done.output}: {done.rows:,} rows in {done.parts:,} parts, of which {done.made:,} were made now; "
        f"{done.checked:,} rows recomputed, all equal; {done.lost} workers lost"
    )
    return 0


def _run(options: argparse.Namespace) -> Summary:
    progress = None if options.quiet else sys.stderr
    requested = {
        "workers": options.workers,
        "threads": options.threads,
        "backend": options.backend,
        "progress": progress,
    }
    job = Job.load(options.job)
    if options.ray is None:
        return run(job, options.output, **requested)
    from .. import ray

    return ray.run(job, options.output, address=None if options.ray == "local" else options.ray, **requested)


def _count(text: str) -> int:
    number = int(text)
    if number < 0:
        raise argparse.ArgumentTypeError(f"expected 0 or more, got {number}")
    return number


if __name__ == "__main__":
    sys.exit(main())
