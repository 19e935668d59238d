#!/usr/bin/env python3
"""MotionBenchMaker's problems: is a state valid, and how near is it to contact? Clearance, Pinocchio and Coal.

    bench/run.py robots [--robots panda ur5 fetch baxter] [--problems 50] [--states 4096] [--csv FILE]

Every contender gets each problem's start, goal and the random states, and computes its own kinematics. Free and
colliding states are timed separately, because a colliding one needs only the first contact. Contenders alternate. A
row has processor time (over shared memory: wall time) per state, its ratio to the best of Pinocchio and
Coal's variants, and its ratio to Clearance without covers. Coal gets the first 256 states, as do calls of one state.

Decisions with covers are compared with those without, also near start and goal and for margins. Decisions and distances
are compared with Coal's: if they contradict each other by more than Coal's error, an independent checker
(tools/check_certificate.py) checks our certificate. Exit code 1 if it rejects one, or if covers change a decision.
With --rounds 0 nothing is timed, and Coal is left out.
"""

import contextlib
import subprocess
import sys
import tempfile
import time

import numpy as np

import problems
from contenders import QUERIES, Clearance, PinocchioCoal
from harness import ROOT, shown, stamped, timed, write
from processes import Stage
from service import start_daemon

NEAR = 1e-6  # metres: accepted error of Coal's decisions
FEW = 256  # states for Coal and for calls of one state
MARGINS = (0.0, 0.005, 0.02)
COVERS = ("off", "background")
PROGRAM = ROOT / "build/bin/clearance-prepared"


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
    """One robot's contenders over its problems: Clearance in process without and with covers, over shared memory the
    same, and Coal."""

    def __init__(self, robot, contenders, seconds_of):
        self.robot, self.contenders, self.seconds_of = robot, contenders, seconds_of
        self.seconds, self.states = {}, {}  # by (query, kind of state, way, covers); seconds of each round
        self.verdicts, self.near, self.contested, self.unproved = 0, 0, 0, 0
        self.decided, self.changed, self.more = 0, 0, 0

    def run(self, problem, Q, near, rounds):
        for contender in self.contenders:
            contender.begin(problem)
        try:
            self.compare_covers(problem, np.concatenate([Q, near]))
            without, peer = self.contenders[0], self.contenders[-1]
            free = without.free(Q)
            if rounds:
                self.compare(problem, Q[:FEW], free[:FEW], without, peer)
                for kind, states in (("free", Q[free]), ("colliding", Q[~free])):
                    if len(states):
                        self.time(kind, states, rounds)
                        self.time_program(kind, states[:FEW], rounds)
        finally:
            for contender in self.contenders:
                contender.end()
        return np.count_nonzero(free)

    def compare_covers(self, problem, Q):
        """Counts decisions that covers change, and those that only covers make."""
        without, with_covers = self.contenders[:2]
        for margin in MARGINS:
            expected, found = (
                each.requested.check(Q, joints=each.joints, margin=margin) for each in (without, with_covers)
            )
            decided = expected.free | expected.hit
            changed = decided & ((found.free != expected.free) | (found.hit != expected.hit))
            changed |= expected.hit & found.hit & (found.pair != expected.pair).any(axis=1)
            self.decided += int(decided.sum())
            self.changed += int(changed.sum())
            self.more += int((~decided & (found.free | found.hit)).sum())
            for i in changed.nonzero()[0][:3]:
                print(f"  {problem.name}: margin {margin}: covers change the decision on {Q[i].tolist()}", flush=True)

    def compare(self, problem, Q, free, ours, peer):
        """Counts decisions and distances that contradict each other by more than Coal's error."""
        lower, upper = ours.least(Q)
        theirs, (distance, _) = peer.free(peer.states(Q)), peer.least(peer.states(Q))
        self.verdicts += len(Q)
        differs = free != theirs
        self.near += int((differs & (lower <= NEAR)).sum())
        outside = (distance < lower - NEAR) | (distance > upper + NEAR)
        for i in (differs & (lower > NEAR) | outside).nonzero()[0]:
            proved = ours.proves(Q[i])
            self.contested += 1
            self.unproved += not proved
            print(
                f"  {problem.name}: state {i}: we say [{lower[i]:.9f}, {upper[i]:.9f}] {bool(free[i])}, Coal "
                f"{distance[i]:.9f} {bool(theirs[i])}; our certificate is {'proved' if proved else 'NOT proved'}",
                flush=True,
            )

    def time(self, kind, Q, rounds):
        ways = []
        for contender in self.contenders:
            few, covers = contender.states(Q[:FEW]), getattr(contender, "covers", "")
            for question, named in contender.ways().items():
                for name, way in named.items():
                    states = Q if covers and not name.endswith("one a call") else few
                    ways.append(((question, kind, name, covers), way, states, contender))
        for number in range(rounds):
            for key, way, states, contender in ways if number % 2 else reversed(ways):
                self.add(key, number, rounds, self.seconds_of(contender, way, states))
        for key, _, states, _ in ways:
            self.states[key] = self.states.get(key, 0) + len(states)

    def time_program(self, kind, Q, rounds):
        """One state a call in C++."""
        ours = self.contenders[1]
        with tempfile.TemporaryDirectory() as folder:
            ours.scene.save(f"{folder}/scene")
            np.ascontiguousarray(Q[:, np.argsort(ours.joints.ids)]).tofile(f"{folder}/states")
            command = [PROGRAM, f"{folder}/scene/scene.yaml", self.robot, f"{folder}/states", str(rounds)]
            lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
        for line in lines:
            question, covers, *seconds = line.split()
            key = question, kind, "Clearance in C++, prepared, one a call", covers
            for number, each in enumerate(seconds):
                self.add(key, number, rounds, float(each))
            self.states[key] = self.states.get(key, 0) + len(Q)

    def add(self, key, number, rounds, seconds):
        self.seconds.setdefault(key, [0.0] * rounds)[number] += seconds

    def us(self, key):
        """(rounds,) microseconds per state of a way."""
        return 1e6 * np.array(self.seconds[key]) / self.states[key]

    def rows(self):
        for key in sorted(self.seconds, key=lambda key: (list(QUERIES).index(key[0]), key[1] != "free")):
            question, kind, name, covers = key
            peer = "least" if question == "least" else "verdict"
            coal = np.min([self.us(k) for k in self.seconds if k[:2] == (peer, kind) and k[3] == ""], axis=0)
            us = self.us(key)
            row = {
                "robot": self.robot,
                "question": question,
                "states": kind,
                "count": self.states[key],
                "contender": name,
                "covers": covers,
                "us_a_state": f"{np.median(us):.3g}",
                "times_coal": f"{np.median(coal / us):.3g}",
            }
            if (without := (*key[:3], "off")) in self.seconds:
                row["times_off"] = f"{np.median(self.us(without) / us):.3g}"
            yield row


def seconds_of(contender, way, states):
    """Processor time in this process, or wall time if a daemon computes."""
    clock = time.perf_counter if getattr(contender, "url", None) else time.process_time
    return timed(way, states, clock=clock)[0]


def states_of(problem, joints, limits, count, rng):
    """Start, goal and uniform states; and states near start and goal."""
    ends = np.array([[at[j] for j in joints] for at in (problem.start, problem.goal)])
    near = np.repeat(ends, count // 4, axis=0)
    near = near + rng.normal(0, 0.05, near.shape)
    return np.concatenate([ends, rng.uniform(limits[:, 0], limits[:, 1], (count, len(joints)))]), near


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
    files = resources, joints, robot
    with contextlib.ExitStack() as stages:
        contenders = [Clearance(*files, covers=covers) for covers in COVERS]
        for covers in COVERS if options.rounds else ():
            daemon = ["--threads", "1", "--covers", covers]
            _, urls, _ = start_daemon(stages.enter_context(Stage()), scene_file_of(robot, resources), options=daemon)
            contenders.append(Clearance(*files, url=urls["shm"], covers=covers))
        peer = PinocchioCoal(*files)
        limits = limits_of(peer.model, joints)
        if options.rounds:
            contenders.append(peer)
        measurement = Measurement(robot, contenders, seconds_of)
        for number, problem in enumerate(requested):
            rng = np.random.default_rng([number, options.seed])
            anywhere, near = states_of(problem, joints, limits, options.states, rng)
            free = measurement.run(problem, anywhere, near, options.rounds)
            print(f"{problem.name}: {free} of {options.states + 2} states free", flush=True)
    print(
        f"{robot}: covers change {measurement.changed} of {measurement.decided} decisions, and make "
        f"{measurement.more} more. {measurement.verdicts} verdicts, {measurement.near} differ within {NEAR} m. "
        f"{measurement.contested} answers contradict each other: an independent checker finds ours proved in "
        f"{measurement.contested - measurement.unproved} of them"
    )
    return list(measurement.rows()), measurement.unproved + measurement.changed


def main():
    parser = problems.parser(__doc__, "panda ur5 fetch baxter", seed=1)
    parser.add_argument("--problems", type=int, default=2, help="of each family: numbers 1 to this")
    parser.add_argument("--states", type=int, default=4096, help="random ones of each problem")
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    resources = problems.fetch()
    rows, wrong = [], 0
    for robot in options.robots:
        more, wrong_ones = measure(options, robot, resources)
        rows += shown(more)
        wrong += wrong_ones
    requested = f"problems 1 to {options.problems} of each family, {options.states} random states of each"
    write(rows, options.csv, stamped(requested))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
