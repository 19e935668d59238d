"""What goes between ROS messages and a daemon. Messages are looked at by their fields alone: nothing of ROS is needed.

ROS writes quaternions x, y, z, w; Clearance w, x, y, z. Stamps are ROS time as nanoseconds, which is the system's clock
unless `use_sim_time` is on: a daemon refuses stamps that go backwards or lie ahead of its clock.
"""

import math
from dataclasses import dataclass
from typing import Any, Optional

from . import clearance
from .planning_scene import SceneFollower, pose_of


def stamp_ns(header: Any) -> int:
    """A header's time in nanoseconds; 0: it has none."""
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


@dataclass(frozen=True)
class Pair:
    """One pair of the daemon's answer."""

    a: str
    b: str
    status: str  #: a word of clearance.Status
    lower: float  #: metres, certified
    upper: float


@dataclass(frozen=True)
class Report:
    """What is published of one answer."""

    pairs: list[Pair]  #: nearer than `within`, or not proved to be farther; the nearest first
    least: float  #: metres: the certified lower bound of the least distance; -inf: not all have a pose, NaN: none has
    stamp_ns: int  #: of the newest poses that the answer saw


class Bridge:
    """A client of a daemon, in the terms of ROS messages.

    robot: the robot of the scene whose joints JointState messages name; "": they name them as the scene does.
    """

    def __init__(self, client: clearance.Client, robot: str = ""):
        self.client = client
        self._prefix = f"{robot}/" if robot else ""
        self._sequence = 0
        self._known: tuple[int, frozenset[str]] = (-1, frozenset())  # a scene's revision, and its joints
        self.unknown: set[str] = set()  #: joints and frames of messages that the scene has not
        self.scene = SceneFollower(client, robot)

    def on_joints(self, message: Any) -> Optional[clearance.PosesDone]:
        """sensor_msgs/JointState: sets the joints that the scene has, as one snapshot; None: it names none of them.

        A message without positions (of velocities alone) says nothing. Raises ValueError where names and positions do
        not fit.
        """
        if not len(message.position):
            return None
        if len(message.position) != len(message.name):
            raise ValueError(f"joint_states: {len(message.name)} names come with {len(message.position)} positions")
        known = self._joints()
        names = [self._prefix + name for name in message.name]
        if len(set(names)) != len(names):
            raise ValueError(f"joint_states: {max(names, key=names.count)} is named twice")
        self.unknown |= set(names) - known
        positions = {n: float(q) for n, q in zip(names, message.position) if n in known}
        if not positions:
            return None
        self._sequence += 1
        return self.client.set_joints(positions, stamp_ns=stamp_ns(message.header), sequence=self._sequence)

    def _joints(self) -> frozenset[str]:
        revision = self.client.scene_revision
        if self._known[0] != revision:
            self._known = revision, frozenset(state.name for state in self.client.joint_states())
        return self._known[1]

    def on_poses(self, transforms: list[Any]) -> Optional[clearance.PosesDone]:
        """geometry_msgs/TransformStamped of the bodies that have their frames' names; None: none of them is known."""
        bodies = {body.name for body in self.client.bodies if not body.is_static}
        poses = {t.child_frame_id: pose_of(t.transform) for t in transforms if t.child_frame_id in bodies}
        self.unknown |= {t.child_frame_id for t in transforms} - bodies
        if not poses:
            return None
        self._sequence += 1
        newest = max(stamp_ns(t.header) for t in transforms if t.child_frame_id in poses)
        return self.client.set_poses(poses, stamp_ns=newest, sequence=self._sequence)

    def recover(self, error: clearance.ClearanceError) -> bool:
        """Goes on after a daemon was started anew, or somebody changed its scene; False: that is not what happened."""
        if isinstance(error, clearance.NewEpoch):
            self.client.acknowledge_epoch()
            self.scene.forget()
        elif getattr(error, "code", None) != clearance.wire.ErrorCode.WRONG_SCENE:
            return False
        self.client.refresh()
        return True

    def report(self, within: float, max_age_s: float = 0.0) -> Report:
        """Asks which pairs may be nearer than `within` metres, and how near the nearest is.

        max_age_s: pairs with an older pose have the status STALE_POSE and no distance; 0: age does not count.
        """
        asked: dict[str, Any] = {"pairs": ("*", "*"), "fields": ("default", "pair")}
        if max_age_s > 0:
            asked |= {"max_pose_age_ns": int(max_age_s * 1e9), "stale_status": True}
        r = self.client.distances(reduce="within", max_distance=within, **asked)
        names = [body.name for body in self.client.bodies]
        rows = zip(r.pairs.tolist(), r.status.tolist(), r.lower.tolist(), r.upper.tolist())
        pairs = [Pair(names[a], names[b], clearance.Status(s).name.lower(), lo, up) for (a, b), s, lo, up in rows]
        least = self.client.distances(reduce="min", **asked | {"fields": ("default", "pair", "flags")})
        known = bool(len(least.lower)) and least.status[0] <= clearance.Status.UNCONVERGED
        whole = known and not least.flags[0] & clearance.Flag.INCOMPLETE
        return Report(
            sorted(pairs, key=lambda pair: (pair.lower, pair.upper)),
            float(least.lower[0]) if whole else -math.inf if known else math.nan,
            int(r.snapshot_stamp_ns),
        )


#: Levels of diagnostic_msgs/DiagnosticStatus.
OK, WARN, ERROR = 0, 1, 2


def level_of(pair: Pair, margin: float) -> int:
    """OK: proved farther than the margin. ERROR: an overlap, or no distance. WARN: neither."""
    if pair.status in ("overlap", "no_pose", "bad_pose", "stale_pose", "unknown_body"):
        return ERROR
    return OK if pair.lower > margin else WARN
