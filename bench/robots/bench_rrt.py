#!/usr/bin/env python3
"""MotionBenchMaker's problems planned end to end by RRT-Connect: distribution of time, with Pinocchio and Coal.

    bench/run.py rrt [--robots panda ur5] [--problems 20] [--csv FILE]

One planner, written here in Python, checks the same edges with every contender, sampled every --resolution radians:
ours in one call per edge, in process and over shared memory (a daemon of one thread), Coal state by state, up to the
first that is not free. All use the same random numbers, so that equal decisions give equal trees.

   checking    wall time of all checks of edges
   kinematics  share for placing the robot. For Pinocchio and Coal it is timed state by state; for ours the same states
               are queried afterwards for one pair alone, and the engine's own time for that counts
   transport   share of our checking: time beyond the engine's own time (in process: Python; over shared memory: also
               the transfer in both directions)
   planning    the planner itself

Contenders alternate for each problem, --rounds times; the fastest round counts. A problem counts if all solve it within
--states states.
"""

import time
from typing import Any

import numpy as np

import contenders
import problems
from bench_robots import limits_of, scene_file_of
from clearance import Status
from harness import shown, stamped, write
from processes import Stage
from service import start_daemon

STEP = 1.0  # maximum growth of a tree, in radians and metres, joint by joint


class Tree:
    def __init__(self, root):
        self.rows = np.empty((1024, len(root)))
        self.rows[0] = root
        self.parents = [0]

    def nearest(self, q):
        return int(np.argmin(((self.rows[: len(self.parents)] - q) ** 2).sum(axis=1)))

    def add(self, q, parent):
        if len(self.parents) == len(self.rows):
            self.rows = np.concatenate([self.rows, np.empty_like(self.rows)])
        self.rows[len(self.parents)] = q
        self.parents.append(parent)
        return len(self.parents) - 1


def plan(checker, start, goal, limits, rng, resolution, most_states):
    """RRT-Connect (Kuffner, LaValle 2000). Returns whether a path was found."""

    def extend(tree, q):
        """One step of the tree towards q: (its new node or None, whether that is q)."""
        near = tree.nearest(q)
        way = q - tree.rows[near]
        longest = np.abs(way).max()
        reached = longest <= STEP
        to = q if reached else tree.rows[near] + way * (STEP / longest)
        steps = max(int(np.ceil(min(longest, STEP) / resolution)), 1)
        states = tree.rows[near] + (to - tree.rows[near]) * (np.arange(1, steps + 1) / steps)[:, None]
        return (tree.add(to, near), reached) if checker.free(states) else (None, False)

    trees = Tree(start), Tree(goal)
    while checker.states < most_states:
        node, _ = extend(trees[0], rng.uniform(limits[:, 0], limits[:, 1]))
        if node is not None:
            target = trees[0].rows[node]
            while checker.states < most_states:
                other, reached = extend(trees[1], target)
                if reached:
                    return True
                if other is None:
                    break
        trees = trees[1], trees[0]
    return False


class Ours:
    """One call per edge."""

    def __init__(self, resources, joints, robot, url=None):
        self.contender = contenders.Clearance(resources, joints, robot, url)
        self.name = "Clearance over shared memory" if url else "Clearance in process"

    def begin(self, problem):
        self.contender.begin(problem)
        self.states, self.seconds, self.engine_seconds, self.requested = 0, 0.0, 0.0, []

    def free(self, states):
        begin = time.perf_counter()
        answer = self.contender.requested.distances(
            joints=self.contender.joints, configurations=states, reduce="any", fields="status"
        )
        is_free = bool((answer.status == Status.BEYOND).all())
        self.seconds += time.perf_counter() - begin
        self.engine_seconds += 1e-9 * answer.engine_ns
        self.states += len(states)
        self.requested.append(states)
        return is_free

    def shares(self):
        """Seconds of (kinematics, transport)."""
        requested, joints = self.contender.requested, self.contender.joints
        table = requested.distances(joints=joints, configurations=self.requested[0][:1], fields="status").pairs
        ns = 0
        for states in self.requested:
            ns += requested.distances(table[:1], joints=joints, configurations=states, reduce="any",
                fields="status").engine_ns
        return 1e-9 * ns, self.seconds - self.engine_seconds

    def end(self):
        self.contender.end()


class Theirs:
    """Pairs in order, or a tree of boxes, as selected."""

    def __init__(self, *files, tree):
        self.contender = contenders.PinocchioCoal(*files)
        self.name = f"Coal, {'tree of boxes' if tree else 'pairs in order'}"
        self.tree = tree

    def begin(self, problem):
        self.contender.begin(problem)
        self.states, self.seconds, self.requested = 0, 0.0, []

    def free(self, states):
        of = self.contender
        begin = time.perf_counter()
        rows = of.states(states)
        is_free, count = True, 0
        for q in rows:
            count += 1
            if self.tree:
                hit = of.pin.computeCollisions(of.model, of.data, of.tree, q, True)
            else:
                hit = of.pin.computeCollisions(of.model, of.data, of.geometry, of.geometry_data, q, True)
            if hit:
                is_free = False
                break
        self.seconds += time.perf_counter() - begin
        self.states += len(states)
        self.requested.append(rows[:count])
        return is_free

    def shares(self):
        of = self.contender
        begin = time.perf_counter()
        for rows in self.requested:
            for q in rows:
                of.pin.updateGeometryPlacements(of.model, of.data, of.geometry, of.geometry_data, q)
        return time.perf_counter() - begin, 0.0

    def end(self):
        self.contender.end()


def solve(checker, problem, joints, limits, options):
    """One contender's times for one problem, or None if it finds no path."""
    rng = np.random.default_rng([options.seed, problem.number, len(problem.family)])
    start, goal = (np.array([at[j] for j in joints]) for at in (problem.start, problem.goal))
    checker.begin(problem)
    try:
        if not (checker.free(start[None]) and checker.free(goal[None])):
            return None
        checker.states, checker.seconds, checker.requested = 0, 0.0, []
        if isinstance(checker, Ours):
            checker.engine_seconds = 0.0
        begin = time.perf_counter()
        found = plan(checker, start, goal, limits, rng, options.resolution, options.states)
        total = time.perf_counter() - begin
        if not found:
            return None
        kinematics, transport = checker.shares()
        return {"states": checker.states, "total": total, "checking": checker.seconds,
                "kinematics": kinematics, "transport": transport}  # fmt: skip
    finally:
        checker.end()


def least(rounds):
    """The fastest round, or None if there was no path."""
    return None if None in rounds else min(rounds, key=lambda one: one["total"])


def chosen(problems, count):
    """The first problems, alternating between all families."""
    return sorted(problems, key=lambda p: (p.number, p.family))[:count]


def row_of(robot, name, found, agreed):
    def mean(key):
        return 1e3 * float(np.mean([each[key] for each in found]))

    return {
        "robot": robot,
        "contender": name,
        "problems": len(found),
        "same_trees": agreed,
        "states": round(float(np.mean([each["states"] for each in found]))),
        "total_ms": f"{mean('total'):.4g}",
        "checking_ms": f"{mean('checking'):.4g}",
        "kinematics_ms": f"{mean('kinematics'):.3g}",
        "transport_ms": f"{mean('transport'):.3g}",
        "planning_ms": f"{mean('total') - mean('checking'):.3g}",
    }


def measure(robot, resources, options):
    requested = chosen(problems.load(resources, robot), options.problems)
    joints = list(requested[0].goal)
    found: list[list[Any]] = []
    with Stage() as stage:
        _, urls, _ = start_daemon(stage, scene_file_of(robot, resources), options=["--threads", "1"])
        files = resources, joints, robot
        theirs = [Theirs(*files, tree=tree) for tree in (True, False)]
        checkers: list[Any] = [Ours(*files), Ours(*files, url=urls["shm"]), *theirs]
        limits = limits_of(theirs[-1].contender.model, joints)
        for problem in requested:
            rounds = []
            for _ in range(options.rounds):
                rounds.append([solve(checker, problem, joints, limits, options) for checker in checkers])
                if None in rounds[-1]:
                    break
            each = [least(found_by) for found_by in zip(*rounds)]
            if all(each):
                found.append(each)
            shown = "  ".join("-" if one is None else f"{1e3 * one['total']:.0f} ms" for one in each)
            print(f"{problem.name}: {shown}", flush=True)
    if not found:
        raise RuntimeError(f"{robot}: nobody solves a problem within {options.states} states")
    agreed = sum(len({one["states"] for one in each}) == 1 for each in found)
    print(f"{robot}: {len(found)} of {len(requested)} problems solved by all; {agreed} with the same trees")
    return [row_of(robot, c.name, [each[i] for each in found], agreed) for i, c in enumerate(checkers)]


def main():
    parser = problems.parser(__doc__, "panda ur5", seed=1)
    parser.add_argument("--problems", type=int, default=20, help="of each robot, of its families by turns")
    parser.add_argument("--resolution", type=float, default=1 / 32, help="radians, metres between samples of an edge")
    parser.add_argument("--states", type=int, default=200000, help="samples after which a problem counts as unsolved")
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    resources = problems.fetch()
    rows = shown(row for robot in options.robots for row in measure(robot, resources, options))
    requested = f"up to {options.problems} problems of each robot, a sample every {options.resolution:g} rad"
    write(rows, options.csv, stamped(requested))


if __name__ == "__main__":
    main()
