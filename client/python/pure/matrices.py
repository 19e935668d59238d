"""Conversion of homogeneous matrices to poses in numpy, as in client/python/bindings/matrices.h, which explains it."""

from __future__ import annotations

import numpy as np


def poses_of_matrices(m: np.ndarray, tolerance: float, poses: np.ndarray) -> int:
    """Converts m, (N, 4, 4) float64, to poses, (N, 7). Returns the index of the first that is not rigid, or -1."""
    finite = np.isfinite(m).all(axis=(-2, -1))
    safe = m if finite.all() else np.where(finite[..., None, None], m, np.eye(4))
    r = safe[:, :3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        gram = np.einsum("nji,njk->nik", r, r) - np.eye(3)
        off = np.abs(gram).max(axis=(-2, -1), initial=0)
        off = np.maximum(off, np.abs(safe[:, 3, :] - [0.0, 0.0, 0.0, 1.0]).max(axis=-1))
        ok = (off <= tolerance) & (np.linalg.det(r) > 0)
    if not ok.all():
        return int(np.argmin(ok))
    xx, yy, zz = r[:, 0, 0], r[:, 1, 1], r[:, 2, 2]
    k = np.empty((len(m), 4, 4))
    k[:, 0, 0] = 1 + xx + yy + zz
    k[:, 1, 1] = 1 + xx - yy - zz
    k[:, 2, 2] = 1 - xx + yy - zz
    k[:, 3, 3] = 1 - xx - yy + zz
    k[:, 0, 1] = k[:, 1, 0] = r[:, 2, 1] - r[:, 1, 2]
    k[:, 0, 2] = k[:, 2, 0] = r[:, 0, 2] - r[:, 2, 0]
    k[:, 0, 3] = k[:, 3, 0] = r[:, 1, 0] - r[:, 0, 1]
    k[:, 1, 2] = k[:, 2, 1] = r[:, 1, 0] + r[:, 0, 1]
    k[:, 1, 3] = k[:, 3, 1] = r[:, 2, 0] + r[:, 0, 2]
    k[:, 2, 3] = k[:, 3, 2] = r[:, 2, 1] + r[:, 1, 2]
    largest = np.argmax(np.diagonal(k, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(k, largest[:, None, None], axis=-1)[..., 0]
    q = np.einsum("nij,nj->ni", k, q)
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    q *= np.where(q[:, :1] < 0, -1.0, 1.0)
    poses[:, :3] = safe[:, :3, 3]
    poses[:, 3:] = q
    poses[~finite] = np.nan
    return -1
