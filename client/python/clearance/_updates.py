"""What an engine and a client of the daemon are told: poses, points, joints, and who follows or may touch whom."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Optional, Union

import numpy as np

from ._arguments import to_cloud, to_integer, to_list, to_number
from ._joints import JointsRef, JointTable
from ._limits import beyond_limits
from ._names import BodyRef, NameTable
from ._poses import as_one_pose, as_pose7, stack_poses
from ._words import NONE


@dataclass(frozen=True)
class PosesDone:
    """The effect of a pose update, which applies as a whole, in one snapshot."""

    revision: int  #: of the snapshot that holds the update
    scene_revision: int
    applied: int
    bad: int  #: stored, and answered BAD_POSE until a good one comes
    unknown: int  #: ids outside the scene, ignored
    fixed: int  #: static bodies, ignored


class Updates:
    """What Front says about updates; each of them applies as a whole, in one snapshot."""

    _names_cache: Optional[NameTable]

    # ---- for subclasses -------------------------------------------------------------------------------------------

    @property
    def _names(self) -> NameTable:
        raise NotImplementedError

    @property
    def _joint_table(self) -> JointTable:
        raise NotImplementedError

    def _send_poses(self, ids: np.ndarray, poses: np.ndarray, stamp_ns: int, sequence: int) -> PosesDone:
        raise NotImplementedError

    def _send_joints(self, ids: np.ndarray, positions: np.ndarray, stamp_ns: int, sequence: int) -> PosesDone:
        raise NotImplementedError

    def _send_points(
        self, body: int, xyz: np.ndarray, radius: Optional[float], stamp_ns: int, sequence: int
    ) -> PosesDone:
        raise NotImplementedError

    def _send_attach(self, child: int, parent: int, pose: Optional[np.ndarray], allow: np.ndarray) -> PosesDone:
        raise NotImplementedError

    def _send_allow(self, a: int, b: int, allow: bool) -> PosesDone:
        raise NotImplementedError

    # ---- updates --------------------------------------------------------------------------------------------------

    def set_poses(
        self,
        poses: Union[Mapping[str, Any], Mapping[int, Any], Mapping[BodyRef, Any], np.ndarray],
        bodies: Optional[Sequence[BodyRef]] = None,
        stamp_ns: int = 0,
        sequence: int = 0,
    ) -> PosesDone:
        """Applies poses of one or more bodies as one snapshot.

        poses: {body: pose}, bodies by name or id; a pose is 7 numbers [x, y, z, qw, qx, qy, qz] (metres) or a (4, 4)
            matrix, X_wb, or of a body with a parent X_parent_body. Or an array (M, 7) or (M, 4, 4) with `bodies`.
        bodies: (M,) names or ids, only with an array; None: every movable body in the order of ids.
        stamp_ns: a time of the caller's clock, which answers then carry (snapshot_stamp_ns); 0: none. Raises
            QueryError, and applies nothing, if it is below 0, more than a minute ahead of this machine's clock (UTC),
            or older than the last that this caller gave for one of the bodies. A caller whose clock starts again sends
            one update without a stamp first.
        sequence: the caller's count of its updates, which answers then carry (snapshot_sequence); 0: none.

        A pose with NaN, or whose quaternion cannot be normalised, is stored as bad: queries then answer BAD_POSE.
        Raises ValueError for a wrong shape, a matrix that is not rigid, masked entries or an unknown name, TypeError
        for a wrong type, QueryError also for a pose of a robot's link. A call that raises changes nothing.
        """
        names = self._names
        if isinstance(poses, Mapping):
            if bodies is not None:
                raise TypeError("bodies: only with an array of poses, not with a dict")
            ids = np.array([names.body(key, "poses") for key in poses], dtype=np.uint32)
            array = stack_poses(poses)
        else:
            array = as_pose7(poses, "poses")
            ids = names.movable if bodies is None else names.bodies_array(bodies, "bodies")
            if array.ndim != 2 or len(array) != len(ids):
                raise ValueError(f"poses: expected one pose for each of {len(ids)} bodies, got shape {np.shape(poses)}")
        return self._send_poses(ids, array, to_integer(stamp_ns, "stamp_ns"), to_integer(sequence, "sequence"))

    def set_points(
        self,
        body: BodyRef,
        xyz: Any,
        radius: Optional[float] = None,
        stamp_ns: int = 0,
        sequence: int = 0,
    ) -> PosesDone:
        """Replaces the points of a body of points, all at once: a query sees all of the old ones or all of the new.

        body: by name or id; one that was made of points, and may have none yet.
        xyz: (N, 3) metres, in the body's frame, N >= 0. float32 is taken as it is, exactly; other numbers are rounded
            to float32 first. Without points nothing is there.
        radius: metres that the points, or the voxels about them, are grown by; None: as the scene has it.
        stamp_ns, sequence: as in set_poses().

        `applied` of the result counts points. Raises QueryError, and replaces nothing, for another body, a coordinate
        that is not finite or beyond 1e9 m, more points than may be, and late stamps; ValueError for a wrong shape or an
        unknown name; TypeError for a wrong type.
        """
        return self._send_points(
            self._names.body(body, "body"),
            to_cloud(xyz, "xyz"),
            None if radius is None else to_number(radius, "radius"),
            to_integer(stamp_ns, "stamp_ns"),
            to_integer(sequence, "sequence"),
        )

    def set_joints(
        self,
        positions: Union[Mapping[str, float], Mapping[int, float], np.ndarray, Sequence[float]],
        joints: Optional[JointsRef] = None,
        stamp_ns: int = 0,
        sequence: int = 0,
    ) -> PosesDone:
        """Sets positions of robots' joints as one snapshot: the poses of their links follow.

        positions: {joint: position}, by name ("panda/panda_joint1") or id, radians and metres; or (J,) numbers with
            `joints`.
        joints: as in distances(), only with an array.
        stamp_ns, sequence: as in set_poses().

        A position with NaN, or beyond 1e6, is stored as bad: queries then answer BAD_POSE of the links that it moves.
        One beyond the joint's limits is used, with a warning (JointLimitWarning) where it looks like degrees. Raises
        QueryError as set_poses() does, ValueError for a wrong shape or an unknown name, TypeError for a wrong type.
        """
        table = self._joint_table
        ids, row = table.update(positions, joints)
        if not ((row >= table.lower[ids]) & (row <= table.upper[ids])).all():
            beyond_limits(row[None], table.joints(ids), "positions")
        return self._send_joints(ids, row, to_integer(stamp_ns, "stamp_ns"), to_integer(sequence, "sequence"))

    def attach(
        self, child: BodyRef, parent: Optional[BodyRef], pose: Any = None, allow: Sequence[BodyRef] = ()
    ) -> PosesDone:
        """Makes `child` follow `parent`, from where it is now or at `pose` (X_parent_child).

        With parent None the child follows nobody and stays where it is.

        allow: bodies and groups that the child may touch while it is attached so, such as the fingers that hold it:
            their pairs with it are left out of pairs=None and of groups until the child is attached anew or set free.

        Raises QueryError for a cycle, a static child, or a body whose pose is not known and was not given.
        """
        child_id = self._names.body(child, "child")
        parent_id = NONE if parent is None else self._names.body(parent, "parent")
        array = None if pose is None else as_one_pose(pose, "pose")
        others = to_list(allow, "allow", "a list of names or ids")
        allowed = [self._names.selector(other, f"allow[{i}]") for i, other in enumerate(others)]
        done = self._send_attach(child_id, parent_id, array, np.array(allowed, dtype=np.uint32))
        self._names_cache = None
        return done

    def allow(self, a: BodyRef, b: BodyRef) -> PosesDone:
        """Lets `a` and `b` (bodies or groups) touch: their pairs are left out of pairs=None and of groups.

        A pair that a query names by its two bodies is answered all the same. `applied` says how many pairs changed.
        Raises QueryError for an unknown body, and for more pairs than a scene keeps.
        """
        return self._allow(a, b, True)

    def forbid(self, a: BodyRef, b: BodyRef) -> PosesDone:
        """Has the pairs of `a` and `b` (bodies or groups) looked at again, whoever let them touch.

        Those of a parent and its child, and of two static bodies, stay left out.
        """
        return self._allow(a, b, False)

    def _allow(self, a: BodyRef, b: BodyRef, allow: bool) -> PosesDone:
        done = self._send_allow(self._names.selector(a, "a"), self._names.selector(b, "b"), allow)
        self._names_cache = None
        return done
