"""The terms of a protective separation distance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .stop import Braking, Stops


@dataclass(frozen=True)
class Separation:
    """Terms of the protective separation distance of ISO 10218-2:2025 (ISO/TS 15066) from one body, in metres.

    Upper bounds each, except `distance`, which contains Z_d and Z_r as far as the scene declares them (`uncertainty`,
    `padding`). Others are the caller's.
    """

    body: str
    distance: tuple[float, float]  #: S: bounds of the distance now, as if the body were where its pose is
    age_s: float  #: age of that pose, in seconds; of those that it follows, if one is older
    human: float  #: S_h: how far the body may have come since its pose, and until standstill
    reaction: float  #: S_r: how much nearer the robot comes to that pose while it reacts
    stopping: float  #: S_s: how much nearer it comes while it brakes
    intrusion: float  #: C: the margin

    @property
    def required(self) -> float:
        """S_p without Z_d and Z_r."""
        return self.human + self.reaction + self.stopping + self.intrusion

    @property
    def left(self) -> float:
        """By how much the distance exceeds the required one; if it is above 0, the robot stops before any contact."""
        return self.distance[0] - self.required


def separations(front: Any, positions: Any, velocities: Any, arguments: dict[str, Any]) -> tuple[Separation, ...]:
    """Implements Front.explain_stop(). arguments: those of check_stop() by name."""
    stops = front.prepare("check_stop", **arguments)._call
    assert isinstance(stops, Stops)
    q, v, law = stops.row(positions, "positions"), stops.row(velocities, "velocities"), stops.law
    motions, seconds = _motions(q, v, law)
    query = stops.query
    assert query.joints is not None
    table = front._table(query.pairs, None, query.joints.ids)
    movers = stops.movers() if law.others else None
    found = []
    for body in movers.of if movers else ():
        assert movers is not None
        pairs = table[(table == body).any(axis=1)]
        if not len(pairs):
            continue
        now = front.distances(pairs, q[None], joints=query.joints, reduce="min", fields="default")
        least = front.motions(motions, joints=query.joints, pairs=pairs, abs_tol=1e-4)
        low, high = float(now.lower[0]), float(now.upper[0])
        reacting, until = float(least.lower[0]), float(least.lower.min())
        found.append(
            Separation(
                query.names.body_names[body],
                (low, high),
                max(movers.age_s[mover] for mover in movers.of[body]),
                max(movers.reach(a, b, seconds) for a, b in pairs.tolist()),
                max(high - reacting, 0.0),
                max(float(least.upper[0]) - until, 0.0),
                query.margin,
            )
        )
    return tuple(found)


def _motions(q: np.ndarray, v: np.ndarray, law: Braking) -> tuple[np.ndarray, float]:
    """Returns control points: first those of the reaction, then those of braking; and the seconds to standstill."""
    path, seconds = law.path(q, v, 1.0)
    reacted = q + v * law.reaction_s
    if law.together:
        return np.stack((np.stack((q, reacted)), np.stack((reacted, path[0, 1])))), seconds
    if law.reaction_s > 0 and len(path) > 1:
        return path, seconds
    return np.concatenate((np.repeat(q[None, None], path.shape[1], axis=1), path)), seconds
