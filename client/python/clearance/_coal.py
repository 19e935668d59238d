"""Bodies from shapes of Coal (hpp-fcl) and Pinocchio. Importing this package requires neither.

Shapes are distinguished by the names of their classes, which are the same in coal, hppfcl and pinocchio.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ._scene.scene import Scene


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


def from_pinocchio(model: Any) -> Scene:
    """Creates a scene from a pinocchio.GeometryModel, with a body for each geometry object, by its name.

        scene = clearance.from_pinocchio(model.collision_model)
        engine = clearance.Engine(scene)
        engine.set_poses({g.name: data.oMg[i].homogeneous for i, g in enumerate(model.collision_model.geometryObjects)})

    Only pairs in model.collisionPairs are enabled, unless it is empty. A mesh becomes its hull (from_coal()). Bodies
    start without poses; Pinocchio's placements (GeometryData.oMg) are X_wb.

    Raises TypeError or SceneError, naming the object, for an unsupported shape or a repeated name.
    """
    from ._scene.scene import Scene

    scene = Scene()
    names = []
    for item in model.geometryObjects:
        try:
            shape = from_coal(item.geometry)
        except (TypeError, ValueError) as error:
            raise type(error)(f"{item.name}: {error}") from None
        scene.add_body(item.name, **shape)
        names.append(item.name)
    enabled = {frozenset((pair.first, pair.second)) for pair in model.collisionPairs}
    for i in range(len(names)) if enabled else ():
        for j in range(i):
            if frozenset((i, j)) not in enabled:
                scene.ignore(names[i], names[j])
    return scene


def _rows(points: Any) -> np.ndarray:
    """Converts Coal's vectors to (V, 3)."""
    return np.array([np.asarray(point, dtype=np.float64).reshape(3) for point in points])
