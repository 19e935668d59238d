"""Updates of an engine or a client: poses, points, joints, attachments and allowed contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Optional, Union

import numpy as np

from .._arguments import contiguous, to_cloud, to_floats, to_integer, to_list, to_number
from .._joints import JointsRef, JointTable
from .._names import BodyRef, NameTable
from .._poses import as_one_pose, as_pose7, stack_poses
from .._query.limits import beyond_limits
from .._words import NONE


@dataclass(frozen=True)
class UpdateResult:
    """The effect of an update, which applies as a whole, in one snapshot."""

    revision: int  #: of the snapshot that contains the update
    scene_revision: int
    applied: int
    bad: int  #: stored; the body has the status BAD_POSE until a valid pose arrives
    unknown: int  #: ids outside the scene, ignored
    fixed: int  #: static bodies, ignored


#: (N, 6) or (N,), in the order of an update's entries.
Velocities = Optional[np.ndarray]


def _in_order(velocities: Mapping[Any, Any], entries: Any, what: str) -> list[Any]:
    """Returns the velocities in the order of the entries, which must have the same keys."""
    if not isinstance(entries, Mapping):
        raise TypeError(f"{what}: a dict only together with a dict, not with an array")
    if velocities.keys() != entries.keys():
        odd = sorted(map(str, velocities.keys() ^ entries.keys()))[0]
        raise ValueError(f"{what}: expected the keys of the update's entries, got {odd!r} in only one of both")
    return [velocities[key] for key in entries]


def _velocities(velocities: Any, shape: tuple[int, ...], expected: str) -> np.ndarray:
    each = contiguous(to_floats(velocities, "velocities", expected))
    if shape[0] == 0 == each.size:
        return each.reshape(shape)
    if each.shape != shape:
        raise ValueError(f"velocities: expected {expected}, shape {shape}, got {np.shape(velocities)}")
    return each


class Updates:
    """The methods of Front for updates; each update applies as a whole, in one snapshot."""

    _names_cache: Optional[NameTable]

    # ---- for subclasses; `revision` is the scene revision of the ids ----------------------------------------------

    @property
    def _names(self) -> NameTable:
        raise NotImplementedError

    @property
    def _joint_table(self) -> JointTable:
        raise NotImplementedError

    def _send_poses(
        self, ids: np.ndarray, poses: np.ndarray, stamp_ns: int, sequence: int, velocities: Velocities, revision: int
    ) -> UpdateResult:
        raise NotImplementedError

    def _send_joints(
        self, ids: np.ndarray, positions: np.ndarray, stamp_ns: int, sequence: int, velocities: Velocities
    ) -> UpdateResult:
        raise NotImplementedError

    def _send_points(
        self, body: int, xyz: np.ndarray, radius: Optional[float], stamp_ns: int, sequence: int, revision: int
    ) -> UpdateResult:
        raise NotImplementedError

    def _send_attach(
        self, child: int, parent: int, pose: Optional[np.ndarray], allow: np.ndarray, revision: int
    ) -> UpdateResult:
        raise NotImplementedError

    def _send_allow(self, a: int, b: int, allow: bool, revision: int) -> UpdateResult:
        raise NotImplementedError

    # ---- updates --------------------------------------------------------------------------------------------------

    def set_poses(
        self,
        poses: Union[Mapping[str, Any], Mapping[int, Any], Mapping[BodyRef, Any], np.ndarray],
        bodies: Optional[Sequence[BodyRef]] = None,
        stamp_ns: int = 0,
        sequence: int = 0,
        velocities: Any = None,
    ) -> UpdateResult:
        """Applies poses of one or more bodies as one snapshot.

        poses: {body: pose}, bodies by name or id; a pose is 7 numbers [x, y, z, qw, qx, qy, qz] (metres) or a (4, 4)
            matrix: X_wb, or X_parent_body with a parent. Or an array (M, 7) or (M, 4, 4) with `bodies`.
        bodies: (M,) names or ids, only with an array. Default: every movable body in the order of ids.
        stamp_ns: a time of the caller's clock, returned with answers (snapshot_stamp_ns); 0 for none. Raises
            QueryError if it is below 0, more than a minute ahead of this machine's clock (UTC), or older than the
            caller's last stamp for one of the bodies. After a restart of its clock, a caller must send one update
            without a stamp.
        sequence: the caller's count of its updates, returned with answers (snapshot_sequence); 0 for none.
        velocities: of the bodies at these poses, for `rate`: {body: twist} of the same bodies, or (M, 6) in the order
            of `poses`: rad/s, then m/s of the body's origin, world axes; of a body with a parent, relative to it. NaN
            is an unknown velocity. Default: all are unknown, and rates of these bodies NaN.

        A pose with NaN, or with a quaternion that cannot be normalised, is stored, and the body has the status
        BAD_POSE. Raises ValueError for a wrong shape, a matrix that is not rigid, masked entries or an unknown name,
        TypeError for a wrong type, and QueryError also for a pose of a robot's link. A call that raises changes
        nothing.
        """
        names = self._names
        if isinstance(poses, Mapping):
            if bodies is not None:
                raise TypeError("bodies: only with an array of poses, not with a dict")
            known = names.ids
            listed = [known[key] if key in known else names.body(key, "poses") for key in poses]
            ids = np.array(listed, dtype=np.uint32)
            array = stack_poses(poses)
        else:
            array = as_pose7(poses, "poses")
            ids = names.movable if bodies is None else names.bodies_array(bodies, "bodies")
            if array.ndim != 2 or len(array) != len(ids):
                raise ValueError(f"poses: expected one pose for each of {len(ids)} bodies, got shape {np.shape(poses)}")
        stamp, number = to_integer(stamp_ns, "stamp_ns"), to_integer(sequence, "sequence")
        speeds = None
        if velocities is not None:
            if isinstance(velocities, Mapping):
                velocities = _in_order(velocities, poses, "velocities")
            speeds = _velocities(velocities, (len(ids), 6), "one twist of 6 numbers for each pose")
        return self._send_poses(ids, array, stamp, number, speeds, names.revision)

    def set_points(
        self,
        body: BodyRef,
        xyz: Any,
        radius: Optional[float] = None,
        stamp_ns: int = 0,
        sequence: int = 0,
    ) -> UpdateResult:
        """Replaces the points of a cloud atomically: a query uses all old points or all new ones.

        body: name or id of a body that was added as points, empty or not.
        xyz: (N, 3) metres, in the body's frame, N >= 0. float32 values are exact; other numbers are rounded to float32.
            No points make the body empty.
        radius: metres, growth of the points or of their voxels. Default: the radius in the scene.
        stamp_ns, sequence: as in set_poses().

        `applied` of the result counts points. Raises QueryError, and replaces nothing, for a body that is no cloud, a
        coordinate that is not finite or beyond 1e9 m, too many points, and late stamps; ValueError for a wrong shape or
        an unknown name; TypeError for a wrong type.
        """
        names = self._names
        return self._send_points(
            names.body(body, "body"),
            to_cloud(xyz, "xyz"),
            None if radius is None else to_number(radius, "radius"),
            to_integer(stamp_ns, "stamp_ns"),
            to_integer(sequence, "sequence"),
            names.revision,
        )

    def set_joints(
        self,
        positions: Union[Mapping[str, float], Mapping[int, float], np.ndarray, Sequence[float]],
        joints: Optional[JointsRef] = None,
        stamp_ns: int = 0,
        sequence: int = 0,
        velocities: Any = None,
    ) -> UpdateResult:
        """Sets positions of robots' joints, and with them the poses of their links, as one snapshot.

        positions: {joint: position}, by name ("panda/panda_joint1") or id, radians and metres; or (J,) numbers with
            `joints`.
        joints: as in distances(), only with an array.
        stamp_ns, sequence: as in set_poses().
        velocities: of the joints at these positions, rad/s and m/s, for `rate`: {joint: speed} of the same joints, or
            (J,) in the order of `positions`. NaN is an unknown speed. Default: all are unknown.

        A position that is NaN or beyond 1e6 is stored, and the links that it moves have the status BAD_POSE. One beyond
        the joint's limits is used, with a warning (JointLimitWarning) if it looks like degrees. Raises QueryError as
        set_poses() does, ValueError for a wrong shape or an unknown name, TypeError for a wrong type.
        """
        table = self._joint_table
        ids, row = table.update(positions, joints)
        if not ((row >= table.lower[ids]) & (row <= table.upper[ids])).all():
            beyond_limits(row[None], table.joints(ids), "positions")
        stamp, number = to_integer(stamp_ns, "stamp_ns"), to_integer(sequence, "sequence")
        speeds = None
        if velocities is not None:
            if isinstance(velocities, Mapping):
                velocities = _in_order(velocities, positions, "velocities")
            speeds = _velocities(velocities, (len(ids),), "one number for each position")
        return self._send_joints(ids, row, stamp, number, speeds)

    def attach(
        self, child: BodyRef, parent: Optional[BodyRef], pose: Any = None, allow: Sequence[BodyRef] = ()
    ) -> UpdateResult:
        """Attaches `child` to `parent`, at its current relative pose or at `pose` (X_parent_child).

        With parent None, detaches the child at its current pose.

        allow: bodies and groups that the child may touch during this attachment, such as the fingers that hold it.
            Their pairs with the child are excluded from pairs=None and from groups until the next attach() of the
            child.

        Raises QueryError for a cycle, a static child, or an unknown pose that is not given.
        """
        names = self._names
        child_id = names.body(child, "child")
        parent_id = NONE if parent is None else names.body(parent, "parent")
        array = None if pose is None else as_one_pose(pose, "pose")
        others = to_list(allow, "allow", "a list of names or ids")
        allowed = [names.selector(other, f"allow[{i}]") for i, other in enumerate(others)]
        done = self._send_attach(child_id, parent_id, array, np.array(allowed, dtype=np.uint32), names.revision)
        self._names_cache = None
        return done

    def allow(self, a: BodyRef, b: BodyRef) -> UpdateResult:
        """Allows contact of `a` and `b` (bodies or groups): excludes their pairs from pairs=None and from groups.

        A query can still name such a pair by its two bodies. `applied` counts the pairs that changed. Raises QueryError
        for an unknown body, and for more pairs than a scene can hold.
        """
        return self._allow(a, b, True)

    def forbid(self, a: BodyRef, b: BodyRef) -> UpdateResult:
        """Includes the pairs of `a` and `b` (bodies or groups) again, whichever call excluded them.

        Pairs of a parent and its child, and of two static bodies, stay excluded.
        """
        return self._allow(a, b, False)

    def _allow(self, a: BodyRef, b: BodyRef, allow: bool) -> UpdateResult:
        names = self._names
        done = self._send_allow(names.selector(a, "a"), names.selector(b, "b"), allow, names.revision)
        self._names_cache = None
        return done
