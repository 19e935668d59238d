"""Inputs of calls as arrays of poses, positions and control points."""

from __future__ import annotations

from typing import Any, Optional

import numpy as np

from .._arguments import to_floats
from .._poses import as_pose7
from .query import Query
from .trajectory import Trajectory


def arrays_of(query: Query, value: Any, what: str) -> tuple[Optional[np.ndarray], Optional[np.ndarray]]:
    """Returns (K, M, 7) poses and (K, J) positions of configurations, None for the kind that does not move."""
    if query.joints is None:
        return poses_of(query, value, what), None
    if query.bodies is None:
        return None, positions_of(value, query.joint_count, what)
    if not isinstance(value, (tuple, list)) or len(value) != 2:
        raise TypeError(f"{what}: expected a pair (positions, poses), since joints and bodies move")
    positions = positions_of(value[0], query.joint_count, f"{what}[0]")
    poses = poses_of(query, value[1], f"{what}[1]")
    if len(poses) != len(positions):
        raise ValueError(f"{what}: expected K = {len(positions)} poses as of positions, got {len(poses)}")
    return poses, positions


def count_of(poses: Optional[np.ndarray], positions: Optional[np.ndarray]) -> int:
    return len(poses) if poses is not None else 0 if positions is None else len(positions)


def positions_of(value: Any, joints: int, what: str) -> np.ndarray:
    if value is None:
        raise ValueError(f"{what}: expected (K, J) positions of joints, got none")
    rows = to_floats(value, what, "(K, J) numbers")
    shape = rows.shape
    if len(shape) != 2 or shape[1] != joints:
        hint = f"; write {what}[None] for one row" if shape == (joints,) else ""
        raise ValueError(f"{what}: expected shape (K, {joints}), one column for each joint, got {shape}{hint}")
    if not shape[0]:
        raise ValueError(f"{what}: expected at least one row, got shape {shape}")
    return rows


def poses_of(query: Query, value: Any, what: str) -> np.ndarray:
    if value is None:
        raise ValueError(f"{what}: expected (K, M, 7) poses of bodies, got none")
    poses = as_pose7(value, what)
    if poses.ndim != 3:
        raise ValueError(f"{what}: expected shape (K, M, 7) or (K, M, 4, 4), got {np.shape(value)}")
    bodies, _ = query.moved(True)
    count = 0 if bodies is None else len(bodies)
    if poses.shape[1] != count:
        whose = "every movable body" if query.bodies is None else "bodies"
        raise ValueError(f"{what}: expected M = {count} poses each ({whose}), got shape {np.shape(value)}")
    if not len(poses):
        raise ValueError(f"{what}: expected at least one, got shape {np.shape(value)}")
    return poses


def is_curved(query: Query, start: Any) -> bool:
    """Whether the motions have control points instead of two ends."""
    if isinstance(start, Trajectory):
        return True
    if start is None or query.joints is None or (query.bodies is not None and query.meanwhile is None):
        return False
    return to_floats(start, "start", "(K, J) numbers").ndim == 3


def curves_of(query: Query, value: Any, what: str) -> np.ndarray:
    """Returns (K, D + 1, J) control points of motions of joints."""
    if query.joints is None or (query.bodies is not None and query.meanwhile is None):
        raise ValueError(f"{what}: expected poses, since bodies move: along a Trajectory use meanwhile")
    trajectory = value if isinstance(value, Trajectory) else Trajectory(value)
    return trajectory.columns(query.joints.names, what)


def interleave(start: Optional[np.ndarray], end: Optional[np.ndarray]) -> Optional[np.ndarray]:
    """Interleaves the ends of motions as a query expects them: first start, first end, second start, ..."""
    if start is None or end is None:
        return None
    if start.shape != end.shape:
        raise ValueError(f"end: expected shape {start.shape}, as start has, got {end.shape}")
    if len(start) == 1:
        return np.concatenate((start, end))
    return np.stack((start, end), axis=1).reshape(-1, *start.shape[1:])


def ends_of(waypoints: Optional[np.ndarray], first: int, last: int, are_curves: bool) -> Optional[np.ndarray]:
    """Returns the ends of the motions from waypoint `first` to `last`, in turn: every waypoint twice, except those.

    are_curves: of curves instead, their control points.
    """
    if are_curves:
        return None if waypoints is None else waypoints[first:last].reshape(-1, *waypoints.shape[2:])
    if waypoints is None or len(waypoints) == 2:
        return waypoints
    return np.repeat(waypoints[first : last + 1], 2, axis=0)[1:-1]
