"""Realistic drives of an arm: they follow a commanded speed for a while, and stop by themselves without a new one."""

from __future__ import annotations

import numpy as np

HOLD = 0.005  # seconds during which a command is valid
BRAKE = 30.0  # radians per second^2: deceleration of the fastest joint after a command's end; all stop at one time
RELAXED = 1e-3  # metres per second: barriers relaxed by more are given up
GRID = 1e-3  # seconds between samples of the log


def permitted(speeds: np.ndarray, scale: float, slopes: np.ndarray, given_up: float) -> np.ndarray:
    """(J,) speeds to command: the proved share, or without a proof all of them if they lead away from everything near.

    scale: StopCheck.speed_scale, which is 0 if no speed is proved, rest included or not. slopes: (N, J) metres per
    radian, of all near pairs. given_up: metres per second by which the QP relaxed its barriers; it does so by less than
    RELAXED for a barrier that it keeps.
    """
    if scale > 0:
        return scale * speeds
    leads_away = len(slopes) > 0 and given_up <= RELAXED and bool((slopes @ speeds >= 0).all())
    return speeds if leads_away else np.zeros_like(speeds)


class Drive:
    """Joint positions as a function of time: dq for HOLD after the command, then down to 0."""

    def __init__(self, q):
        self.q = np.array(q, float)
        self.start(0.0)

    def start(self, now: float) -> None:
        """Is at rest from now on."""
        self.dq, self.commanded, self.time = np.zeros_like(self.q), -np.inf, now

    def travel(self, now: float) -> float:
        """Equivalent time at full speed since the command, in seconds."""
        if not np.isfinite(self.commanded):
            return 0.0
        stop = float(np.abs(self.dq).max()) / BRAKE
        full, ramp = min(now - self.commanded, HOLD), min(max(now - self.commanded - HOLD, 0.0), stop)
        return full + (ramp - ramp**2 / (2 * stop) if stop > 0 else 0.0)

    def advance(self, now: float, log) -> np.ndarray:
        """(J,) present position of the arm; logs the positions since the last call, every GRID."""
        count = max(1, int(np.ceil((now - self.time) / GRID)))
        from_here, q = self.travel(self.time), self.q
        for t in np.linspace(self.time, now, count + 1)[1:]:
            self.q = q + (self.travel(t) - from_here) * self.dq
            log.sample(t, self.q)
        self.time = now
        return self.q

    def command(self, dq, now: float, log) -> None:
        """New speeds from now on, in rad/s."""
        self.advance(now, log)
        self.dq, self.commanded = np.array(dq), now
