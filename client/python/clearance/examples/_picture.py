"""Draws a scene at the current poses, with lines between nearest points."""

from __future__ import annotations

from typing import Any

import numpy as np

import clearance

from .._adapters.urdf import matrix


def draw(scene: clearance.Scene, engine: clearance.Engine, lines: Any, file: str) -> None:
    """lines: (N, 2, 3) metres, world. Bodies without triangles (half-spaces, clouds) are not drawn."""
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    figure = Figure(figsize=(4.2, 3.0), dpi=100)
    axes: Any = figure.add_axes((0, 0, 1, 1), projection="3d")
    corners = []
    for body, state in zip(engine.bodies, engine.body_states()):
        mesh = scene.display_mesh(body.name) if body.id < len(scene) else None
        if mesh is None or state.status != clearance.Status.OK:
            continue
        X = matrix(state.pose[:3], state.pose[3:])
        points = mesh[0] @ X[:3, :3].T + X[:3, 3]
        color = "tab:gray" if body.is_static else "tab:blue"
        axes.add_collection3d(Poly3DCollection(points[mesh[1]], facecolor=color, alpha=0.35, edgecolor="none"))
        corners.append(points)
    for line in np.asarray(lines, dtype=float).reshape(-1, 2, 3):
        axes.plot(*line.T, color="tab:red", marker="o", markersize=3)
    low, high = np.concatenate(corners).min(axis=0), np.concatenate(corners).max(axis=0)
    for set_limits, center in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), (low + high) / 2):
        set_limits(center - (high - low).max() / 2, center + (high - low).max() / 2)
    axes.set_box_aspect((1, 1, 1), zoom=1.2)
    axes.view_init(elev=25, azim=-70)
    axes.set_axis_off()
    figure.savefig(file)
