"""Bridge between ROS messages and a daemon. It uses only the fields of messages, so that nothing of ROS is needed.

ROS orders quaternions x, y, z, w; Clearance w, x, y, z. Stamps are ROS time in nanoseconds, which is the system's clock
unless `use_sim_time` is on. A daemon rejects stamps that go backwards or are ahead of its clock; after a backward jump
of the publisher's clock the bridge sends an update without a stamp, after which older stamps are valid again.
"""

import math
from dataclasses import dataclass, field
from typing import Any, Optional

from . import clearance
from .planning_scene import SceneFollower
from .shapes import pose_of

#: A stamp older than the last by more than this means a clock that was set back, not a late message.
JUMP_NS = 1_000_000_000


def stamp_ns(header: Any) -> int:
    """A header's time in nanoseconds, or 0 if it has none."""
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


@dataclass(frozen=True)
class Pair:
    """One pair of the daemon's answer."""

    a: str
    b: str
    status: str  #: a name of clearance.Status
    lower: float  #: metres, certified
    upper: float


@dataclass(frozen=True)
class Report:
    """Published content of one answer."""

    pairs: list[Pair]  #: nearer than `within`, or not proved to be farther; the nearest first
    least: float  #: metres: certified lower bound of the least distance; -inf if nothing is proved, or input is stale
    stamp_ns: int  #: of the newest poses in the answer
    stale: list[str] = field(default_factory=list)  #: inputs that are missing or too old; empty if the answer is fresh


class Bridge:
    """A client of a daemon, in terms of ROS messages.

    robot: the robot of the scene whose joints JointState messages name; if "", they use the scene's names.
    frame: as in SceneFollower.
    """

    def __init__(self, client: clearance.Client, robot: str = "", frame: str = ""):
        self.client = client
        self._prefix = f"{robot}/" if robot else ""
        self._sequence = 0
        self._known: tuple[int, frozenset[str]] = (-1, frozenset())  # a scene's revision, and its joints
        self._stamps: dict[str, int] = {}  # the last one of each joint and body
        self._last: dict[tuple[str, ...], Any] = {}  # stamp and positions of the last message that named these
        self.unknown: set[str] = set()  #: joints and frames of messages that are not in the scene
        self.scene = SceneFollower(client, robot, frame)

    def on_joints(self, message: Any) -> Optional[clearance.UpdateResult]:
        """sensor_msgs/JointState: sets the joints that the scene has, as one snapshot. Returns None if it names none.

        A message without positions (with velocities alone) is ignored, and so is one that repeats the last one with its
        stamp: its publisher may have lost the robot. Raises ValueError if names and positions do not match.
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
        return self._send(self.client.set_joints, positions, stamp_ns(message.header))

    def joint_name(self, name: str) -> str:
        """Returns the scene's name of a joint of ROS."""
        return self._prefix + name

    def _send(self, send: Any, values: dict[str, Any], stamp: int) -> Optional[clearance.UpdateResult]:
        """Sends an update, unless it is empty or an exact repeat; without its stamp if the clock was set back."""
        names = tuple(values)
        if not values or (stamp and self._last.get(names) == (stamp, values)):
            return None
        is_set_back = any(stamp < self._stamps.get(name, 0) - JUMP_NS for name in names)
        self._sequence += 1
        done = send(values, stamp_ns=0 if is_set_back else stamp, sequence=self._sequence)
        self._last[names] = (stamp, values)
        self._stamps.update(dict.fromkeys(names, stamp))
        return done

    def _joints(self) -> frozenset[str]:
        revision = self.client.scene_revision
        if self._known[0] != revision:
            self._known = revision, frozenset(state.name for state in self.client.joint_states())
        return self._known[1]

    def on_poses(self, transforms: list[Any]) -> Optional[clearance.UpdateResult]:
        """geometry_msgs/TransformStamped of the bodies named like their frames. Returns None if none is known.

        Raises ValueError if a frame occurs twice.
        """
        frames = [t.child_frame_id for t in transforms]
        if len(set(frames)) != len(frames):
            raise ValueError(f"tf: {max(frames, key=frames.count)} comes twice")
        bodies = {body.name for body in self.client.bodies if not body.is_static}
        poses = {t.child_frame_id: pose_of(t.transform) for t in transforms if t.child_frame_id in bodies}
        self.unknown |= {t.child_frame_id for t in transforms} - bodies
        newest = max((stamp_ns(t.header) for t in transforms if t.child_frame_id in poses), default=0)
        return self._send(self.client.set_poses, poses, newest)

    def recover(self, error: clearance.ClearanceError) -> bool:
        """Continues after a restart of the daemon, or a change of its scene; returns False for any other error."""
        if isinstance(error, clearance.NewEpoch):
            self.client.acknowledge_epoch()
            self.scene.forget()
            self._last.clear()
            self._stamps.clear()
        elif getattr(error, "code", None) != clearance.wire.ErrorCode.WRONG_SCENE:
            return False
        self.client.refresh()
        return True

    def report(self, within: float, max_age_s: float = 0.0) -> Report:
        """Queries the pairs that may be nearer than `within` metres, and the least distance.

        max_age_s: if an input is missing or older, `least` is -inf, and pairs with an older pose have the status
        STALE_POSE and no distance; 0 ignores age.
        """
        stale = self.stale(max_age_s)
        requested: dict[str, Any] = {"pairs": ("*", "*"), "fields": ("default", "pair", "flags")}
        requested["max_pose_age_ns"] = int(max_age_s * 1e9) if stale else 0
        r = self.client.prepare("distances", reduce="within", max_distance=within, **requested).run()
        names = [body.name for body in self.client.bodies]
        rows = zip(r.pairs.tolist(), r.status.tolist(), r.lower.tolist(), r.upper.tolist())
        pairs = [Pair(names[a], names[b], clearance.Status(s).name.lower(), lo, up) for (a, b), s, lo, up in rows]
        least = self.client.prepare("distances", reduce="min", **requested).run()
        known = bool(len(least.lower)) and least.status[0] <= clearance.Status.UNCONVERGED
        whole = known and not stale and not least.flags[0] & clearance.Flag.INCOMPLETE
        return Report(
            sorted(pairs, key=lambda pair: (pair.lower, pair.upper)),
            float(least.lower[0]) if whole else -math.inf,
            int(r.snapshot_stamp_ns),
            stale,
        )

    def stale(self, max_age_s: float) -> list[str]:
        """Inputs that are missing or older, with a sentence for each.

        Objects of planning scenes that could not be taken are missing. Joints, bodies and clouds that have ever been
        set become stale, except objects of planning scenes and attached bodies. Of the robot's joints at least one must
        have been set.
        """
        why = "the daemon was restarted, or a message did not reach it: it lacks objects until a whole scene comes"
        found = [f"planning_scene: {why}"] if self.scene.is_lost else []
        found += self.scene.missing()
        if max_age_s <= 0:
            return found
        ages = {joint.name: joint.age_ns for joint in self.client.joint_states()}
        own = [name for name in ages if name.startswith(self._prefix)]
        for robot in sorted({name.partition("/")[0] for name in own}):
            if all(ages[name] is None for name in own if name.startswith(f"{robot}/")):
                found.append(f"joint_states: no position of {robot} has come")
        kept = self.scene.bodies()
        for body, state in zip(self.client.bodies, self.client.body_states()):
            if (state.parent is None or body.is_cloud) and body.name not in kept:
                ages[body.name] = state.age_ns
        old = (name for name, age in ages.items() if age is not None and age > 1e9 * max_age_s)
        return found + [f"{name}: older than {max_age_s:g} s" for name in old]


#: Levels of diagnostic_msgs/DiagnosticStatus.
OK, WARN, ERROR, STALE = 0, 1, 2, 3


def level_of(pair: Pair, margin: float) -> int:
    """OK if proved farther than the margin, ERROR for an overlap or no distance, otherwise WARN."""
    if pair.status in ("overlap", "no_pose", "bad_pose", "stale_pose", "unknown_body"):
        return ERROR
    return OK if pair.lower > margin else WARN
