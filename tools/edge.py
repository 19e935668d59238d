"""An edge that is free by sampling, and the proof of a collision: the arm of scenes/cell/probe.yaml turns by 0.6 rad.

Samples 0.02 rad apart, as planners take them, are all proved free; between two of them the probe goes through a sheet.
The certified answer contains the time, and a certificate of that configuration proves it to any independent checker.
"""
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import clearance

SCENE = Path(__file__).resolve().parents[1] / "scenes/cell/probe.yaml"
TURN = 0.6  # radians, of the first joint
STEP = 0.02  # radians between samples


@dataclass(frozen=True)
class Sampled:
    """Results of samples of the edge."""

    count: int
    free: bool  #: every pair is proved apart at each of them
    nearest: float  #: metres: lower bound of all pairs at all samples


@dataclass(frozen=True)
class Proved:
    """Results of the whole edge."""

    status: clearance.Status
    bodies: tuple[str, str]
    free_until: float  #: share of the edge up to which every pair is proved apart
    contact: float  #: share of the edge at which two bodies are proved to overlap
    witness: clearance.Certificate  #: of the two bodies, at `contact`


class Edge:
    """The scene's arm at home, and after the turn."""

    def __init__(self):
        self.engine = clearance.Engine(clearance.Scene.load(SCENE), backend="cpu", threads=1)
        self.joints = self.engine.joints("arm")
        self.start = np.array([state.position for state in self.engine.joint_states()])
        self.end = self.start + TURN * (np.arange(len(self.start)) == 0)

    def at(self, times):
        """(K, J) positions at times from 0 to 1."""
        return self.start + np.asarray(times)[:, None] * (self.end - self.start)

    def times(self, step):
        """Times of samples at most `step` radians apart, including both ends."""
        return np.linspace(0.0, 1.0, int(np.ceil(TURN / step - 1e-9)) + 1)

    def sampled(self, step=STEP):
        rows = self.at(self.times(step))
        r = self.engine.distances(reduce="min", joints=self.joints, configurations=rows)
        return Sampled(len(rows), bool(np.all(r.lower > 0)), float(r.lower.min()))

    def proved(self):
        fields = ("status", "pair", "first_contact")
        r = self.engine.motions([self.start], [self.end], joints=self.joints, reduce="any", fields=fields)
        pair, contact = r.pair[0].tolist(), float(r.first_contact[0, 1])
        status, free_until = clearance.Status(r.status[0]), float(r.first_contact[0, 0])
        if not contact <= 1:
            raise RuntimeError(f"{SCENE}: this edge is not proved to be in contact any more ({status.name})")
        witness = self.certificate([contact], pair)
        return Proved(status, tuple(self.engine.bodies[i].name for i in pair), free_until, contact, witness)

    def certificate(self, times, pair):
        """Proof of the relation of two bodies at these times."""
        return self.engine.certificate(pairs=[tuple(pair)], joints=self.joints, configurations=self.at(times))
