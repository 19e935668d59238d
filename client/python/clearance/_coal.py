"""Bodies from shapes of Coal (hpp-fcl). Importing this package does not require it.

Shapes are distinguished by the names of their classes, which are the same in coal, hppfcl and pinocchio.
"""

from __future__ import annotations

from typing import Any

import numpy as np


def from_coal(geometry: Any) -> dict[str, Any]:
    """Converts a shape of Coal to arguments of add_body() of a Scene or a Client.

        scene.add_body("cup", **clearance.from_coal(coal.Capsule(0.02, 0.1)))

    geometry: a Box, Sphere, Capsule, Cylinder, Cone, Ellipsoid, Convex (the hull of its points), or a BVHModel (its
        vertices: **the hull of the mesh**, while Coal measures to the triangles). A swept sphere's radius grows
        the shape, as in Coal. Metres, in the frame of the geometry.

    Raises TypeError, naming the class, for an unsupported shape: a plane, a half-space (Clearance has only z <= 0,
    placed by a pose), an octree, a height field.
    """
    kind = type(geometry).__name__
    swept = float(getattr(geometry, "getSweptSphereRadius", float)())
    grown = {"radius": swept} if swept else {}
    if kind == "Box":
        return {"box": tuple(2 * float(half) for half in geometry.halfSide), **grown}
    if kind == "Sphere":
        return {"sphere": float(geometry.radius) + swept}
    if kind == "Ellipsoid":
        return {"ellipsoid": tuple(float(axis) for axis in geometry.radii), **grown}
    if kind in ("Capsule", "Cylinder", "Cone"):
        return {kind.lower(): (float(geometry.radius), 2 * float(geometry.halfLength)), **grown}
    if kind.startswith("Convex"):
        return {"vertices": _rows(geometry.point(i) for i in range(geometry.num_points)), **grown}
    if kind.startswith("BVHModel"):
        return {"vertices": _rows(geometry.vertex(i) for i in range(geometry.num_vertices)), **grown}
    raise TypeError(
        f"geometry: {kind} has no counterpart; expected a Box, Sphere, Capsule, Cylinder, Cone, Ellipsoid, Convex "
        "or BVHModel"
    )


def _rows(points: Any) -> np.ndarray:
    """Converts Coal's vectors to (V, 3)."""
    return np.array([np.asarray(point, dtype=np.float64).reshape(3) for point in points])
