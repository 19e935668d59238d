"""Distances and their derivatives by joints, from a prepared query on the host, for the JAX and PyTorch functions."""

from __future__ import annotations

from typing import Any

import numpy as np

#: Columns by the order of the derivative.
COLUMNS = ("distance", "gradient_joints", "hessian_joints")


class HostRows:
    """The rows of a prepared query of joints alone. Raises ValueError for another query."""

    def __init__(self, prepared: Any):
        query = prepared._query
        if query.joints is None or query.bodies is not None:
            raise ValueError("prepared: expected configurations of joints alone")
        self._prepared = prepared
        self.joints = query.joint_count
        answer = prepared.run(np.zeros((1, self.joints)))
        for name in COLUMNS:
            if name not in answer.columns:
                raise ValueError(f"prepared: expected the column {name!r} among its fields, got {list(answer.columns)}")
        if answer.reduce == "within":
            raise ValueError("prepared: the rows of reduce='within' vary")
        self._rows = answer.distance.shape[1:]

    def shape(self, positions: tuple[int, ...], dtype: Any, order: int) -> tuple[int, ...]:
        """Returns the shape of a column. Raises TypeError unless positions are (K, J) float64."""
        if len(positions) != 2 or positions[1] != self.joints or np.dtype(dtype) != np.float64:
            raise TypeError(f"positions: expected float64 (K, {self.joints}), got {dtype} {tuple(positions)}")
        return (positions[0], *self._rows, *[self.joints] * order)

    def column(self, order: int, positions: Any) -> np.ndarray:
        """Returns the derivatives of this order at (K, J) positions."""
        return getattr(self._prepared.run(np.ascontiguousarray(positions)), COLUMNS[order])


class HostFunction:
    """Distances of a prepared query as a function of joint positions, with first and second derivatives. The query
    runs on the host.

    prepared: a query of distances() of joints alone with the columns "distance", "gradient_joints" and
        "hessian_joints", reduce "none", "min" or "nearest" with `k`.

    Called with (K, J) float64 positions it returns float64 metres, (K, P), (K,) or (K, k). Derivatives are those of the
    features that meet: one of several where these change, NaN where there are none (Result.hessian_joints).
    """

    def __init__(self, prepared: Any):
        self.rows = HostRows(prepared)


def weighed(xp: Any, weights: Any, gradient: Any) -> Any:
    """weights (...) times gradient (..., and more); 0 where a weight is: rows that are beyond have no gradient.

    xp: the arrays' module (torch, jax.numpy).
    """
    each = weights.reshape(weights.shape + (1,) * (gradient.ndim - weights.ndim))
    return xp.where(each == 0, 0.0, each * gradient)
