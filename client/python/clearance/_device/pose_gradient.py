"""Shared code of the PyTorch and JAX functions: converts gradients by twists to gradients by poses."""

from __future__ import annotations

from typing import Any

import numpy as np

from .plan import DevicePlan


def pose_gradient(xp: Any, poses: Any, by_twist: Any) -> Any:
    """Converts a gradient by twists to a gradient by the seven numbers of poses.

    xp: the arrays' module (numpy, torch, jax.numpy). poses: (..., 7) [x, y, z, qw, qx, qy, qz]. by_twist: (..., 6), by
    a rotation about the body's origin (m/rad) and a translation (m/m), world axes. Returns (..., 7), with 0 along the
    quaternion itself, whose length has no effect.
    """
    q, turn = poses[..., 3:], by_twist[..., :3]
    w, v = q[..., :1], q[..., 1:]
    scale = 2 / (q * q).sum(-1)[..., None]
    by_w = -scale * (turn * v).sum(-1)[..., None]
    by_v = scale * (w * turn + xp.linalg.cross(turn, v))
    return xp.concatenate([by_twist[..., 3:], by_w, by_v], -1)


def check_columns(plan: DevicePlan, *names: str) -> None:
    """Raises ValueError for the first column that the plan does not write."""
    for name in names:
        if name not in plan.fields:
            raise ValueError(f"plan: expected the column {name!r} among its fields, got {list(plan.fields)}")


def check_joint_plan(plan: DevicePlan) -> None:
    """Raises ValueError where it has no gradient by joints, or moves bodies."""
    check_columns(plan, "distance", "gradient_joints")
    if plan.joints is None or plan.bodies is not None:
        raise ValueError("plan: expected configurations of joints alone")


def moving_sides(plan: DevicePlan, bodies: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Of each side of a plan's pairs: which of them have a body there that moves, and its place among its bodies.

    bodies: how many the scene has. Raises ValueError where the plan has no gradient.
    """
    check_columns(plan, "distance", "gradient")
    if len(plan.shape) != 2:
        raise ValueError("plan: expected rows of all pairs (reduce='none')")
    if plan.joints is not None:
        raise ValueError("plan: expected bodies alone; of joints there is JointDistances")
    if plan.bodies is None:
        raise ValueError("plan: expected configurations of bodies, as the current poses have no gradient")
    slot_of = np.full(bodies, -1)
    slot_of[plan.bodies] = np.arange(len(plan.bodies))
    sides = []
    for side in range(2):
        slots = slot_of[plan.pairs[:, side]]
        columns = np.flatnonzero(slots >= 0)
        sides.append((columns, slots[columns]))
    return sides
