#!/usr/bin/env python3
"""Draws docs/pictures/edge.gif: an edge with free samples and a contact between two of them (tools/edge.py)."""
import sys

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

import clearance
import render
from edge import SCENE, STEP, Edge
from picture import INK, PALETTE, RED

WIDTH, HEIGHT, OVERSAMPLING = 720, 420, 2
AZIMUTH, ELEVATION, MARGIN = -35, 24, 0.04  # degrees; share of the image that stays free
SHOWN = ("probe", "sheet", "arm/gripper", "arm/left_finger", "arm/right_finger")  # bodies that the camera fits
COLOURS = 96
GREEN = "#18794e"


def rotation(q):
    """(3, 3) matrix of a unit quaternion w, x, y, z."""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


class Film:
    """Frames of the edge's scene, from one camera."""

    def __init__(self, edge):
        self.edge = edge
        self.scene = clearance.Scene.load(SCENE)
        ends = [self.meshes(t) for t in (0.25, 0.5, 0.75)]
        names = [body.name for body in edge.engine.bodies]
        points = np.concatenate([meshes[names.index(name)][0] for meshes in ends for name in SHOWN])
        self.camera = render.Camera(
            points, AZIMUTH, ELEVATION, WIDTH * OVERSAMPLING, HEIGHT * OVERSAMPLING, MARGIN
        )
        self.names = names

    def meshes(self, time):
        """(vertices in the world, triangles) of each body at a time in [0, 1]."""
        engine = self.edge.engine
        engine.set_joints(dict(zip((state.name for state in engine.joint_states()), self.edge.at([time])[0])))
        found = []
        for body, state in zip(engine.bodies, engine.body_states()):
            mesh = self.scene.display_mesh(body.id)
            vertices, triangles = mesh if mesh else (np.zeros((3, 3)), np.zeros((1, 3), int))
            found.append((vertices @ rotation(state.pose[3:]).T + state.pose[:3], triangles))
        return found

    def frame(self, time, red, line, colour):
        """An image at a time. red: names of bodies. line: text below."""
        coloured = [
            (v, t, RED if self.names[i] in red else PALETTE[i % len(PALETTE)])
            for i, (v, t) in enumerate(self.meshes(time))
        ]
        image = render.shrink(render.render(coloured, self.camera)[0], OVERSAMPLING)
        figure = Figure(figsize=(WIDTH / 100, HEIGHT / 100), dpi=100)
        canvas = FigureCanvasAgg(figure)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.imshow(image, interpolation="nearest", extent=(0, WIDTH, HEIGHT, 0))
        axes.axis("off")
        axes.text(18, HEIGHT - 22, line, color=colour, fontsize=12, weight="bold", va="center",
                  bbox={"facecolor": "white", "alpha": 0.85, "edgecolor": "none"})
        canvas.draw()
        return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())


def main(path):
    edge = Edge()
    sampled, proved = edge.sampled(), edge.proved()
    film = Film(edge)
    times = edge.times(STEP)
    frames, waits = [], []
    for i, time in enumerate(times):
        line = f"sample {i + 1} of {sampled.count}: free, proved at least {1000 * sampled.nearest:.1f} mm apart"
        frames.append(film.frame(time, (), line, GREEN))
        waits.append(90)
    waits[-1] = 900
    before = int(np.searchsorted(times, proved.contact)) - 1
    for time in np.linspace(times[before], times[before + 1], 17):
        hit = time >= proved.contact
        line = (f"contact of {proved.bodies[0]} and {proved.bodies[1]}, proved at t = {proved.contact:.4f}" if hit
                else f"between samples {before + 1} and {before + 2}: t = {time:.4f}")
        frames.append(film.frame(time, proved.bodies if hit else (), line, "#a1241d" if hit else INK))
        waits.append(1800 if hit else 140)
        if hit:
            break
    palette = frames[-1].quantize(COLOURS, dither=Image.Dither.NONE)
    frames = [frame.quantize(COLOURS, palette=palette, dither=Image.Dither.NONE) for frame in frames]
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=waits, loop=0, optimize=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1] if len(sys.argv) > 1 else "docs/pictures/edge.gif"))
