"""The demo's picture: bodies, a segment from each to its nearest neighbour, overlapping pairs in red."""
import matplotlib

matplotlib.use("Agg")
import matplotlib.patheffects as effects
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection

import render

WIDTH, HEIGHT = 1600, 1000
ELEVATION, MARGIN = 27, 0.09  # degrees; share of the image that stays free
RED = np.array([0.86, 0.30, 0.26])
INK = "#1f2937"
SEGMENT = "#0b57d0"
# Muted, light colours, so that red and blue stand out.
PALETTE = np.array(
    [
        [0.58, 0.68, 0.78],
        [0.78, 0.72, 0.60],
        [0.62, 0.74, 0.66],
        [0.72, 0.66, 0.78],
        [0.80, 0.68, 0.64],
        [0.60, 0.74, 0.77],
        [0.74, 0.76, 0.62],
        [0.69, 0.71, 0.75],
    ]
)


def draw(path, names, meshes, rows, title, footnote, samples):
    """Writes a PNG.

    names: of the bodies, in the order of ids. meshes: for each body (vertices (V, 3) in the world, triangles (T, 3)).
    rows: dicts with body, neighbour (ids), status (word), distance, point, other_point (witnesses, (3,) each).
    samples: of the surfaces in each direction of a pixel.
    """
    touching = {i for row in rows if row["status"] in ("overlap", "contact") for i in (row["body"], row["neighbour"])}
    coloured = [(v, t, RED if i in touching else PALETTE[i % len(PALETTE)]) for i, (v, t) in enumerate(meshes)]
    points = np.concatenate([v for v, _ in meshes])
    low, high = points.min(0), points.max(0)
    large = render.Camera(
        points, _best_azimuth(meshes, points), ELEVATION, WIDTH * samples, HEIGHT * samples, MARGIN
    )
    image, distance, owner = render.render(coloured, large, ground=low[2] - 0.04 * (high - low).max())
    distance = distance[samples // 2::samples, samples // 2::samples]

    figure = plt.figure(figsize=(WIDTH / 100, HEIGHT / 100), dpi=100)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.imshow(render.shrink(image, samples), interpolation="nearest", extent=(0, WIDTH, HEIGHT, 0))
    axes.axis("off")
    axes.autoscale(False)

    def project(world):
        return large.project(np.atleast_2d(world)) / [samples, samples, 1]

    for row in rows:
        if row["status"] not in ("overlap", "contact") and np.isfinite(row["point"]).all():
            _draw_distance(axes, project, np.linspace(row["point"], row["other_point"], 65), distance,
                           0.01 * (high - low).max())

    centres = np.array([_label_place(owner[::8, ::8] == i) * 8 / samples if (owner[::8, ::8] == i).any()
                        else project(v.mean(0))[0, :2] for i, (v, _) in enumerate(meshes)])
    for i, (name, (x, y)) in enumerate(zip(names, _spread(centres, [7.6 * len(name) + 8 for name in names], 20))):
        axes.text(
            x,
            y,
            name,
            color="#8c1d18" if i in touching else INK,
            fontsize=10.5,
            ha="center",
            va="center",
            zorder=4,
            path_effects=[effects.withStroke(linewidth=2.6, foreground="white", alpha=0.8)],
        )

    axes.text(36, 48, title, color=INK, fontsize=17, weight="bold", va="center")
    axes.text(36, 78, footnote, color="#4b5563", fontsize=11.5, va="center")
    _draw_legend(axes)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def _draw_distance(axes, project, world, distance, tolerance):
    """Draws the way between two witness points, (n, 3) in the world.

    distance: (HEIGHT, WIDTH) of the visible surface in front of the eye. tolerance: metres.
    """
    # Hidden parts are drawn faintly, to show the order in depth.
    screen = project(world)
    column = screen[:, 0].astype(int).clip(0, WIDTH - 1)
    line = screen[:, 1].astype(int).clip(0, HEIGHT - 1)
    visible = screen[:, 2] <= distance[line, column] + tolerance
    pieces = np.stack([screen[:-1, :2], screen[1:, :2]], axis=1)
    seen = visible[:-1] & visible[1:]
    axes.add_collection(LineCollection(pieces[~seen], colors=SEGMENT, linewidths=1.0, alpha=0.35))
    axes.add_collection(LineCollection(pieces[seen], colors="white", linewidths=4.0, alpha=0.9))
    axes.add_collection(LineCollection(pieces[seen], colors=SEGMENT, linewidths=2.0, capstyle="round"))
    ends = screen[[0, -1]]
    axes.scatter(ends[:, 0], ends[:, 1], s=20, color=SEGMENT, edgecolor="white", linewidth=0.8, zorder=3,
                 alpha=1.0 if visible[[0, -1]].all() else 0.6)


def _draw_legend(axes):
    legend_y = HEIGHT - 36
    axes.plot([36, 76], [legend_y] * 2, color=SEGMENT, lw=2)
    axes.scatter([36, 76], [legend_y] * 2, s=20, color=SEGMENT, edgecolor="white", linewidth=0.8, zorder=3)
    axes.text(88, legend_y, "to the nearest neighbour, between witness points", fontsize=11.5, color=INK, va="center")
    axes.scatter([500], [legend_y], s=110, color=RED, marker="s")
    axes.text(516, legend_y, "overlapping", fontsize=11.5, color=INK, va="center")


def _best_azimuth(meshes, points):
    """The direction (degrees) from which the bodies hide each other least; small ones count equally."""
    def visible(azimuth):
        owner = render.seen(meshes, render.Camera(points, azimuth, ELEVATION, WIDTH // 5, HEIGHT // 5, MARGIN))
        return np.sqrt(np.bincount(owner[owner >= 0], minlength=len(meshes))).sum()

    return max(range(-180, 180, 15), key=visible)


def _label_place(mask):
    """x, y of a pixel deep inside a mask: the last one left when its rim is repeatedly removed."""
    while True:
        y, x = np.nonzero(mask)
        padded = np.pad(mask, 1)
        mask = mask & padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
        if not mask.any():
            middle = np.argmin(np.hypot(x - x.mean(), y - y.mean()))
            return np.array([x[middle] + 0.5, y[middle] + 0.5])


def _spread(centres, widths, height):
    """Moves labels of these widths vertically until none covers another."""
    places = np.array(centres, float)
    for _ in range(200):
        moved = False
        for i in range(len(places)):
            for j in range(i):
                dx, dy = np.abs(places[i] - places[j])
                if dx < (widths[i] + widths[j]) / 2 and dy < height:
                    push = (height - dy) / 2 + 0.5
                    sign = 1 if (places[i, 1], i) > (places[j, 1], j) else -1
                    places[i, 1] += sign * push
                    places[j, 1] -= sign * push
                    moved = True
        if not moved:
            break
    return places
