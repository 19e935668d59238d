#!/usr/bin/env python3
"""Poses of the links of this cell's arm for given joint angles: link_poses(degrees). Needs numpy.

Run with six angles in degrees, it prints each link's pose in the scene file's format.
"""

import math
import sys

import numpy as np

# From each link's frame to that of the next joint at angle 0 (its axis, and its position in metres).
JOINTS = [
    ("shoulder", "z", (0.0, 0.0, 0.152)),
    ("upper_arm", "y", (0.0, 0.135, 0.0)),
    ("forearm", "y", (0.0, -0.120, 0.425)),
    ("wrist_1", "y", (0.0, 0.0, 0.392)),
    ("wrist_2", "z", (0.0, 0.093, 0.0)),
    ("flange", "y", (0.0, 0.0, 0.095)),
]
BASE = (0.0, 0.0, 0.75)  # on the table, in the world
HOME = (-15.0, 15.0, 85.0, -10.0, -90.0, 10.0)


def turn(axis, angle):
    """Unit quaternion (w, x, y, z) about "x", "y" or "z"."""
    q = [math.cos(angle / 2), 0.0, 0.0, 0.0]
    q["xyz".index(axis) + 1] = math.sin(angle / 2)
    return np.array(q)


def product(p, q):
    return np.array([p[0] * q[0] - p[1:] @ q[1:], *(p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:]))])


def rotated(q, v):
    """v rotated by q."""
    t = 2 * np.cross(q[1:], v)
    return np.asarray(v) + q[0] * t + np.cross(q[1:], t)


def link_poses(degrees):
    """World poses [x, y, z, qw, qx, qy, qz] by link name, base first, for six joint angles in degrees."""
    t, q = np.array(BASE), np.array([1.0, 0, 0, 0])
    poses = {"base": np.concatenate([t, q])}
    for (name, axis, place), angle in zip(JOINTS, degrees):
        t = t + rotated(q, place)
        q = product(q, turn(axis, math.radians(angle)))
        poses[name] = np.concatenate([t, q])
    return poses


if __name__ == "__main__":
    for link, pose in link_poses([float(a) for a in sys.argv[1:]] or HOME).items():
        print(f"{link}: [{', '.join(f'{round(x, 6):g}' for x in pose)}]")
