"""Pinocchio's distances by Clearance: fills the results that pink's barriers and other code read.

    import clearance.pinocchio
    distances = clearance.pinocchio.Distances(robot.collision_model)
    distances.compute(robot.model, data, geometry_data, q)        # in place of pinocchio.computeDistances()

Requires the package pin (tested with 4.1.0 and 3.8.0).
"""

from __future__ import annotations

import importlib
from typing import Any, Optional

import numpy as np
import pinocchio

from ._adapters.pinocchio import from_pinocchio
from ._front.engine import Engine
from ._words import Status

coal = importlib.import_module("coal")


class Distances:
    """Distances of the collision pairs of a pinocchio.GeometryModel, which must not change.

    engine: an Engine of from_pinocchio(geometry_model). Default: one of its own.

    Raises as from_pinocchio(geometry_model) does.
    """

    def __init__(self, geometry_model: Any, engine: Optional[Engine] = None):
        self._model = geometry_model
        self.engine = Engine(from_pinocchio(geometry_model)) if engine is None else engine
        names = [item.name for item in geometry_model.geometryObjects]
        self._pairs = [(names[pair.first], names[pair.second]) for pair in geometry_model.collisionPairs]
        self._query = (
            self.engine.prepare(
                pairs=self._pairs, bodies=names, signed_distance=True, fields=("lower", "status", "normal", "points")
            )
            if self._pairs
            else None
        )
        # Coal sets the nearest points of a result only itself: here to those of two points.
        self._point, self._places = coal.Sphere(0.0), (coal.Transform3s(), coal.Transform3s())
        self._request = coal.DistanceRequest()

    def compute(self, model: Any, data: Any, geometry_data: Any, q: Any) -> None:
        """Places the objects at configuration q, and fills geometry_data.distanceResults."""
        pinocchio.updateGeometryPlacements(model, data, self._model, geometry_data, q)
        self.fill(geometry_data)

    def fill(self, geometry_data: Any) -> None:
        """Fills distanceResults of a pinocchio.GeometryData for the placements oMg that it has.

        min_distance is the certified lower bound, in metres, below 0 by the depth of an overlap; the nearest points are
        in the world, and normal is the unit direction from the first to the second object.

        Raises ValueError, naming the pair, for a placement with NaN, and if geometry_data is of another model.
        """
        if len(geometry_data.distanceResults) != len(self._pairs):
            raise ValueError(
                f"geometry_data: expected one of the {len(self._pairs)} pairs of this model, "
                f"got {len(geometry_data.distanceResults)}"
            )
        if self._query is None:
            return
        r = self._query.run(np.array([[placement.homogeneous for placement in geometry_data.oMg]]))
        bad = r.status[0] >= Status.BAD_POSE
        if bad.any():
            pair, status = self._pairs[int(bad.argmax())], Status(r.status[0][bad][0])
            raise ValueError(f"geometry_data: {' and '.join(map(repr, pair))}: {status.name}")
        rows = zip(r.lower[0].tolist(), r.normal[0], r.point_a[0], r.point_b[0])
        for result, (lower, normal, *points) in zip(geometry_data.distanceResults, rows):
            for place, point in zip(self._places, points):
                place.setTranslation(point)
            result.clear()
            coal.distance(self._point, self._places[0], self._point, self._places[1], self._request, result)
            result.min_distance = lower
            result.normal = normal
