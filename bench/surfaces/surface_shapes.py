"""Non-convex meshes, and poses, for benchmarks."""

import numpy as np


def ring(triangles, radius, tube, rng):
    """Vertices (N, 3) and triangles (M, 3) of a ring whose tube is bumpy."""
    across = max(6, int(np.sqrt(triangles / 4)))
    along = triangles // (2 * across)
    u, v = np.meshgrid(np.arange(along), np.arange(across), indexing="ij")
    a, b = 2 * np.pi * u / along, 2 * np.pi * v / across
    bumps = sum(np.cos(p * a + q * b + s) for p, q, s in zip(*rng.integers(1, 6, (2, 4)), rng.uniform(0, 6, 4)))
    r = tube * (1 + 0.05 * bumps)
    at = np.stack([(radius + r * np.cos(b)) * np.cos(a), (radius + r * np.cos(b)) * np.sin(a), r * np.sin(b)], -1)
    number = (u % along) * across + v
    right, up = np.roll(number, -1, 0), np.roll(number, -1, 1)
    both = np.roll(right, -1, 1)
    faces = np.stack([number, right, both, number, both, up], -1).reshape(-1, 3)
    return at.reshape(-1, 3), faces.astype(np.uint32)


def block(low, high):
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    at = np.array(low) + corners * (np.array(high) - low)
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return at, np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))], np.uint32)


def shelf():
    """Boards of 2 cm, open in front: a back, two sides, six shelves."""
    boards = [((0, 0, 0), (0.02, 1, 2)), ((0, 0, 0), (0.4, 0.02, 2)), ((0, 0.98, 0), (0.4, 1, 2))]
    boards += [((0, 0, z), (0.4, 1, z + 0.02)) for z in np.linspace(0, 1.98, 6)]
    vertices, faces, count = [], [], 0
    for board in boards:
        at, t = block(*board)
        vertices.append(at)
        faces.append(t + count)
        count += len(at)
    return np.concatenate(vertices), np.concatenate(faces)


def poses(count, spread, centre, rng):
    """(count, 7): positions about the centre, randomly rotated."""
    q = rng.normal(size=(count, 4))
    return np.hstack([centre + rng.uniform(-1, 1, (count, 3)) * spread, q / np.linalg.norm(q, axis=1, keepdims=True)])
