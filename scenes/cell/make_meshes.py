#!/usr/bin/env python3
"""Writes the meshes of this scene: a six-axis arm link by link, a gripper, a cup, a table, shelves and a bin."""

import math
import os
import sys

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import mesh_tools as mt

os.chdir(os.path.join(os.path.dirname(os.path.abspath(__file__)), "meshes"))

ALONG_Y = mt.rotation("x", -90)  # rotates z to y


def drive(name, radius, low, high, n=20):
    """A joint's housing along y: a barrel with chamfered ends and a cap."""
    c = 0.15 * radius
    profile = [(0.75 * radius, low), (radius, low + c), (radius, high - c), (0.8 * radius, high)]
    return mt.moved(mt.turned(name, profile, n), rotation=ALONG_Y)


def tube(name, sections):
    """A loft along z through rounded rectangles (width, depth, z)."""
    return mt.loft(name, [mt.rounded_rectangle(w, d, 0.49 * min(w, d), z, 5) for w, d, z in sections])


# The base: a plate, a flange and a tapering column. The scene uses its hull.
mt.write_stl("base.stl", [mt.loft("plate", [mt.rounded_rectangle(0.20, 0.20, 0.03, z) for z in (0.0, 0.015)]),
                          mt.turned("column", [(0.095, 0.015), (0.095, 0.03), (0.075, 0.045), (0.070, 0.085)])])

# The shoulder: a body that rotates about z, and the housing of the next drive at its side.
mt.write_obj("shoulder.obj", [mt.turned("body", [(0.062, -0.065), (0.068, -0.055), (0.068, 0.035), (0.045, 0.068)]),
                              drive("side", 0.062, 0.02, 0.072)])

# The upper arm: a drive at each end and a tube between them.
mt.write_obj("upper_arm.obj", [drive("shoulder_drive", 0.060, -0.060, 0.062), tube("tube", [(0.085, 0.080, 0.03), (0.072, 0.070, 0.10), (0.066, 0.064, 0.38), (0.078, 0.070, 0.405)]),
                               mt.moved(drive("elbow_drive", 0.055, -0.058, 0.058), (0, 0, 0.425))])

# The forearm, as several solids of one text STL file.
mt.write_stl("forearm.stl", [drive("elbow", 0.052, -0.056, 0.056, 16), tube("bend", [(0.075, 0.07, 0.02), (0.060, 0.060, 0.10)]),
                             tube("tube", [(0.060, 0.060, 0.10), (0.050, 0.050, 0.33), (0.056, 0.05, 0.36)])], text=True)

# The first wrist link, in millimetres: its drive is perpendicular to the forearm's end.
across = np.eye(4)
across[:3, :3] = ALONG_Y
mt.write_dae("wrist_1.dae", [mt.turned("drive", [(32, -42), (42, -36), (42, 44), (34, 50)], 20), mt.turned("neck", [(34, -42), (40, -36), (40, 36), (30, 44)], 20)],
             [("drive", across), ("neck", np.array([[1.0, 0, 0, 0], [0, 1, 0, 93], [0, 0, 1, 0], [0, 0, 0, 1]]))], unit=0.001)

# The second wrist link: two nodes of one drive.
mt.write_glb("wrist_2.glb", [mt.turned("drive", [(0.030, -0.036), (0.040, -0.030), (0.040, 0.036), (0.032, 0.044)], 20)],
             [("drive", {"translation": [0, 0, 0.090]}), ("drive", {"translation": [0, 0.004, 0.095], "rotation": [-math.sin(math.pi / 4), 0, 0, math.cos(math.pi / 4)]})])

# The tool flange: a disk with a bore's rim.
mt.write_off("flange.off", [mt.moved(mt.turned("flange", [(0.030, 0.050), (0.037, 0.056), (0.037, 0.072), (0.031, 0.078)], 24), rotation=ALONG_Y)])

# The gripper, along y from the flange: a palm, a cross rail, and two fingers with pads.
fingers = []
for side in (-1, 1):
    fingers += [mt.moved(mt.loft(f"finger{side}", [mt.rounded_rectangle(w, 0.024, 0.006, z, 3) for w, z in ((0.020, 0.0), (0.018, 0.05), (0.010, 0.085))]),
                         (side * 0.052, 0.075, 0), ALONG_Y),
                mt.box(f"pad{side}", (0.008, 0.035, 0.020), (side * 0.043, 0.140, 0))]
mt.write_obj("gripper.obj", [mt.moved(mt.loft("palm", [mt.rounded_rectangle(w, d, 0.012, z, 4) for w, d, z in ((0.060, 0.060, 0.0), (0.080, 0.064, 0.012), (0.080, 0.058, 0.055))]), rotation=ALONG_Y),
                             mt.box("rail", (0.135, 0.022, 0.030), (0, 0.066, 0))] + fingers)

# A cup for the gripper, and the surrounding furniture.
mt.write_ply("cup.ply", [mt.turned("cup", [(0.028, 0.0), (0.030, 0.004), (0.0385, 0.093), (0.0375, 0.095)], 32)])
mt.write_gltf("table.gltf", [mt.box("top", (1.6, 1.2, 0.04)), mt.box("leg", (0.06, 0.06, 0.69)), mt.box("apron", (1.4, 0.03, 0.08))],
              [("top", {"translation": [0, 0, -0.02]})] + [("leg", {"translation": [x, y, -0.385]}) for x in (-0.73, 0.73) for y in (-0.53, 0.53)] +
              [("apron", {"translation": [0, y, -0.08]}) for y in (-0.53, 0.53)])


def place(x, y, z):
    return np.array([[1.0, 0, 0, x], [0, 1, 0, y], [0, 0, 1, z], [0, 0, 0, 1]])


mt.write_dae("shelf.dae", [mt.box("side", (0.02, 0.35, 0.9)), mt.box("board", (0.80, 0.35, 0.02)), mt.box("back", (0.80, 0.01, 0.9))],
             [("side", place(-0.41, 0, 0.45)), ("side", place(0.41, 0, 0.45)), ("back", place(0, 0.17, 0.45))] + [("board", place(0, 0, z)) for z in (0.01, 0.32, 0.60, 0.89)])
mt.write_obj("bin.obj", [mt.box("floor", (0.30, 0.22, 0.006), (0, 0, 0.003))] + [mt.box(f"wall_x{s}", (0.006, 0.22, 0.12), (s * 0.147, 0, 0.06)) for s in (-1, 1)] +
             [mt.box(f"wall_y{s}", (0.288, 0.006, 0.12), (0, s * 0.107, 0.06)) for s in (-1, 1)])
mt.write_ply("bottle.ply", [mt.turned("bottle", [(0.034, 0.0), (0.036, 0.004), (0.036, 0.15), (0.031, 0.175), (0.016, 0.205), (0.013, 0.215), (0.013, 0.24), (0.015, 0.241), (0.015, 0.25)], 24)], text=True)
