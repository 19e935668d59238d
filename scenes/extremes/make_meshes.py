#!/usr/bin/env python3
"""Writes this scene's meshes: a ball of 1 m about (4096, -2048, 1024) m in its own frame, and a flat one."""

import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import mesh_tools as mt

os.chdir(os.path.join(os.path.dirname(os.path.abspath(__file__)), "meshes"))

# float32 has steps of half a millimetre there.
mt.write_ply("far.ply", [mt.moved(mt.uv_sphere("far", 1.0, 8), (4096, -2048, 1024))])
mt.write_stl("sheet.stl", [mt.part("sheet", [(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0), (1, 0.5, 0)], [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)])])
