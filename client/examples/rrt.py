"""A planner of one's own: RRT, whose every edge is proved free, in process or through a daemon.

    python3 client/examples/rrt.py scenes/cell/robot.yaml arm     # or shm:///tmp/clearance.sock, a running daemon

Turns the robot's first joint by 1.5 radians. Prepared queries take a few microseconds for an edge (docs/python.md).
"""

import sys
import time

import numpy as np

import clearance


class Planner:
    def __init__(self, front, robot, margin=0.01, step=0.5, seed=0):
        """front: an Engine or a Client."""
        self.joints = front.joints(robot)
        self.check = front.prepare("check", joints=self.joints, margin=margin)
        self.edge = front.prepare("motions", joints=self.joints, margin=margin, reduce="any", fields="verdict")
        self.path = front.prepare("check_path", joints=self.joints, margin=margin)
        self.step, self.edges, self.random = step, 0, np.random.default_rng(seed)

    def is_free(self, a, b):
        """Whether the whole motion is proved free."""
        self.edges += 1
        return self.edge.run(a[None], b[None]).all_free

    def plan(self, start, goal, samples=50_000):
        """Returns the waypoints of a path, or None."""
        ends = self.check.run(np.stack((start, goal)))
        if not ends:  # also beyond limits
            sys.exit(f"start, goal: free {ends.free}, by pairs {ends.pair_names}, limits {ends.limit_violations}")
        lower, upper = np.maximum(self.joints.lower, -np.pi), np.minimum(self.joints.upper, np.pi)
        nodes, parents = np.empty((samples + 2, len(start))), [-1]
        nodes[0] = start
        for _ in range(samples):
            count = len(parents)
            target = goal if self.random.random() < 0.1 else self.random.uniform(lower, upper)
            near = int(np.argmin(((nodes[:count] - target) ** 2).sum(axis=1)))
            way = target - nodes[near]
            new = nodes[near] + way * min(1.0, self.step / np.linalg.norm(way))
            if not self.is_free(nodes[near], new):
                continue
            nodes[count] = new
            parents.append(near)
            if np.linalg.norm(goal - new) <= self.step and self.is_free(new, goal):
                branch = [count]
                while branch[-1]:
                    branch.append(parents[branch[-1]])
                return np.stack((*nodes[branch[::-1]], goal))
        return None


def main():
    where, robot = sys.argv[1:]
    front = clearance.connect(where) if "://" in where else clearance.Engine(clearance.Scene.load(where))
    front.wait_covers()  # so that the first edges are as fast as the others
    planner = Planner(front, robot)
    states = front.joint_states()
    start = np.array([states[i].position for i in planner.joints.ids])
    goal = start.copy()
    goal[0] += 1.5
    begin = time.perf_counter()
    path = planner.plan(start, goal)
    if path is None:
        sys.exit("no path")
    us = 1e6 * (time.perf_counter() - begin) / planner.edges
    print(f"{len(path)} waypoints, {planner.edges} edges, {us:.1f} us for each")
    sys.exit(0 if planner.path.run(path) else "the path is not free")


if __name__ == "__main__":
    main()
