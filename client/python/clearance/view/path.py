"""A path of waypoints or a trajectory: its motions, each proved or not, and where it comes closest."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .._front.front import Front
from .._joints import Joints
from .._query.path_report import PathReport
from .._query.trajectory import Trajectory
from .._words import Status
from .edge import Verdict


@dataclass(frozen=True)
class ProvedPath:
    """A path or trajectory with the results of its proofs."""

    path: Trajectory  #: of the columns of `joints`; a path of waypoints has a second for each motion
    joints: Joints
    margin: float  #: metres
    verdicts: tuple[Verdict, ...]  #: of each motion
    report: PathReport  #: where it is closest, or where and how deep its first contact is

    def time_of(self, index: int, t: float) -> float:
        """Returns the time in seconds of a time in a motion."""
        return self.path.time(index, t)


def read_path(file: Path) -> Trajectory:
    """Reads waypoints (CSV: joint names, then positions) or a trajectory (JSON: a JointTrajectory as a dict).

    Raises ValueError that names the file, and OSError.
    """
    try:
        text = file.read_text(encoding="utf-8-sig")
        if file.suffix.lower() == ".json":
            made = Trajectory.from_ros(json.loads(text))
            if made.joint_names is None:
                raise ValueError("joint_names: expected some")
            return made
        names, *rows = [[cell.strip() for cell in row] for row in csv.reader(text.splitlines()) if any(row)] or [[]]
        for row in rows:
            if len(row) != len(names):
                raise ValueError(f"expected {len(names)} numbers, one for each joint of the first line, got {len(row)}")
        if len(rows) < 2:
            raise ValueError(f"expected a line of joint names and two waypoints or more, got {len(rows)}")
        return Trajectory.linear(np.arange(float(len(rows))), np.array(rows, dtype=np.float64), names)
    except (ValueError, AttributeError, TypeError, LookupError) as error:
        raise ValueError(f"{file}: {error}") from error


def joints_of(front: Front, path: Trajectory) -> Joints:
    """Returns the joints of its columns, by their names or the last parts of these. Raises ValueError for others."""
    known = [state.name for state in front.joint_states()]
    found = []
    for name in path.joint_names or ():
        fits = [name] if name in known else [each for each in known if each.rsplit("/", 1)[-1] == name]
        if len(fits) != 1:
            raise ValueError(f"path: {'several joints are' if fits else 'no joint is'} named {name!r}")
        found += fits
    return front.joints(found)


def proved_path(front: Front, path: Trajectory, margin: float, max_evaluations: int = 256) -> ProvedPath:
    """Decides each motion of a path, and finds where it is closest. Raises as Front.explain_path()."""
    joints = joints_of(front, path)
    common: dict[str, Any] = {"joints": joints, "margin": margin, "max_evaluations": max_evaluations}
    found = front.motions(path.points, reduce="any", fields="verdict", **common).verdict.tolist()
    hits = (Status.OK, Status.OVERLAP)
    verdicts = (Verdict.FREE if v == Status.BEYOND else Verdict.HIT if v in hits else Verdict.OPEN for v in found)
    report = front.explain_path(Trajectory(path.points, path.times), **common)  # columns in the order of `joints`
    return ProvedPath(path, joints, margin, tuple(verdicts), report)
