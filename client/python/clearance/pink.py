"""pink over Clearance: a configuration whose barriers and limits read certified distances.

    import clearance.pink
    configuration = clearance.pink.Configuration(robot.model, robot.data, q, collision_model=robot.collision_model)
    pink.solve_ik(configuration, tasks, dt, "daqp", barriers=[pink.barriers.SelfCollisionBarrier(10)])

Requires the package pin-pink (tested with 4.4.0).
"""

from __future__ import annotations

from typing import Any, Optional

import numpy as np
import pinocchio
from pink import configuration

from .pinocchio import Distances


class Configuration(configuration.Configuration):  # type: ignore[misc]  # pink's types are not read here
    """A pink.Configuration, whose distanceResults have certified lower bounds.

    Has the arguments of pink.Configuration by name, and `distances`: a Distances to share between configurations.
    Default: one of its own. collisionResults are not filled.
    """

    def __init__(self, *arguments: Any, distances: Optional[Distances] = None, **named: Any):
        self._distances = distances
        super().__init__(*arguments, **named)

    def update(self, q: Optional[np.ndarray] = None) -> None:
        """Sets the configuration, and computes the distances, joint Jacobians and frames."""
        if q is not None:
            self.q = q.copy()
            self.q.setflags(write=False)
        if self.collision_model is not None:
            if self._distances is None:
                self._distances = Distances(self.collision_model)
            self._distances.compute(self.model, self.data, self.collision_data, self.q)
        pinocchio.computeJointJacobians(self.model, self.data, self.q)
        pinocchio.updateFramePlacements(self.model, self.data)
