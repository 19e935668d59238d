"""Poses as seven numbers or as matrices.

A pose is [x, y, z, qw, qx, qy, qz]: metres, quaternion scalar first, of the body in the world (X_wb) or, for a body
with a parent, in its parent (X_pb).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ._arguments import contiguous, to_floats

#: How far a matrix may be from rigid: entries of R^T R - 1, and of the last row. Wide enough for matrices that went
#: through float32.
RIGID_TOLERANCE = 1e-5

_LAST_ROW = np.array([0.0, 0.0, 0.0, 1.0])


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
    finite = np.asarray(np.isfinite(m).all(axis=(-2, -1)))
    safe = m if finite.all() else np.where(finite[..., None, None], m, np.eye(4))
    _check_rigid(safe, what)

    r = safe[..., :3, :3]
    xx, yy, zz = r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]
    # For an exact rotation this matrix is 4 q q^T: every column is a multiple of q. The column of the largest component
    # loses nothing to cancellation (Shepperd 1978). One more product with the matrix, whose other eigenvalues are about
    # 0, gives the quaternion nearest to a matrix that is orthogonal only to within the tolerance (Bar-Itzhack 2000).
    k = np.empty(r.shape[:-2] + (4, 4))
    k[..., 0, 0] = 1 + xx + yy + zz
    k[..., 1, 1] = 1 + xx - yy - zz
    k[..., 2, 2] = 1 - xx + yy - zz
    k[..., 3, 3] = 1 - xx - yy + zz
    k[..., 0, 1] = k[..., 1, 0] = r[..., 2, 1] - r[..., 1, 2]
    k[..., 0, 2] = k[..., 2, 0] = r[..., 0, 2] - r[..., 2, 0]
    k[..., 0, 3] = k[..., 3, 0] = r[..., 1, 0] - r[..., 0, 1]
    k[..., 1, 2] = k[..., 2, 1] = r[..., 1, 0] + r[..., 0, 1]
    k[..., 1, 3] = k[..., 3, 1] = r[..., 2, 0] + r[..., 0, 2]
    k[..., 2, 3] = k[..., 3, 2] = r[..., 2, 1] + r[..., 1, 2]
    largest = np.argmax(np.diagonal(k, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(k, largest[..., None, None], axis=-1)[..., 0]
    q = np.einsum("...ij,...j->...i", k, q)
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    q *= np.where(q[..., :1] < 0, -1.0, 1.0)

    pose = np.empty(m.shape[:-2] + (7,))
    pose[..., :3] = safe[..., :3, 3]
    pose[..., 3:] = q
    if safe is not m:
        pose[~finite] = np.nan
    return pose


def _check_rigid(m: np.ndarray, what: str) -> None:
    r = m[..., :3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        gram = np.einsum("...ji,...jk->...ik", r, r) - np.eye(3)
        skew = np.abs(gram).max(axis=(-2, -1))
        last = np.abs(m[..., 3, :] - _LAST_ROW).max(axis=-1)
        mirrored = np.linalg.det(r) < 0
    ok = (skew <= RIGID_TOLERANCE) & (last <= RIGID_TOLERANCE) & ~mirrored
    if ok.all():
        return
    index = tuple(int(i) for i in np.argwhere(~ok)[0])
    place = what + (f"[{', '.join(map(str, index))}]" if index else "")
    if last[index] > RIGID_TOLERANCE:
        why = f"its last row is {m[index + (3,)].tolist()}, expected [0, 0, 0, 1]"
    elif skew[index] > RIGID_TOLERANCE:
        why = f"its 3 x 3 block is not a rotation: an entry of R^T R - 1 is {skew[index]:.3g}"
    else:
        why = "its 3 x 3 block mirrors (determinant -1)"
    raise ValueError(f"{place}: not a rigid transform: {why}")


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


def stack_poses(poses: Mapping[Any, Any]) -> np.ndarray:
    """(N, 7) from a dict's values, each 7 numbers or (4, 4)."""
    values = list(poses.values())
    if not values:
        return np.empty((0, 7))
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
