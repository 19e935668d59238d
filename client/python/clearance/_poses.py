"""Poses as seven numbers or as matrices.

A pose is [x, y, z, qw, qx, qy, qz]: metres, quaternion scalar first, of the body in the world (X_wb) or, for a body
with a parent, in its parent (X_pb).
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain
from typing import Any

import numpy as np

from ._arguments import contiguous, is_masked, to_floats
from ._errors import PoseWarning, warn

#: How far a matrix may be from rigid: entries of R^T R - 1, and of the last row. Wide enough for matrices that went
#: through float32.
RIGID_TOLERANCE = 1e-5

_LAST_ROW = np.array([0.0, 0.0, 0.0, 1.0])

#: Types of entries that are numbers for certain, neither masked nor arrays.
_NUMBERS = {float, int, np.float64}


def pose7_from_matrix(matrix: Any, what: str = "matrix") -> np.ndarray:
    """Converts homogeneous matrices (..., 4, 4) to poses (..., 7).

    The quaternion is a unit quaternion with qw >= 0 whose rotation is nearest to the matrix, to about 1e-15 for a
    matrix that is orthogonal to rounding. A matrix with NaN or Inf becomes a pose of NaN, which a query answers
    BAD_POSE. Raises ValueError for a matrix that is not rigid (scaled, sheared, mirrored, or with another last row than
    0 0 0 1).
    """
    m = to_floats(matrix, what)
    if m.ndim < 2 or m.shape[-2:] != (4, 4):
        raise ValueError(f"{what}: expected shape (..., 4, 4), got {m.shape}")
    from . import _client  # when a matrix first comes: numbers need no extension module

    rows = m.reshape(-1, 4, 4)
    poses = np.empty((len(rows), 7))
    wrong = _client.poses_of_matrices(rows, RIGID_TOLERANCE, poses)
    if wrong >= 0:
        index = ", ".join(map(str, np.unravel_index(wrong, m.shape[:-2])))
        raise ValueError(f"{what}{index and f'[{index}]'}: not a rigid transform: {_why_not_rigid(rows[wrong])}")
    return poses.reshape(*m.shape[:-2], 7)


def _why_not_rigid(m: np.ndarray) -> str:
    if np.abs(m[3] - _LAST_ROW).max() > RIGID_TOLERANCE:
        return f"its last row is {m[3].tolist()}, expected [0, 0, 0, 1]"
    r = m[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        skew = np.abs(r.T @ r - np.eye(3)).max()
    if not skew <= RIGID_TOLERANCE:
        return f"its 3 x 3 block is not a rotation: an entry of R^T R - 1 is {skew:.3g}"
    return "its 3 x 3 block mirrors (determinant -1)"


def as_pose7(value: Any, what: str) -> np.ndarray:
    """Any array of poses as C-contiguous float64 (..., 7); matrices (..., 4, 4) are converted.

    An array that is so already comes back as it is, without a copy. Raises TypeError or ValueError naming `what`.
    """
    if type(value) is np.ndarray and value.dtype == np.float64 and value.ndim and value.shape[-1] == 7:
        return contiguous(value)
    array = to_floats(value, what)
    if array.ndim >= 1 and array.shape[-1] == 7:
        return array
    if array.ndim >= 2 and array.shape[-2:] == (4, 4):
        return pose7_from_matrix(array, what)
    raise ValueError(
        f"{what}: expected poses of 7 numbers [x, y, z, qw, qx, qy, qz] or (4, 4) matrices, got shape {array.shape}"
    )


def as_one_pose(value: Any, what: str) -> np.ndarray:
    """(7,) of one pose, 7 numbers or (4, 4)."""
    pose = as_pose7(value, what)
    if pose.shape != (7,):
        raise ValueError(f"{what}: expected one pose, got shape {np.shape(value)}")
    return pose


def as_first_pose(value: Any, what: str) -> np.ndarray:
    """as_one_pose() of a body that is added. Warns of 7 numbers whose quaternion looks like x, y, z, w."""
    pose = as_one_pose(value, what)
    qw, qx, qy, qz = pose[3:].tolist()
    if np.shape(value) == (7,) and qw == 0 and qx == 0 and qz > 0:  # as engine/pose/pose_order.cpp has it
        turn = "a turn about z" if qy else "no turn"
        warn(
            f"{what}: the quaternion 0, 0, {qy:g}, {qz:g} looks like one in the order x, y, z, w, which would be "
            f"{turn}; in the order w, x, y, z, which counts, it is a half turn. If that is meant, write the same "
            f"rotation as 0, 0, {-qy or 0:g}, {-qz:g}",
            PoseWarning,
        )
    return pose


def stack_poses(poses: Mapping[Any, Any]) -> np.ndarray:
    """(N, 7) from a dict's values, each 7 numbers or (4, 4)."""
    values = list(poses.values())
    if not values:
        return np.empty((0, 7))
    if set(map(type, values)) <= {list, tuple} and set(map(len, values)) == {7}:
        entries = list(chain.from_iterable(values))
        if set(map(type, entries)) <= _NUMBERS:
            try:
                return np.fromiter(entries, np.float64, len(entries)).reshape(-1, 7)
            except OverflowError:  # an error below names the body
                pass
    if not is_masked(values):
        try:
            array = np.array(values)
            if array.ndim == 2 and array.shape[1] == 7 and array.dtype.kind in "fiu":
                return array.astype(np.float64, copy=False)
        except (TypeError, ValueError):
            pass
    rows = np.empty((len(values), 7))
    for i, (key, value) in enumerate(poses.items()):
        rows[i] = as_one_pose(value, f"poses[{key!r}]")
    return rows
