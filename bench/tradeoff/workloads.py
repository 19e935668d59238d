"""Workloads of the trade-off: robots in MotionBenchMaker's problems, their motions, a cloud, and free bodies."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Callable

import numpy as np

import clearance
import problems
from contenders import shape_of
from surface_shapes import poses, ring

COVERS = ("off", "background")
ROBOTS = {"panda": "Panda", "ur5": "UR5"}
MODELS = {"hulls": "hull", "meshes": "auto"}  # values of mesh_as
NEAR_END = 0.15  # radians around starts and goals
SAMPLE_STEP = 0.02  # radians between the samples of an edge
CLOUD_POINTS, CLOUD_RADIUS = 4000, 0.005
HANDS = {"panda": "panda_hand", "ur5": "wrist_3_link"}  # links that carry a cloud
CARRIED = problems.Obstacle("carried", "box", [0.06, 0.08, 0.2], np.array([0, 0, 0.18, 1, 0, 0, 0]))


@dataclass
class Batch:
    """One scene with what moves in it. Each engine answers all settings."""

    key: str  # batches of several workloads with this key have the same inputs
    engines: dict[str, Any]  # by COVERS
    moves: dict[str, Any]  # joints or bodies
    pairs: Any
    inputs: tuple[np.ndarray, ...]  # states; or starts and ends of edges

    def least(self, covers, fields=("lower", "upper", "status"), **tolerance):
        return self._prepared(covers, "min", fields=fields, **tolerance)

    def decision(self, covers, margin):
        return self._prepared(covers, "any", fields="verdict", margin=margin)

    def _prepared(self, covers, reduce, **more):
        call = "motions" if len(self.inputs) == 2 else "distances"
        return self.engines[covers].prepare(call, reduce=reduce, pairs=self.pairs, **self.moves, **more).run

    def sampled(self, covers, margin):
        """A function that checks states of each edge at most a step apart, and returns whether all are free."""
        start, end = self.inputs
        counts = np.maximum(np.ceil(np.abs(end - start).max(axis=1) / SAMPLE_STEP).astype(int), 1) + 1
        rows = np.concatenate([s + np.linspace(0, 1, n)[:, None] * (e - s) for s, e, n in zip(start, end, counts)])
        first = np.concatenate([[0], np.cumsum(counts)[:-1]])
        query = self.engines[covers].prepare(reduce="any", pairs=self.pairs, fields="verdict", margin=margin,
                                             **self.moves)
        return lambda *_: np.logical_and.reduceat(query.run(rows).verdict.ravel() == clearance.Status.BEYOND, first)


@dataclass(frozen=True)
class Workload:
    name: str
    batches: Callable[[Any], Iterator[Batch]]  # of the options
    is_motion: bool = False


def engines_of(scene):
    """Two engines on a scene, without covers and with them."""
    found = {covers: clearance.Engine(scene, backend="cpu", threads=1, covers=covers) for covers in COVERS}
    found["background"].wait_covers()
    return found


# ---- robots ----------------------------------------------------------------------------------------------------------


def states_of(problem, group, count, rng):
    """A third each along the straight line from start to goal, around both, and anywhere within the limits."""
    ends = np.array([[at[joint] for joint in problem.goal] for at in (problem.start, problem.goal)])
    third = count // 3
    along = ends[0] + np.linspace(0, 1, third)[:, None] * (ends[1] - ends[0])
    around = ends[np.arange(third) % 2] + rng.uniform(-NEAR_END, NEAR_END, (third, ends.shape[1]))
    low, high = np.maximum(group.lower, -np.pi), np.minimum(group.upper, np.pi)
    return np.concatenate([along, around, rng.uniform(low, high, (count - 2 * third, len(low)))])


def edges_of(starts, group, rng):
    """Ends of edges: 0.2 to 1.5 rad from the starts, in random directions, within the limits."""
    way = rng.normal(size=starts.shape)
    way *= rng.uniform(0.2, 1.5, (len(way), 1)) / np.linalg.norm(way, axis=1, keepdims=True)
    return np.clip(starts + way, group.lower, group.upper)


def robot_batches(robot, model, itself=False, cloud=False, carries=False, edges=False, on_map=False):
    """Batches of a robot against its problems' obstacles, and `itself`; a cloud replaces the obstacles, or, if it
    `carries` one, itself."""
    base = np.array([4e6, 5e5, 0]) if on_map else np.zeros(3)  # metres

    def batches(options):
        resources = problems.fetch()
        for problem in problems.load(resources, robot, options.problems):
            rng = np.random.default_rng([problem.number, options.seed])
            scene = clearance.Scene()
            scene.add_robot(robot, mesh_as=MODELS[model], static=True, base=[*base, 1, 0, 0, 0],
                            **problems.files_of(resources, robot))  # fmt: skip
            links = len(scene.bodies)
            if carries:
                points = points_on([CARRIED], np.random.default_rng(options.seed))
                scene.add_points(CARRIED.name, points, radius=CLOUD_RADIUS, parent=f"{robot}/{HANDS[robot]}")
                links += 1
            if cloud:
                points = points_on(problem.obstacles, np.random.default_rng(options.seed))
                scene.add_points("cloud_obstacle", points, radius=CLOUD_RADIUS, static=True)
            for thing in [] if cloud else problem.obstacles:
                pose = [*(thing.pose[:3] + base), *thing.pose[3:]]
                scene.add_body(f"{thing.name}_obstacle", static=True, pose=pose, **shape_of(thing))
            engines = engines_of(scene)
            group = engines["off"].joints([f"{robot}/{joint}" for joint in problem.goal])
            moved = CARRIED.name if carries else robot
            pairs = None if itself else [(moved, body.name) for body in list(scene.bodies)[links:]]
            states = states_of(problem, group, options.states, rng)
            inputs = (states, edges_of(states, group, rng)) if edges else (states,)
            yield Batch(problem.name, engines, {"joints": group}, pairs, inputs)

    return batches


def points_on(obstacles, rng):
    """(N, 3) random points on the surfaces of obstacles, by area."""
    surfaces = [surface_of(obstacle) for obstacle in obstacles]
    areas = np.array([area for area, _ in surfaces])
    counts = rng.multinomial(CLOUD_POINTS, areas / areas.sum())
    found = []
    for obstacle, (_, draw), count in zip(obstacles, surfaces, counts):
        w, x, y, z = obstacle.pose[3:]
        R = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                      [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                      [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])  # fmt: skip
        found.append(obstacle.pose[:3] + draw(count, rng) @ R.T)
    return np.concatenate(found)


def surface_of(obstacle):
    """(area, function that draws points): a box, or a cylinder with its ends."""
    if obstacle.shape == "box":
        size = np.array(obstacle.sizes)
        areas = np.array([size[1] * size[2], size[0] * size[2], size[0] * size[1]])

        def on_box(count, rng):
            axis = rng.choice(3, count, p=areas / areas.sum())
            at = rng.uniform(-0.5, 0.5, (count, 3))
            at[np.arange(count), axis] = rng.choice([-0.5, 0.5], count)
            return at * size

        return 2 * areas.sum(), on_box
    length, radius = obstacle.sizes

    def on_cylinder(count, rng):
        angle = rng.uniform(0, 2 * np.pi, count)
        is_end = rng.uniform(size=count) < radius / (radius + length)
        r = np.where(is_end, radius * np.sqrt(rng.uniform(size=count)), radius)
        z = np.where(is_end, rng.choice([-0.5, 0.5], count), rng.uniform(-0.5, 0.5, count)) * length
        return np.stack([r * np.cos(angle), r * np.sin(angle), z], 1)

    return 2 * np.pi * radius * (radius + length), on_cylinder


def unseen(batch):
    """Metres: how far a link's frame moves, at most, between two samples of an edge, halved; median of some edges."""
    engine, found = batch.engines["off"], []
    for start, end in zip(*(ends[:20] for ends in batch.inputs)):
        step = (end - start) / max(np.ceil(np.abs(end - start).max() / SAMPLE_STEP), 1)
        places = []
        for state in (start, start + step):
            engine.set_joints(state, joints=batch.moves["joints"])
            places.append(np.array([state.pose[:3] for state in engine.body_states()]))
        found.append(np.linalg.norm(places[1] - places[0], axis=1).max() / 2)
    return float(np.median(found))


# ---- free bodies -----------------------------------------------------------------------------------------------------


def free_bodies(model):
    """Twelve hulls of 40 vertices, or six rings of 800 triangles, anywhere in a cube of 4 m."""

    def batches(options):
        rng = np.random.default_rng([len(model), options.seed])
        scene = clearance.Scene()
        count = 12 if model == "hulls" else 6
        for i in range(count):
            if model == "hulls":
                points = rng.normal(size=(40, 3))
                scene.add_hull(f"body{i}", 0.15 * points / np.linalg.norm(points, axis=1, keepdims=True))
            else:
                scene.add_body(f"body{i}", mesh=ring(800, 0.15, 0.04, rng), mesh_as="solid")
        places = poses(options.states * count, 2.0, np.zeros(3), rng).reshape(-1, count, 7)
        names = [body.name for body in scene.bodies]
        yield Batch("free bodies", engines_of(scene), {"bodies": names}, None, (places,))

    return batches


def workloads(robots):
    found = []
    for robot in robots:
        for itself in (False, True):
            for model in MODELS:
                name = f"{ROBOTS[robot]}, {model}{' and itself' if itself else ''}"
                found.append(Workload(name, robot_batches(robot, model, itself)))
        found.append(Workload(f"{ROBOTS[robot]}, cloud", robot_batches(robot, "hulls", cloud=True)))
        found.append(Workload(f"{ROBOTS[robot]}, carried cloud", robot_batches(robot, "hulls", carries=True)))
    found.append(Workload(f"{ROBOTS[robots[0]]}, on a map", robot_batches(robots[0], "hulls", on_map=True)))
    for robot in robots:
        found.append(Workload(f"{ROBOTS[robot]}, edges", robot_batches(robot, "hulls", edges=True), is_motion=True))
    found += [Workload(f"free {model}", free_bodies(model)) for model in MODELS]
    return found
