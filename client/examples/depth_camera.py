#!/usr/bin/env python3
"""A simulated depth camera: rays into a known scene, noise, a self-filter, and a robot's distance to the point cloud.

    python3 client/examples/depth_camera.py [--connect URL] [--frames 3] [--noise 0.002]

The camera is in scenes/cell and sees the arm and the bodies that do not belong to it. A ray's depth is found by sphere
tracing: it advances by the certified lower bound on the distance to the nearest body, until that is at most a tenth of
a millimetre. The declared noise becomes the radius of the points, so that the surface that a ray hits is within it.

Points on the robot are no obstacles. The self-filter removes a point if its distance to the robot's links, in the same
state, is not proved to be more than its radius; it removes nothing else. The cloud then replaces the points of the body
"seen" at once, and the arm's distance to it is queried. With --connect a daemon answers, whose scene needs such a body
(`points: []`); otherwise this process does.
"""

import argparse
import pathlib
import sys
from typing import Union

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
try:
    import clearance
except ImportError:  # not installed: the build's folder
    sys.path.append(str(ROOT / "build" / "python"))
    import clearance

HIT = 1e-4  # metres: distance at which a ray ends
FAR = 4.0  # metres: range of the camera
HOME = {"arm/turn": -0.2618, "arm/lift": 0.05, "arm/elbow": 1.3, "arm/wrist_lift": 0.15, "arm/wrist_turn": -1.5708,
        "arm/tool": 0.1745}  # fmt: skip


class Camera:
    """Points along its z axis; rows of pixels are along its x axis."""

    def __init__(self, position, target, width, height, view=0.9):
        z = np.subtract(target, position) / np.linalg.norm(np.subtract(target, position))
        x = np.cross(z, [0, 0, 1])
        x /= np.linalg.norm(x)
        self.position = np.asarray(position, float)
        u, v = np.meshgrid(np.linspace(-view, view, width), np.linspace(-view, view, height) * height / width)
        rays = u[..., None] * x + v[..., None] * np.cross(z, x) + z
        self.rays = (rays / np.linalg.norm(rays, axis=-1, keepdims=True)).reshape(-1, 3)


class World:
    """The actual cell, with a probe: a point whose distance can be queried anywhere."""

    def __init__(self, scene_file):
        self.scene = clearance.Scene.load(scene_file)
        self.others = [b.name for b in self.scene.bodies if b.piece_count and not b.name.startswith("arm/")]
        self.scene.add_sphere("probe", HIT / 2)
        self.engine = clearance.Engine(self.scene, backend="cpu")
        self.engine.set_joints(HOME)

    def distance(self, points, bodies):
        """Lower bounds on the distance of points (N, 3) from bodies, in metres."""
        at = np.zeros((len(points), 1, 7))
        at[:, 0, :3], at[:, 0, 3] = points, 1
        answer = self.engine.distances(
            pairs=[(body, "probe") for body in bodies], bodies=["probe"], configurations=at, reduce="min"
        )
        return answer.lower

    def depths(self, camera, bodies):
        """Length of each ray in metres; inf if it hits nothing within FAR."""
        depth = np.zeros(len(camera.rays))
        active = np.arange(len(depth))
        for _ in range(400):
            if len(active) == 0:
                break
            step = self.distance(camera.position + depth[active, None] * camera.rays[active], bodies)
            depth[active] += np.maximum(step, 0)
            active = active[(step > HIT) & (depth[active] < FAR)]
        depth[depth >= FAR] = np.inf
        return depth


def self_filtered(world, points, radius):
    """Mask (N,) of points (N, 3) that are proved not to be the robot's: farther from its links than their radius."""
    return world.distance(points, ["arm"]) > radius


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--connect", help="url of a daemon; default: this process answers")
    parser.add_argument("--frames", type=int, default=3)
    parser.add_argument("--noise", type=float, default=0.002, help="metres: a depth is off by at most so much")
    parser.add_argument("--width", type=int, default=40, help="pixels")
    options = parser.parse_args()

    world = World(ROOT / "scenes/cell/robot.yaml")
    camera = Camera([2.2, -1.6, 2.2], [0.4, 0, 1.0], options.width, options.width * 3 // 4)
    who: Union[clearance.Client, clearance.Engine]
    if options.connect:
        who = clearance.connect(options.connect)
    else:
        scene = clearance.Scene.load(ROOT / "scenes/cell/robot.yaml")
        scene.add_points("seen", pose=[0, 0, 0, 1, 0, 0, 0])
        who = clearance.Engine(scene, backend="cpu")
    who.set_joints(HOME)
    rng = np.random.default_rng(1)
    for frame in range(options.frames):
        depth = world.depths(camera, [*world.others, "arm"])
        seen = np.isfinite(depth)
        noise = rng.uniform(-options.noise, options.noise, seen.sum())
        points = (camera.position + (depth[seen] + noise)[:, None] * camera.rays[seen]).astype(np.float32)
        radius = options.noise + 2 * HIT + 1e-6  # the ray's end, and float32
        kept = self_filtered(world, points, radius)
        done = who.set_points("seen", points[kept], radius, sequence=frame + 1)
        answer = who.distances(pairs=[("arm", "seen")], reduce="min")
        low, high = answer.lower[0], answer.upper[0]
        print(f"frame {frame}: {seen.sum()} of {len(seen)} rays met something, {seen.sum() - kept.sum()} points may be "
              f"the robot's, {done.applied} are kept; the arm is {low:.4f} to {high:.4f} m from them")  # fmt: skip


if __name__ == "__main__":
    main()
