#!/usr/bin/env python3
"""Writes this scene's meshes: objects of a workshop and of a breakfast table, in every format that Clearance reads."""

import math
import os
import sys

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import mesh_tools as mt

os.chdir(os.path.join(os.path.dirname(os.path.abspath(__file__)), "meshes"))


def polygon(radius, n, phase=0.0):
    return mt.circle(radius, 0, n, phase)[:, :2]


# A chess pawn: foot, waist, collar and head; each convex.
mt.write_obj("pawn.obj", [
    mt.turned("foot", [(0.30, 0.0), (0.32, 0.04), (0.30, 0.12), (0.20, 0.20)]),
    mt.turned("waist", [(0.20, 0.20), (0.11, 0.62)]),
    mt.turned("collar", [(0.11, 0.60), (0.19, 0.64), (0.11, 0.69)]),
    mt.moved(mt.uv_sphere("head", 0.17, 8), (0, 0, 0.82)),
])

# A bottle; the scene uses its hull, which fills its shoulder.
mt.write_ply("bottle.ply", [mt.turned("bottle", [(0.26, 0.0), (0.28, 0.03), (0.28, 0.70), (0.25, 0.80), (0.14, 0.95), (0.10, 1.02),
                                                 (0.10, 1.20), (0.115, 1.21), (0.115, 1.26), (0.10, 1.27)], 28)])

# A mug: staves around, a bottom, and a handle of five bent segments.
staves = []
for i in range(12):
    a, b = 2 * math.pi * i / 12, 2 * math.pi * (i + 1) / 12
    outline = [(r * math.cos(t), r * math.sin(t)) for r, t in ((0.26, a), (0.30, a), (0.30, (a + b) / 2), (0.30, b), (0.26, b))]
    staves.append(mt.extruded(f"stave{i}", outline, 0.0, 0.62))
handle = []
for i in range(5):
    rings = []
    for t in (i, i + 1):
        a = math.radians(-80 + 160 * t / 5)
        c = np.array([0.28 + 0.19 * math.cos(a), 0, 0.31 + 0.22 * math.sin(a)])
        out = np.array([math.cos(a), 0, math.sin(a)])
        rings.append([c + 0.035 * (math.cos(s) * out + math.sin(s) * np.array([0, -1.0, 0])) for s in np.arange(8) * math.pi / 4])
    handle.append(mt.loft(f"handle{i}", rings))
mt.write_obj("mug.obj", staves + [mt.extruded("bottom", polygon(0.27, 24), 0.0, 0.05)] + handle)

# A gear wheel: the hull of its teeth.
teeth = 18
outline = []
for i in range(teeth):
    for k, r in ((0.0, 0.34), (0.2, 0.34), (0.3, 0.42), (0.6, 0.42), (0.7, 0.34)):
        a = 2 * math.pi * (i + k) / teeth
        outline.append((r * math.cos(a), r * math.sin(a)))
mt.write_stl("gear.stl", [mt.extruded("gear", outline, -0.08, 0.08), mt.turned("hub", [(0.12, -0.16), (0.14, -0.14), (0.14, 0.14), (0.12, 0.16)])])

# A nut, with chamfers.
mt.write_stl("nut.stl", [mt.loft("nut", [[(*p, z) for p in polygon(r, 6)] for r, z in ((0.25, -0.13), (0.28, -0.10), (0.28, 0.10), (0.25, 0.13))])], text=True)

# A chair: a seat, a back, and one leg that occurs at four nodes.
mt.write_gltf("chair.gltf", [mt.box("leg", (0.06, 0.06, 0.45)), mt.box("seat", (0.50, 0.50, 0.05)), mt.box("back", (0.50, 0.05, 0.55))],
              [("leg", {"translation": [x, y, 0.225]}) for x in (-0.21, 0.21) for y in (-0.21, 0.21)] +
              [("seat", {"translation": [0, 0, 0.475]}), ("back", {"translation": [0, 0.225, 0.77], "rotation": [-math.sin(0.06), 0, 0, math.cos(0.06)]})])

# A hammer, drawn in millimetres: the handle at one node, the head at another, and the same head's face at each end.
def at(x, y, z, r=None):
    m = np.eye(4)
    m[:3, :3], m[:3, 3] = np.eye(3) if r is None else r, (x, y, z)
    return m


mt.write_dae("hammer.dae", [
    mt.loft("handle", [mt.rounded_rectangle(w, d, 0.45 * d, z) for w, d, z in ((70, 50, 0), (80, 56, 120), (60, 44, 400), (54, 40, 900))]),
    mt.loft("head", [mt.rounded_rectangle(110, 110, 25, z) for z in (-150, 150)]),
    mt.turned("face", [(50, 0), (62, 15), (62, 55), (55, 65)], 20),
], [("handle", at(0, 0, 0)), ("head", at(0, 0, 870, mt.rotation("y", 90))), ("face", at(150, 0, 870, mt.rotation("y", 90))),
    ("face", at(-150, 0, 870, mt.rotation("y", -90)))], unit=0.001)

# A cut gem and a twenty-sided die.
mt.write_off("gem.off", [mt.loft("gem", [mt.circle(r, z, 16, p) for r, z, p in ((0.02, -0.30, 0), (0.20, -0.14, 0), (0.38, 0.02, 0), (0.38, 0.05, 0), (0.30, 0.14, 0), (0.21, 0.18, 0))])])
g = (1 + math.sqrt(5)) / 2
corners = [p for a in (-1, 1) for b in (-g, g) for p in ((0, a, b), (a, b, 0), (b, 0, a))]
corners = np.array(corners) * 0.17
faces = []
for i in range(12):
    for j in range(i + 1, 12):
        for k in range(j + 1, 12):
            if all(abs(np.linalg.norm(corners[p] - corners[q]) - 0.34) < 1e-9 for p, q in ((i, j), (j, k), (k, i))):
                out = np.dot(np.cross(corners[j] - corners[i], corners[k] - corners[i]), corners[i]) > 0
                faces.append((i, j, k) if out else (i, k, j))
mt.write_off("die.off", [mt.part("die", corners, faces)])

# An egg, and a rocket of a hull, a nose and three fins.
mt.write_ply("egg.ply", [mt.uv_sphere("egg", 0.28, 12, lambda v: v * np.array([1, 1, 1.3]) * (1 - 0.18 * v[2] * np.array([1, 1, 0])))], text=True)
fin = mt.part("fin", [(0.14, y, z) for y in (-0.02, 0.02) for z in (0.02, 0.40)] + [(0.36, y, z) for y in (-0.012, 0.012) for z in (-0.08, 0.10)],
              [(0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3), (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5)])
mt.write_glb("rocket.glb", [mt.turned("hull", [(0.10, 0.0), (0.17, 0.10), (0.18, 0.40), (0.16, 0.70)]),
                            mt.turned("nose", [(0.16, 0.70), (0.125, 0.88), (0.07, 1.02), (0.01, 1.10)]), fin],
             [("hull", {}), ("nose", {})] + [("fin", {"rotation": [0, 0, math.sin(math.pi * i / 3), math.cos(math.pi * i / 3)]}) for i in range(3)])
