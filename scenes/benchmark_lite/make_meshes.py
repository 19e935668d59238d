#!/usr/bin/env python3
"""Writes the two meshes of this scene, 2400 triangles each: an egg (PLY) and a rounded box, bent (GLB)."""

import os
import sys

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import mesh_tools as mt

os.chdir(os.path.join(os.path.dirname(os.path.abspath(__file__)), "meshes"))


def egg(v):
    return v * np.array([1, 1, 1.35]) * (1 - 0.18 * v[2] * np.array([1, 1, 0]))


def pebble(v):
    rounded = v / np.linalg.norm(v, 4)  # between a sphere and a box
    return rounded * np.array([1.2, 0.8, 0.5]) + np.array([0, 0, 0.12 * rounded[0] ** 2])


mt.write_ply("egg.ply", [mt.uv_sphere("egg", 0.05, 25, egg)])
mt.write_glb("pebble.glb", [mt.uv_sphere("pebble", 0.06, 25, pebble)], [("pebble", {})])
