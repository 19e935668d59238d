"""Whether a planned trajectory is free, and where and why not. It uses only the fields of messages.

Joints that a trajectory does not name, and all bodies, stay where they are now. The robot starts at rest.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import clearance
from .bridge import Bridge

#: Values of clearance_msgs/TrajectoryCheck.result.
FREE, COLLISION, UNPROVED, LIMITS, STALE, INVALID = range(6)

#: Radians or metres: a first point at the time 0 may be that far from the joints' positions, as MoveIt's default
#: allowed_start_tolerance. FREE proves nothing of that step.
START_TOLERANCE = 0.01


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

    If its first point has a time above 0, the way to it from the joints' positions is checked as well.

    margin: metres >= 0. max_age_s: as in Bridge.report(). An input that is stale, or an object that the planning scene
    has and the daemon has not, leaves no verdict but STALE.
    """
    missing = bridge.stale(max_age_s)
    if missing:
        return Check(STALE, "; ".join(missing), margin)
    try:
        trajectory = _trajectory(bridge, message)
        states = {joint.name: joint for joint in bridge.client.joint_states()}
        for name in trajectory.joint_names:
            if name in states and states[name].age_ns is None:
                return Check(STALE, f"joint_states: no position of {name} has come", margin)
        now = np.array([states[name].position if name in states else math.nan for name in trajectory.joint_names])
        whole, why_not = _from(now, trajectory)
        check = _checked(bridge.client, whole, tuple(message.joint_names), margin)
        before = len(whole) - len(trajectory)
        if before:
            at = "before point 0" if check.segment < before else f"after point {check.segment - before}"
            text = check.message.replace(f"after point {check.segment}", at)
            check = replace(check, segment=max(0, check.segment - before), message=text)
        if why_not and check.result in (FREE, LIMITS):
            at_start = tuple(trajectory.points[0, 0].tolist())
            return Check(UNPROVED, why_not, margin, float(trajectory.times[0]), 0, check.joint_names, at_start)
        return check
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


def _from(now: np.ndarray, trajectory: Any) -> tuple[Any, str]:
    """Prepends the way from positions `now` to the first point, or returns a reason why it is unknown.

    A controller goes there from rest in time_from_start. If the point is at rest too, that way is straight, whether the
    interpolation is linear, cubic or quintic.
    """
    first, start = trajectory.points[0], float(trajectory.times[0])
    if start < 0:
        raise ValueError(f"points[0].time_from_start: expected 0 or more, got {start:g}")
    if start == 0:
        for name, here, there in zip(trajectory.joint_names, now.tolist(), first[0].tolist()):
            if not abs(there - here) <= START_TOLERANCE:
                text = f"points[0]: {name} begins at {there:g} and is at {here:g}, more than {START_TOLERANCE:g} away"
                return trajectory, text
        return trajectory, ""
    degree = len(first) - 1
    if degree > 1 and not all(np.array_equal(point, first[0]) for point in first[1 : (degree + 1) // 2]):
        return trajectory, f"points[0]: the way to it until {start:g} s is unknown, because it does not come to rest"
    way = now + np.linspace(0, 1, degree + 1)[:, None] * (first[0] - now)
    way[-1] = first[0]
    unit = 4 * 2.0**-53 * (np.abs(now) + np.abs(first[0]))
    points, times = np.concatenate((way[None], trajectory.points)), np.concatenate(([0.0], trajectory.times))
    return type(trajectory)(points, times, trajectory.joint_names, np.maximum(trajectory.rounding, unit)), ""


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
