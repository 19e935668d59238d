"""Distances as a PyTorch function: poses or joint positions in, distances out, and their gradient back, all in the
GPU's memory.

    import torch, clearance, clearance.torch

    engine = clearance.Engine(scene, backend="cuda")
    plan = engine.prepare(bodies=bodies, pairs=pairs, fields=["distance", "gradient"]).on_device(64)
    distances = clearance.torch.Distances(engine, plan)
    d = distances(poses)                        # (K, P); poses (K, M, 7) float64, which may want a gradient
    d.clamp(max=0.1).sum().backward()           # poses.grad: (K, M, 7)

    plan = engine.prepare(joints="arm", reduce="min", fields=["distance", "gradient_joints"]).on_device(64)
    distances = clearance.torch.JointDistances(plan)
    d = distances(positions)                    # (K,); positions (K, J) float64
    (0.05 - d).clamp(min=0).sum().backward()    # positions.grad: (K, J)

JointDistances have a gradient. Of HostJointDistances, which a prepared query computes on the host, there are second
derivatives as well:

    columns = ["distance", "gradient_joints", "hessian_joints"]
    rows = engine.prepare("distances", joints="arm", reduce="min", fields=columns)
    distances = clearance.torch.HostJointDistances(rows)
    product = clearance.torch.hvp(lambda q: distances(q).sum(), positions, tangents)     # (K, J)

Requires PyTorch with CUDA (`pip install torch`); HostJointDistances and hvp() work without CUDA. `import
clearance` alone requires neither.
"""

from __future__ import annotations

from typing import Any

import torch

from ._device.host_rows import HostFunction, HostRows, weighed
from ._device.plan import DevicePlan
from ._device.pose_gradient import check_joint_plan, moving_sides, pose_gradient

__all__ = ["Distances", "HostJointDistances", "JointDistances", "hvp"]


class _Run(torch.autograd.Function):  # type: ignore[misc]  # where torch is not installed it is Any
    @staticmethod
    def forward(ctx: Any, poses: Any, distances: Distances) -> Any:
        plan = distances.plan
        out = {"distance": poses.new_empty(plan.shape), "gradient": poses.new_empty((*plan.shape, 2, 6))}
        plan(poses.detach().contiguous(), out=out, stream=torch.cuda.current_stream(poses.device))
        ctx.save_for_backward(poses, out["gradient"])
        ctx.distances = distances
        return out["distance"]

    @staticmethod
    def backward(ctx: Any, *grads: Any) -> tuple[Any, None]:
        poses, gradient = ctx.saved_tensors
        each = weighed(torch, grads[0], gradient)  # (K, P, 2, 6)
        by_twist = poses.new_zeros((*poses.shape[:2], 6))
        for side, (columns, slots) in enumerate(ctx.distances.sides):
            by_twist.index_add_(1, slots, each[:, columns, side])
        return pose_gradient(torch, poses, by_twist), None


class Distances:
    """Distances of a plan's pairs as a function of its bodies' poses, with a gradient.

    plan: a plan with the columns "distance" and "gradient", for K >= 1 configurations of bodies without parents.

    Called with (K, M, 7) float64 poses on the plan's GPU it returns (K, P) float64 metres, in the current stream. The
    gradient is that of the witness points, and one of several if these are not unique. It is 0 for overlapping bodies,
    as is the distance, and NaN for a bad pose or a pair beyond max_distance, if the row has a nonzero weight.
    """

    def __init__(self, engine: Any, plan: DevicePlan):
        device = f"cuda:{plan.device}"
        self.plan = plan
        #: For each side of the pairs: the pairs with a moving body on that side, and its index among the bodies.
        self.sides = [
            tuple(torch.as_tensor(places, device=device) for places in side)
            for side in moving_sides(plan, len(engine.bodies))
        ]

    def __call__(self, poses: Any) -> Any:
        return _Run.apply(poses, self)


class _JointRun(torch.autograd.Function):  # type: ignore[misc]
    @staticmethod
    def forward(ctx: Any, positions: Any, plan: DevicePlan) -> Any:
        out = {
            "distance": positions.new_empty(plan.shape),
            "gradient_joints": positions.new_empty((*plan.shape, positions.shape[-1])),
        }
        stream = torch.cuda.current_stream(positions.device)
        plan(out=out, stream=stream, positions=positions.detach().contiguous())
        ctx.save_for_backward(out["gradient_joints"])
        return out["distance"]

    @staticmethod
    def backward(ctx: Any, *grads: Any) -> tuple[Any, None]:
        (gradient,) = ctx.saved_tensors
        each = weighed(torch, grads[0], gradient)  # (K, P, J) or (K, J)
        return (each.sum(1) if each.dim() == 3 else each), None


class JointDistances:
    """Distances of a plan's pairs, or the least of each configuration, as a function of joint positions, with a
    gradient.

    plan: a plan of joints alone, reduce "none" or "min", with the columns "distance" and "gradient_joints".

    Called with (K, J) float64 positions on the plan's GPU it returns (K, P), or (K,) for "min", float64 metres, in the
    current stream. The gradient is that of the witness points, as in Distances, and for "min" that of the nearest pair.
    """

    def __init__(self, plan: DevicePlan):
        check_joint_plan(plan)
        self.plan = plan

    def __call__(self, positions: Any) -> Any:
        return _JointRun.apply(positions, self.plan)


def _host_column(rows: HostRows, order: int, positions: Any) -> Any:
    given = positions.detach().cpu()
    rows.shape(tuple(given.shape), str(given.dtype).removeprefix("torch."), order)
    return torch.as_tensor(rows.column(order, given.numpy()).copy(), device=positions.device)


class _HostRun(torch.autograd.Function):  # type: ignore[misc]
    @staticmethod
    def forward(ctx: Any, positions: Any, rows: HostRows) -> Any:
        ctx.save_for_backward(positions)
        ctx.rows = rows
        return _host_column(rows, 0, positions)

    @staticmethod
    def backward(ctx: Any, *grads: Any) -> tuple[Any, None]:
        (positions,) = ctx.saved_tensors
        return _HostGradient.apply(positions, grads[0], ctx.rows), None


class _HostGradient(torch.autograd.Function):  # type: ignore[misc]
    """The gradient of a sum of distances with weights."""

    @staticmethod
    def forward(ctx: Any, positions: Any, weights: Any, rows: HostRows) -> Any:
        gradient = _host_column(rows, 1, positions)
        ctx.save_for_backward(positions, weights, gradient)
        ctx.rows = rows
        each = weighed(torch, weights, gradient)
        return each.flatten(1, -2).sum(1) if each.dim() > 2 else each

    @staticmethod
    @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator]
    def backward(ctx: Any, *grads: Any) -> tuple[Any, Any, None]:
        positions, weights, gradient = ctx.saved_tensors
        moves = grads[0].reshape(len(positions), *[1] * (gradient.dim() - 2), -1)
        bent = (_host_column(ctx.rows, 2, positions) * moves.unsqueeze(-2)).sum(-1)
        by_position = weighed(torch, weights, bent)
        return by_position.flatten(1, -2).sum(1) if bent.dim() > 2 else by_position, (gradient * moves).sum(-1), None


class HostJointDistances(HostFunction):
    __doc__ = HostFunction.__doc__

    def __call__(self, positions: Any) -> Any:
        return _HostRun.apply(positions, self.rows)


def hvp(function: Any, positions: Any, tangents: Any) -> Any:
    """Returns the product of the Hessian of a scalar function with `tangents`, in the shape of `positions`.

    function: of positions, twice differentiable by PyTorch, such as a sum of HostJointDistances.
    """
    given = positions.detach().requires_grad_()
    (gradient,) = torch.autograd.grad(function(given), given, create_graph=True)
    return torch.autograd.grad(gradient, given, tangents)[0]
