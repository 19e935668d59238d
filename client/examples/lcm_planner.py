#!/usr/bin/env python3
"""A planner that speaks LCM alone: the lcm module and the message types of lcmtypes/, nothing else of Clearance.

    clearanced --scene scenes/nineteen/scene.yaml --lcm "udpm://239.255.76.67:7667?ttl=0" &
    python3 client/examples/lcm_planner.py --url "udpm://239.255.76.67:7667?ttl=0"

It waits for the scene and publishes the bodies' poses (again every second, for late joiners and losses). Then it asks
about a batch of configurations of one body, at these poses or newer ones, and prints the nearest pair of each with its
certified bounds.
"""

import argparse
import math
import pathlib
import random
import sys
import time

import lcm

try:
    from clearance_lcm import pose_update_t, query_t, reply_t, scene_t, states_t
except ImportError:  # not on the path: where the build generates them
    sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / "build" / "python"))
    from clearance_lcm import pose_update_t, query_t, reply_t, scene_t, states_t

STATUS = ["ok", "overlap", "contact", "beyond", "unconverged", "bad pose", "no pose", "unknown body"]
POSE_WAIT_NS = 200_000_000  # that a question waits for our poses


class Planner:
    def __init__(self, url, prefix):
        self.lcm = lcm.LCM(url)
        self.prefix = prefix
        self.id = random.getrandbits(63) | 1  # ours alone: as publisher and as client
        self.sequence = 0
        self.request = 0
        self.server = None  # server_id of the daemon whose scene we know
        self.poses = {}  # body id: [x, y, z, qw, qx, qy, qz]
        self.published, self.stamp_ns = 0.0, 0
        self.scene_parts, self.state_parts, self.reply_parts = {}, {}, {}
        self.subscribe(
            "CLEARANCE_SCENE", scene_t, lambda m: self.scene_parts.setdefault(m.revision, {}).update({m.part: m})
        )
        self.subscribe(
            "CLEARANCE_STATES",
            states_t,
            lambda m: self.state_parts.setdefault(m.scene_revision, {}).update({m.part: m}),
        )
        self.subscribe("CLEARANCE_REPLY", reply_t, self.on_reply)

    def subscribe(self, channel, kind, handler):
        subscription = self.lcm.subscribe(self.prefix + channel, lambda _, data: handler(self.ours(kind.decode(data))))
        subscription.set_queue_capacity(1000)  # a long answer is many messages; 30 would be kept otherwise

    def ours(self, message):
        """Each daemon of the network has poses of its own, and answers every query: there must be one."""
        self.server = self.server or message.server_id
        if message.server_id != self.server:
            sys.exit(
                f"lcm_planner: daemons {self.server} and {message.server_id} publish under the same channels, or one "
                "was restarted; give each a prefix of its own"
            )
        return message

    def spin(self, seconds):
        """Takes messages for at most so long; repeats the poses when a second has passed."""
        if self.poses and time.monotonic() - self.published > 1.0:
            self.publish_poses()
        self.lcm.handle_timeout(max(1, int(1000 * seconds)))

    def wait(self, found, what, seconds=5.0):
        deadline = time.monotonic() + seconds
        while not (result := found()):
            if time.monotonic() > deadline:
                sys.exit(
                    f"lcm_planner: {what} did not come within {seconds:g} s; is clearanced running with this --lcm url?"
                )
            self.spin(0.1)
        return result

    @staticmethod
    def whole(parts_by_key):
        """The parts of the newest message of which all are there."""
        for parts in reversed(parts_by_key.values()):
            if len(parts) == next(iter(parts.values())).parts:
                return [parts[i] for i in sorted(parts)]
        return None

    def learn_scene(self):
        parts = self.wait(lambda: self.whole(self.scene_parts), "the scene")
        self.revision = parts[0].revision
        self.names, self.movable = {}, []
        for part in parts:
            for i, name, is_static, parent in zip(part.ids, part.names, part.is_static, part.parents):
                self.names[i] = name
                if not is_static and parent == scene_t.NONE:
                    self.movable.append(i)

    def learn_poses(self):
        """Learns the bodies' poses from the daemon; bodies without a pose are put side by side."""
        for part in self.wait(lambda: self.whole(self.state_parts), "where the bodies are"):
            for i, pose, status in zip(part.ids, part.poses, part.status):
                if i in self.movable:
                    self.poses[i] = list(pose) if status == reply_t.STATUS_OK else [float(i), 0, 0, 1, 0, 0, 0]

    def publish_poses(self):
        items = sorted(self.poses.items())
        self.stamp_ns = time.time_ns()
        for begin in range(0, len(items), 700):  # under 48 KB each
            some = items[begin : begin + 700]
            message = pose_update_t()
            self.sequence += 1
            message.publisher_id, message.sequence, message.stamp_ns = self.id, self.sequence, self.stamp_ns
            message.scene_revision = self.revision
            message.count = len(some)
            message.bodies = [i for i, _ in some]
            message.poses = [pose for _, pose in some]
            self.lcm.publish(self.prefix + "CLEARANCE_POSES", message.encode())
        self.published = time.monotonic()

    def on_reply(self, part):
        if part.client_id == self.id and part.request_id == self.request:
            # Parts of one answer share a sequence; those of different answers never mix.
            self.reply_parts.setdefault((part.server_id, part.sequence), {})[part.part] = part

    def ask(self, query, patience=1.0, attempts=5):
        """The parts of the answer, in order. A lost part costs a repeat of the question, and so do lost poses."""
        if self.poses:  # the last of the bodies that we published: a message applies as a whole
            query.wait_for_one, query.wait_for = True, max(self.poses)
            query.pose_wait_ns = POSE_WAIT_NS
        for _ in range(attempts):
            self.request += 1
            self.reply_parts.clear()
            query.client_id, query.request_id, query.scene_revision = self.id, self.request, self.revision
            query.min_pose_stamp_ns = self.stamp_ns
            self.lcm.publish(self.prefix + "CLEARANCE_QUERY", query.encode())
            deadline = time.monotonic() + patience
            while time.monotonic() < deadline and not self.whole(self.reply_parts):
                self.spin(0.05)
            parts, why = self.whole(self.reply_parts), "no answer"
            if parts and not parts[0].error_code:
                return parts
            if parts:
                why = f"the daemon refused: {parts[0].error_text}"
                if parts[0].error_code != reply_t.ERROR_POSES_LATE:
                    break
                self.publish_poses()
        sys.exit(f"lcm_planner: {why}")


def circle(center, radius, count):
    """Poses around `center`, turning once about z on the way."""
    for k in range(count):
        a = 2 * math.pi * k / count
        yield [
            center[0] + radius * math.cos(a),
            center[1] + radius * math.sin(a),
            center[2],
            math.cos(a / 2),
            0.0,
            0.0,
            math.sin(a / 2),
        ]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--url", default="udpm://239.255.76.67:7667?ttl=0", help="LCM url")
    parser.add_argument("--prefix", default="", help="of the daemon's channels")
    parser.add_argument("--body", help="name of the body to plan for (default: the first that moves)")
    parser.add_argument(
        "--configurations", type=int, default=12, metavar="K", help="poses of it to ask about (at most 600)"
    )
    parser.add_argument("--radius", type=float, default=0.5, help="of the circle that they lie on, metres")
    parser.add_argument("--listen", action="store_true", help="publish no poses: somebody else does")
    options = parser.parse_args()

    planner = Planner(options.url, options.prefix)
    planner.learn_scene()
    planner.learn_poses()
    print(f"scene {planner.revision}: {len(planner.names)} bodies, {len(planner.movable)} of them can be moved")
    ids = {name: i for i, name in planner.names.items()}
    if options.body not in (None, *ids):
        sys.exit(f"lcm_planner: no body '{options.body}' in the scene")
    body = ids[options.body] if options.body else planner.movable[0]
    start = planner.poses.get(body, [0.0] * 3)
    if options.listen:
        planner.poses = {}
    else:
        planner.publish_poses()

    query = query_t()  # what is left at zero has its default
    query.bodies, query.body_count = [body], 1
    query.configurations = [[pose] for pose in circle(start, options.radius, options.configurations)]
    query.configuration_count = len(query.configurations)
    query.reduce = query_t.REDUCE_MIN  # of each configuration the nearest pair with this body
    parts = planner.ask(query)

    print(f"\n{'configuration':>13}  {'nearest pair':<32} {'distance':>12} {'lower':>12} {'upper':>12}  status")
    for part in parts:
        for i in range(part.pair_count):
            a, b = (planner.names.get(j, "none") for j in part.pair[i])
            print(
                f"{part.first_row + i:>13}  {a + ' - ' + b:<32} {part.distance[i]:12.6f} {part.lower[i]:12.6f} "
                f"{part.upper[i]:12.6f}  {STATUS[part.status[i]]}"
            )
    print(
        f"\npose revision {parts[0].snapshot_revision}, {parts[0].pairs_evaluated} pairs in "
        f"{parts[0].server_ns / 1000:.0f} us on backend {parts[0].backend}"
    )


if __name__ == "__main__":
    main()
