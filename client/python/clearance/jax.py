"""Distances as a JAX function: poses or joint positions in, distances out, and their gradient back, all in the GPU's
memory.

    import jax, clearance, clearance.jax

    jax.config.update("jax_enable_x64", True)
    engine = clearance.Engine(scene, backend="cuda")
    plan = engine.prepare(bodies=bodies, pairs=pairs, fields=["distance", "gradient"]).on_device(64)
    distances = clearance.jax.Distances(engine, plan)
    cost = jax.jit(jax.value_and_grad(lambda poses: distances(poses).clip(max=0.1).sum()))
    value, by_pose = cost(poses)                # poses (K, M, 7) float64; by_pose the same

    plan = engine.prepare(joints="arm", reduce="min", fields=["distance", "gradient_joints"]).on_device(64)
    distances = clearance.jax.JointDistances(plan)
    cost = jax.jit(jax.value_and_grad(lambda positions: (0.05 - distances(positions)).clip(min=0).sum()))
    value, by_joint = cost(positions)           # positions (K, J) float64; by_joint the same

Calls work in compiled functions (jax.jit): XLA runs them in its own stream, without synchronisation with the host. They
do not support jax.vmap, since a plan has a fixed K.

JointDistances have a gradient. Of HostJointDistances, which a prepared query computes on the host, there are second
derivatives as well:

    columns = ["distance", "gradient_joints", "hessian_joints"]
    rows = engine.prepare("distances", joints="arm", reduce="min", fields=columns)
    distances = clearance.jax.HostJointDistances(rows)
    product = clearance.jax.hvp(lambda q: distances(q).sum(), positions, tangents)      # (K, J)

Requires JAX with CUDA (`pip install "jax[cuda13]"`); HostJointDistances and hvp() work without
CUDA. `import clearance` alone requires neither.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable
from typing import Any, Optional

import jax
import jax.numpy as jnp
import numpy as np

from ._arguments import did_you_mean
from ._device import xla_ffi
from ._device.host_rows import HostFunction, weighed
from ._device.plan import DevicePlan
from ._device.pose_gradient import check_joint_plan, moving_sides, pose_gradient

__all__ = ["Distances", "HostJointDistances", "JointDistances", "Rows", "hvp"]


class Rows:
    """Columns of a plan as a function of poses and positions, without a gradient.

    plan: a plan of K configurations. fields: names among the plan's columns. Default: all of them.

    Called with (K, M, 7) float64 poses of its bodies and (K, J) float64 positions of its joints, each only if it moves
    any, it returns {name: array}; shapes are the plan's shape plus the shape of a row. Raises
    ValueError for a column that the plan does not have, and TypeError for another type or shape of input.
    """

    def __init__(self, plan: DevicePlan, fields: Optional[Iterable[str]] = None, *, platform: str = "CUDA"):
        xla_ffi.register(platform)
        self.plan = plan
        self._number = xla_ffi.number_of(plan)
        self._names = list(plan.fields if fields is None else fields)
        self._columns = []
        for name in self._names:
            column = plan.column(name)
            if column is None:
                raise ValueError(f"fields: the plan has no column {name!r}{did_you_mean(name, list(plan.fields))}")
            self._columns.append(column)

    def __call__(self, poses: Any = None, positions: Any = None) -> dict[str, Any]:
        given = []
        for what, numbers, shape in (
            ("poses", poses, self.plan.poses_shape),
            ("positions", positions, self.plan.positions_shape),
        ):
            if shape[1] == 0 and numbers is None:
                continue
            array = jnp.asarray(numbers)
            if array.shape != shape or array.dtype != jnp.float64:
                raise TypeError(
                    f"{what}: expected float64 {shape}, got {array.dtype} {array.shape}"
                    + ("" if jax.config.jax_enable_x64 else " (jax_enable_x64 is off)")
                )
            given.append(array)
        call = jax.ffi.ffi_call(xla_ffi.TARGET, [self._row_type(column) for column in self._columns])
        rows = call(*given, columns=np.array([c.bit for c in self._columns], np.int64), plan=np.int64(self._number))
        return dict(zip(self._names, rows))

    def _row_type(self, column: Any) -> Any:
        per_row = self.plan.positions_shape[1:] if column is self.plan.column("gradient_joints") else column.shape
        return jax.ShapeDtypeStruct((*self.plan.shape, *per_row), column.dtype)


class Distances:
    """Distances of a plan's pairs as a function of its bodies' poses, with a gradient (jax.custom_vjp).

    plan: a plan with the columns "distance" and "gradient", for K >= 1 configurations of bodies without parents.

    Called with (K, M, 7) float64 poses it returns (K, P) float64 metres. The gradient is that of the witness points,
    and one of several if these are not unique. It is 0 for overlapping bodies, as is the distance, and NaN for a bad
    pose or a pair beyond max_distance, if the row has a nonzero weight.
    """

    def __init__(self, engine: Any, plan: DevicePlan, *, platform: str = "CUDA"):
        self.sides = moving_sides(plan, len(engine.bodies))
        self.plan = plan
        self.rows = Rows(plan, ["distance", "gradient"], platform=platform)

    def __call__(self, poses: Any) -> Any:
        return _distances(self, poses)


@functools.partial(jax.custom_vjp, nondiff_argnums=(0,))
def _distances(of: Distances, poses: Any) -> Any:
    return of.rows(poses)["distance"]


def _forward(of: Distances, poses: Any) -> Any:
    rows = of.rows(poses)
    return rows["distance"], (poses, rows["gradient"])


def _backward(of: Distances, kept: Any, by_distance: Any) -> Any:
    poses, gradient = kept
    each = weighed(jnp, by_distance, gradient)  # (K, P, 2, 6)
    by_twist = jnp.zeros((*poses.shape[:2], 6), poses.dtype)
    for side, (columns, slots) in enumerate(of.sides):
        by_twist = by_twist.at[:, slots].add(each[:, columns, side])
    return (pose_gradient(jnp, poses, by_twist),)


_distances.defvjp(_forward, _backward)


class JointDistances:
    """Distances of a plan's pairs, or the least of each configuration, as a function of joint positions, with a
    gradient (jax.custom_vjp).

    plan: a plan of joints alone, reduce "none" or "min", with the columns "distance" and "gradient_joints".

    Called with (K, J) float64 positions it returns (K, P), or (K,) for "min", float64 metres. The gradient is that of
    the witness points, as in Distances, and for "min" that of the nearest pair. Rows beyond max_distance have none.
    """

    def __init__(self, plan: DevicePlan, *, platform: str = "CUDA"):
        check_joint_plan(plan)
        self.plan = plan
        self.rows = Rows(plan, ["distance", "gradient_joints"], platform=platform)

    def __call__(self, positions: Any) -> Any:
        return _joint_distances(self, positions)


@functools.partial(jax.custom_vjp, nondiff_argnums=(0,))
def _joint_distances(of: JointDistances, positions: Any) -> Any:
    return of.rows(positions=positions)["distance"]


def _forward_joints(of: JointDistances, positions: Any) -> Any:
    rows = of.rows(positions=positions)
    return rows["distance"], rows["gradient_joints"]


def _backward_joints(of: JointDistances, gradient: Any, by_distance: Any) -> Any:
    each = weighed(jnp, by_distance, gradient)  # (K, P, J) or (K, J)
    return (each.sum(1) if each.ndim == 3 else each,)


_joint_distances.defvjp(_forward_joints, _backward_joints)


class HostJointDistances(HostFunction):
    __doc__ = HostFunction.__doc__

    def __call__(self, positions: Any) -> Any:
        return _host_column(self, 0, positions)

    def column(self, order: int, positions: Any) -> Any:
        """Returns the derivatives of this order, 0 to 2."""
        array = jnp.asarray(positions)
        shape = self.rows.shape(array.shape, array.dtype, order)
        given = jax.ShapeDtypeStruct(shape, np.float64)
        return jax.pure_callback(functools.partial(self.rows.column, order), given, array, vmap_method="sequential")


@functools.partial(jax.custom_jvp, nondiff_argnums=(0, 1))
def _host_column(of: HostJointDistances, order: int, positions: Any) -> Any:
    return of.column(order, positions)


@_host_column.defjvp  # type: ignore[untyped-decorator]
def _host_jvp(of: HostJointDistances, order: int, primals: Any, tangents: Any) -> Any:
    (positions,), (moves,) = primals, tangents
    if order == 2:
        raise NotImplementedError("HostJointDistances: there are no third derivatives")
    slopes = _host_column(of, order + 1, positions)
    between = slopes.ndim - 2
    return _host_column(of, order, positions), (slopes * moves.reshape(len(moves), *[1] * between, -1)).sum(-1)


def hvp(function: Any, positions: Any, tangents: Any) -> Any:
    """Returns the product of the Hessian of a scalar function with `tangents`, in the shape of `positions`.

    function: of positions, twice differentiable by JAX, such as a sum of HostJointDistances.
    """
    return jax.jvp(jax.grad(function), (positions,), (tangents,))[1]
