"""A scene from a MuJoCo model. Importing this package does not require mujoco.

MuJoCo reads MJCF and URDF; this module converts the compiled model.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, Optional

import numpy as np

from .._arguments import to_bool, to_text, to_word
from .._front.engine import Engine
from .._front.front import Front
from .._scene.scene import Scene
from .._words import MESH_AS, MeshAsWord
from .mujoco_geoms import add_geoms
from .mujoco_skeleton import BALL, Skeleton
from .urdf import add_trees, names_of
from .world import World


def from_mujoco(
    model: Any, name: str = "mujoco", *, mesh_as: MeshAsWord = "hull", every_geom: bool = False
) -> MujocoWorld:
    """Converts a mujoco.MjModel to a scene with a body for each geom, in the frame of the geom, and with its joints.

        world = clearance.from_mujoco(mujoco.MjModel.from_xml_path("scene.xml"))
        world.set_state(data)                                      # an MjData, or qpos
        world.engine.distances(reduce="min")
        world.engine.check_path(world.configurations(path), **world.moving, margin=0.01)

    name: name of the robot to which the joints belong: joint "elbow" is "mujoco/elbow", with positions as in qpos,
        radians and metres. Joints beyond a ball joint of a body B belong to the robot "mujoco.B".
    mesh_as: body made from meshes. Default: "hull", to which MuJoCo measures; others as in Scene.add_mesh(). A height
        field is a solid, down to its base.
    every_geom: whether geoms that collide with nothing (contype and conaffinity 0, and in no <pair>) are bodies, too.
        Their pairs are disabled, but a query can name them. Default: False; world.left_out lists them.

    Enabled pairs are those that MuJoCo collides: by contype and conaffinity, without excluded, welded and parent-child
    pairs, and with each <pair>. A geom without a name is "BODY#INDEX". Margins and gaps do not change shapes. A plane
    is a half-space, without the ends that MuJoCo draws.

    Raises ValueError, naming it, for a part without a counterpart: a flex, a geom with a signed distance function, a
    plane that moves, a <pair> of two static geoms; SceneError for an unusable name or mesh.
    """
    to_word(mesh_as, MESH_AS, "mesh_as")
    return MujocoWorld(model, to_text(name, "name"), mesh_as, to_bool(every_geom, "every_geom"))


class MujocoWorld(World):
    """A MuJoCo model as a scene, and its states. Made by from_mujoco(); later changes of the model do not count."""

    geoms: dict[int, str]  #: the body of each geom, by its id
    left_out: tuple[str, ...]  #: geoms that collide with nothing, which are no bodies
    geom_bodies: list[int]  #: MuJoCo's body of each geom

    def __init__(self, model: Any, name: str, mesh_as: MeshAsWord, every_geom: bool):
        bodies = names_of(model.nbody, model.body, lambda i: f"body{i}")
        joints = names_of(model.njnt, model.jnt, lambda i: f"{bodies[model.jnt_bodyid[i]]}#{i}")
        names = names_of(model.ngeom, model.geom, lambda i: _unnamed(model, bodies, i))
        skeleton = Skeleton(model, name, bodies, joints)
        self._columns = [int(model.jnt_qposadr[j]) for _, j in skeleton.moving]
        #: For each free or ball joint, its column of qpos and the first number of a pose that it gives.
        self._placed = [(int(model.jnt_qposadr[j]), 3 * (model.jnt_type[j] == BALL)) for _, j in skeleton.placed]
        placed = [link for link, _ in skeleton.placed]
        super().__init__(Scene(), [joint for joint, _ in skeleton.moving], placed, model.qpos0.copy())
        self._mocap = [link for link, _ in skeleton.mocap]
        mocap_bodies = [body for _, body in skeleton.mocap]
        self._mocap_ids = model.body_mocapid[mocap_bodies].tolist()
        self._first_mocap = np.hstack([model.body_pos[mocap_bodies], model.body_quat[mocap_bodies]])
        add_trees(self.scene, skeleton.trees)
        self.geom_bodies = model.geom_bodyid.tolist()
        self.geoms, self.left_out = add_geoms(self.scene, model, skeleton.links, names, mesh_as, every_geom)

    @functools.cached_property
    def engine(self) -> Engine:
        """An engine of the scene, made when first used, at qpos0."""
        engine = Engine(self.scene)
        self._send(engine, self._first)
        self._send_mocap(engine, self._first_mocap)
        return engine

    def set_state(self, q: Any, engine: Optional[Front] = None, stamp_ns: int = 0) -> None:
        """Sets the positions of all joints, and from an MjData also the poses of mocap bodies.

        q: (nq,) qpos, radians, metres and quaternions w, x, y, z; or an MjData, whose qpos and mocap poses count:
            mj_forward() is not needed. From qpos alone, mocap bodies stay where they are.
        engine, stamp_ns: as of World.set_state(). Mocap poses are an update of their own.
        """
        super().set_state(getattr(q, "qpos", q), engine, stamp_ns)
        if hasattr(q, "mocap_pos"):
            self._send_mocap(self.engine if engine is None else engine, self._mocap_poses(q), stamp_ns)

    def inputs(self, data: Any) -> tuple[Any, ...]:
        """Returns the inputs of a prepared query with **world.moving at an MjData, after setting its mocap poses.

        A query at given positions takes a fraction of the time of set_state() followed by one.
        """
        self._send_mocap(self.engine, self._mocap_poses(data))
        return (self.configurations(data.qpos),) if self.moving else ()

    def _positions(self, rows: np.ndarray) -> np.ndarray:
        return rows[:, self._columns]

    def _poses(self, rows: np.ndarray) -> np.ndarray:
        poses = np.zeros((len(rows), len(self._placed), 7))
        for m, (column, first) in enumerate(self._placed):
            poses[:, m, first:] = rows[:, column : column + 7 - first]
        return poses

    def _mocap_poses(self, data: Any) -> np.ndarray:
        return np.hstack([data.mocap_pos, data.mocap_quat])[self._mocap_ids]

    def _send_mocap(self, engine: Front, poses: np.ndarray, stamp_ns: int = 0) -> None:
        if self._mocap:
            engine.set_poses(poses, bodies=self._mocap, stamp_ns=stamp_ns)

    def __repr__(self) -> str:
        return f"<clearance.MujocoWorld: {len(self.geoms)} geoms, {len(self._columns)} joints>"


def _unnamed(model: Any, bodies: Sequence[str], geom: int) -> str:
    body = int(model.geom_bodyid[geom])
    return f"{bodies[body]}#{geom - int(model.body_geomadr[body])}"
