#!/usr/bin/env python3
"""MotionBenchMaker's problems: is a state valid, and how near is it to contact? Clearance, Pinocchio and Coal.

    bench/run.py robots [--robots panda ur5 fetch baxter] [--problems 50] [--states 1000] [--csv FILE]

Every contender gets each problem's start, goal and the random states, and computes its own kinematics. Free and
colliding states are timed separately, because a colliding one needs only the first contact. Contenders alternate. A row
has processor time (over shared memory: wall time) per state, and its ratio to the best of Pinocchio and Coal's
variants. Decisions and distances are compared: if they contradict each other by more than Coal's error, an independent
checker (tools/check_certificate.py) checks our certificate. Exit code 1 if it rejects one.
"""

import sys
import time

import numpy as np

import problems
from contenders import Clearance, PinocchioCoal
from harness import shown, stamped, timed, write
from processes import Stage
from service import start_daemon

NEAR = 1e-6  # metres: accepted error of Coal's decisions


def limits_of(model, joints):
    """(J, 2): range of random states."""
    found = []
    for name in joints:
        joint = model.joints[model.getJointId(name)]
        turns = joint.nq == 2
        low, high = model.lowerPositionLimit, model.upperPositionLimit
        found.append((-np.pi, np.pi) if turns else (low[joint.idx_q], high[joint.idx_q]))
    return np.array(found)


class Measurement:
    """One robot's contenders over its problems."""

    def __init__(self, robot, contenders, seconds_of):
        self.robot, self.contenders, self.seconds_of = robot, contenders, seconds_of
        self.seconds, self.states = {}, {}  # by (query, kind of state, way); seconds of each round
        self.verdicts, self.near, self.contested, self.unproved = 0, 0, 0, 0

    def run(self, problem, Q, rounds):
        for contender in self.contenders:
            contender.begin(problem)
        try:
            ours, peer = self.contenders[0], self.contenders[-1]
            free = ours.ways()["valid"]["Clearance in process"](Q)
            self.compare(problem, Q, free, ours, peer)
            for kind, states in (("free", Q[free]), ("colliding", Q[~free])):
                if len(states):
                    self.time(kind, states, rounds)
        finally:
            for contender in self.contenders:
                contender.end()
        return np.count_nonzero(free)

    def compare(self, problem, Q, free, ours, peer):
        """Counts decisions and distances that contradict each other by more than Coal's error."""
        lower, upper = ours.ways()["least"]["Clearance in process"](Q)
        theirs = next(iter(peer.ways()["valid"].values()))(peer.states(Q))
        distance, _ = peer.ways()["least"]["Coal"](peer.states(Q))
        self.verdicts += len(Q)
        differs = free != theirs
        self.near += int((differs & (lower <= NEAR)).sum())
        outside = (distance < lower - NEAR) | (distance > upper + NEAR)
        for i in (differs & (lower > NEAR) | outside).nonzero()[0]:
            proved = ours.proves(Q[i])
            self.contested += 1
            self.unproved += not proved
            print(f"  {problem.name}: state {i}: we say [{lower[i]:.9f}, {upper[i]:.9f}] {bool(free[i])}, Coal "
                  f"{distance[i]:.9f} {bool(theirs[i])}; our certificate is {'proved' if proved else 'NOT proved'}",
                  flush=True)

    def time(self, kind, Q, rounds):
        ways = [
            (question, name, way, contender.states(Q), contender)
            for contender in self.contenders
            for question, named in contender.ways().items()
            for name, way in named.items()
        ]
        for number in range(rounds):
            for question, name, way, states, contender in ways if number % 2 else reversed(ways):
                key = question, kind, name
                self.seconds.setdefault(key, [0.0] * rounds)[number] += self.seconds_of(contender, way, states)
        for question, name, *_ in ways:
            key = question, kind, name
            self.states[key] = self.states.get(key, 0) + len(Q)

    def rows(self):
        for question in ("valid", "least"):
            for kind in ("free", "colliding"):
                found = {k: v for k, v in self.seconds.items() if k[:2] == (question, kind)}
                if not found:
                    continue
                peers = [v for k, v in found.items() if k[2].startswith("Coal")]
                best = np.min(peers, axis=0)
                for key, seconds in found.items():
                    us = 1e6 * np.median(seconds) / self.states[key]
                    yield {
                        "robot": self.robot,
                        "question": question,
                        "states": kind,
                        "count": self.states[key],
                        "contender": key[2],
                        "us_a_state": f"{us:.3g}",
                        "times_coal": f"{np.median(best / seconds):.3g}",
                    }


def seconds_of(contender, way, states):
    """Processor time in this process, or wall time if a daemon computes."""
    clock = time.perf_counter if getattr(contender, "url", None) else time.process_time
    return timed(way, states, clock=clock)[0]


def states_of(problem, joints, limits, count, rng):
    ends = [[at[j] for j in joints] for at in (problem.start, problem.goal)]
    return np.concatenate([ends, rng.uniform(limits[:, 0], limits[:, 1], (count, len(joints)))])


def scene_file_of(robot, resources):
    """A scene file with the robot alone, for the daemon; links are hulls, as for the peers."""
    urdf, srdf = problems.urdf_of(resources, robot)
    path = resources / f"{robot}.yaml"
    path.write_text(
        f"robots:\n  - {{name: {robot}, urdf: {robot}/{urdf.name}, srdf: {robot}/{srdf.name}, "
        f"packages: {{{robot}: {robot}}}, mesh_as: hull}}\n"
    )
    return path


def measure(options, robot, resources):
    requested = problems.load(resources, robot, options.problems)
    joints = list(requested[0].goal)
    peer = PinocchioCoal(resources, joints, robot)
    limits = limits_of(peer.model, joints)
    with Stage() as stage:
        _, urls, _ = start_daemon(stage, scene_file_of(robot, resources), options=["--threads", "1"])
        files = resources, joints, robot
        contenders = [Clearance(*files), Clearance(*files, url=urls["shm"]), peer]
        measurement = Measurement(robot, contenders, seconds_of)
        for number, problem in enumerate(requested):
            rng = np.random.default_rng([number, options.seed])
            free = measurement.run(problem, states_of(problem, joints, limits, options.states, rng), options.rounds)
            print(f"{problem.name}: {free} of {options.states + 2} states free", flush=True)
    print(f"{robot}: {measurement.verdicts} verdicts, {measurement.near} differ within {NEAR} m of contact. "
          f"{measurement.contested} answers contradict each other: an independent checker finds ours proved in "
          f"{measurement.contested - measurement.unproved} of them")
    return list(measurement.rows()), measurement.unproved


def main():
    parser = problems.parser(__doc__, "panda ur5 fetch baxter", seed=1)
    parser.add_argument("--problems", type=int, default=50, help="of each family: numbers 1 to this")
    parser.add_argument("--states", type=int, default=1000, help="random ones of each problem")
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    resources = problems.fetch()
    rows, unproved = [], 0
    for robot in options.robots:
        more, open_ones = measure(options, robot, resources)
        rows += shown(more)
        unproved += open_ones
    requested = f"problems 1 to {options.problems} of each family, {options.states} random states of each"
    write(rows, options.csv, stamped(requested))
    return 1 if unproved else 0


if __name__ == "__main__":
    sys.exit(main())
