"""Geoms of a MuJoCo model as bodies, and the pairs that MuJoCo collides."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .._poses import pose7_from_matrix
from .._scene.scene import Scene
from .._words import MeshAsWord
from .urdf import matrix


def add_geoms(
    scene: Scene, model: Any, links: Sequence[str], names: Sequence[str], mesh_as: MeshAsWord, every_geom: bool
) -> tuple[dict[int, str], tuple[str, ...]]:
    """Adds geoms, which follow the links of their bodies, and disables pairs.

    Returns the name of the body of each geom, and the names of the geoms left out.
    """
    import mujoco

    if model.nflex:
        flex = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, 0)
        raise ValueError(f"model: the flex {flex!r} is deformable, which has no counterpart")
    collides = colliding(model)
    wanted = [g for g in range(model.ngeom) if every_geom or collides[g].any()]
    fixed = {b for b in range(model.nbody) if model.body_weldid[b] == 0}
    for g in wanted:
        body = int(model.geom_bodyid[g])
        try:
            shape = shape_of(model, g, mesh_as)
        except ValueError as error:
            raise ValueError(f"geom {names[g]!r}: {error}") from None
        if body in fixed:
            X = _in_world(model, body) @ matrix(model.geom_pos[g], model.geom_quat[g])
            scene.add_body(names[g], **shape, static=True, pose=pose7_from_matrix(X))
        elif "half_space" in shape:
            raise ValueError(f"geom {names[g]!r}: a plane on {links[body]!r}, which moves, has no counterpart")
        else:
            pose = [*model.geom_pos[g], *model.geom_quat[g]]
            scene.add_body(names[g], **shape, parent=links[body], pose=pose)
    for i, g in enumerate(wanted):
        for other in wanted[:i]:
            both = {int(model.geom_bodyid[g]), int(model.geom_bodyid[other])} <= fixed
            if both and collides[g, other]:
                raise ValueError(
                    f"pair: geoms {names[other]!r} and {names[g]!r} are both static: their distance never changes, and "
                    "static pairs have no counterpart"
                )
            if not both and not collides[g, other]:
                scene.ignore(names[g], names[other])
    return {g: names[g] for g in wanted}, tuple(names[g] for g in range(model.ngeom) if g not in set(wanted))


def colliding(model: Any) -> np.ndarray:
    """(ngeom, ngeom) bool: the pairs of geoms that MuJoCo collides."""
    import mujoco

    contype, conaffinity = model.geom_contype, model.geom_conaffinity
    collides = (contype[:, None] & conaffinity[None, :]) | (conaffinity[:, None] & contype[None, :]) != 0
    body = model.geom_bodyid
    weld = model.body_weldid[body]
    moves = model.body_treeid[body] >= 0  # neither static nor of a mocap body
    collides &= (weld[:, None] != weld[None, :]) & (moves[:, None] | moves[None, :])
    if not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT:
        parent = model.body_weldid[model.body_parentid[weld]]
        related = (weld[:, None] == parent[None, :]) | (parent[:, None] == weld[None, :])
        collides &= ~(related & (weld != 0)[:, None] & (weld != 0)[None, :])
    for signature in model.exclude_signature.tolist():
        first, second = body == signature >> 16, body == signature & 0xFFFF
        collides &= ~(np.outer(first, second) | np.outer(second, first))
    for a, b in zip(model.pair_geom1.tolist(), model.pair_geom2.tolist()):
        collides[a, b] = collides[b, a] = True
    return collides


def shape_of(model: Any, geom: int, mesh_as: MeshAsWord) -> dict[str, Any]:
    """Returns the arguments of add_body() of a geom. Raises ValueError for an unsupported kind."""
    import mujoco

    kinds, kind = mujoco.mjtGeom, int(model.geom_type[geom])
    x, y, z = model.geom_size[geom].tolist()
    mesh = int(model.geom_dataid[geom])
    if kind == kinds.mjGEOM_PLANE:
        return {"half_space": True}
    if kind == kinds.mjGEOM_SPHERE:
        return {"sphere": x}
    if kind == kinds.mjGEOM_CAPSULE:
        return {"capsule": (x, 2 * y)}
    if kind == kinds.mjGEOM_CYLINDER:
        return {"cylinder": (x, 2 * y)}
    if kind == kinds.mjGEOM_BOX:
        return {"box": (2 * x, 2 * y, 2 * z)}
    if kind == kinds.mjGEOM_ELLIPSOID:
        return {"ellipsoid": (x, y, z)}
    if kind == kinds.mjGEOM_HFIELD:
        return {"mesh": height_field(model, mesh), "mesh_as": "solid"}
    if kind == kinds.mjGEOM_MESH:
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        vertices = np.array(model.mesh_vert[first : first + count], dtype=float)
        if mesh_as == "hull":
            return {"vertices": vertices}
        face, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
        return {"mesh": (vertices, np.array(model.mesh_face[face : face + faces])), "mesh_as": mesh_as}
    raise ValueError(f"{kinds(kind).name} has no counterpart")


def height_field(model: Any, field: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns a closed mesh: the surface, with the diagonals of MuJoCo's prisms, walls, and the base."""
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    half_x, half_y, top, base = model.hfield_size[field].tolist()
    first = int(model.hfield_adr[field])
    heights = top * np.array(model.hfield_data[first : first + rows * columns], dtype=float)
    x, y = np.meshgrid(_grid(half_x, columns), _grid(half_y, rows))
    surface = np.column_stack([x.ravel(), y.ravel(), heights])
    vertices = np.concatenate([surface, np.column_stack([x.ravel(), y.ravel(), np.full(len(surface), -base)])])
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    up = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    ring = np.concatenate([index[0, :-1], index[:-1, -1], index[-1, :0:-1], index[:0:-1, 0]])  # from above, to the left
    after, under = np.roll(ring, -1), len(surface)
    walls = [np.column_stack([ring + under, after + under, after]), np.column_stack([ring + under, after, ring])]
    return vertices, np.concatenate([up, up[:, ::-1] + under, *walls])


def _grid(half: float, count: int) -> np.ndarray:
    """(count,) coordinates from -half to half, computed as MuJoCo does."""
    return (2.0 * half / (count - 1)) * np.arange(count) - half


def _in_world(model: Any, body: int) -> np.ndarray:
    X = np.eye(4)
    while body:
        X, body = matrix(model.body_pos[body], model.body_quat[body]) @ X, int(model.body_parentid[body])
    return X
