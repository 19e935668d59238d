"""Whether a planned trajectory is free, and where and why not. It uses only the fields of messages.

Joints that a trajectory does not name, and all bodies, stay where they are now.
"""

import math
from dataclasses import dataclass
from typing import Any

from . import clearance
from .bridge import Bridge

#: Values of clearance_msgs/TrajectoryCheck.result.
FREE, COLLISION, UNPROVED, LIMITS, STALE, INVALID = range(6)


@dataclass(frozen=True)
class Check:
    """The fields of clearance_msgs/TrajectoryCheck."""

    result: int
    message: str
    margin: float  #: metres
    time_from_start: float = math.nan  #: seconds
    segment: int = 0
    joint_names: tuple[str, ...] = ()
    positions: tuple[float, ...] = ()  #: radians and metres
    body_a: str = ""
    body_b: str = ""
    lower: float = -math.inf  #: metres
    upper: float = math.inf


def check_trajectory(bridge: Bridge, message: Any, margin: float, max_age_s: float) -> Check:
    """Checks a trajectory_msgs/JointTrajectory against the daemon's scene, between its points as well.

    margin: metres >= 0. max_age_s: as in Bridge.report(). An input that is stale, or an object that the planning scene
    has and the daemon has not, leaves no verdict but STALE.
    """
    missing = bridge.stale(max_age_s)
    if missing:
        return Check(STALE, "; ".join(missing), margin)
    try:
        return _checked(bridge.client, _trajectory(bridge, message), tuple(message.joint_names), margin)
    except (TypeError, ValueError, clearance.QueryError) as error:
        return Check(INVALID, str(error), margin)


def _checked(client: clearance.Client, trajectory: Any, names: tuple[str, ...], margin: float) -> Check:
    """Checks a clearance.Trajectory. names: of its joints, in ROS."""
    joints = list(trajectory.joint_names)
    check: Any = client.check_path(trajectory, joints=joints, margin=margin)
    if check.free:
        r = client.motions(trajectory, joints=joints, fields=("default", "pair", "time"))
        segment = int(r.lower.argmin())
        t, pair = float(r.time[segment]), r.pair_names[segment]
        lower, upper = float(r.lower[segment]), float(r.upper.min())
        text = f"every pair stays at least {lower:.4f} m apart"
    else:
        segment, t, pair = check.index, check.t, check.pair_names
        state = trajectory.at(trajectory.time(segment, t))
        one = client.distances(configurations=[state], joints=joints, pairs=[pair], fields="default")
        lower, upper = float(one.lower[0, 0]), float(one.upper[0, 0])
        text = f"{pair[0]} and {pair[1]} "
    at = trajectory.time(segment, t)
    if check.hit:
        result, text = COLLISION, f"{text}come within {margin:g} m at {at:.3f} s, after point {segment}"
    elif not check.free:
        result, text = UNPROVED, f"{text}may be within {margin:g} m at {at:.3f} s, after point {segment}"
    elif check.limit_violations:
        result, text = LIMITS, "; ".join(f"{violation.joint}: {violation}" for violation in check.limit_violations)
    else:
        result = FREE
    positions = tuple(float(q) for q in trajectory.at(at))
    return Check(result, text, margin, at, segment, names, positions, pair[0], pair[1], lower, upper)


def _trajectory(bridge: Bridge, message: Any) -> Any:
    """A clearance.Trajectory with the scene's names of joints. Raises ValueError for one that the scene has not."""
    given = clearance.Trajectory.from_ros(message)
    names = [bridge.joint_name(name) for name in given.joint_names or ()]
    if not names:
        raise ValueError("joint_names: expected some")
    return clearance.Trajectory(given.points, given.times, names, given.rounding)


def trajectory_of(display: Any) -> Any:
    """The one JointTrajectory of a moveit_msgs/DisplayTrajectory.

    Raises ValueError for joints of several degrees of freedom, and for none or several trajectories with points.
    """
    parts = [part for part in display.trajectory if len(part.joint_trajectory.points)]
    if any(len(part.multi_dof_joint_trajectory.points) for part in display.trajectory):
        raise ValueError("multi_dof_joint_trajectory: joints of several degrees of freedom are not supported")
    if len(parts) != 1:
        raise ValueError(f"trajectory: expected one with points, got {len(parts)}")
    return parts[0].joint_trajectory
