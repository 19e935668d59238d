#!/usr/bin/env python3
"""A planner in joint space that speaks LCM alone: the lcm module and the message types of lcmtypes/, nothing else of
Clearance.

    clearanced --scene scene.yaml --lcm "udpm://239.255.76.67:7667?ttl=0" &      # a scene with a robot
    python3 client/examples/lcm_joint_planner.py --joint arm/joint1=0,1.5 --joint arm/joint4=-1.5,-0.5

It publishes where the robot's joints are (again every second, for late joiners and losses), asks about a straight way
in joint space from there to a goal, and prints the nearest pair of each step with its certified bounds.
"""

import argparse
import pathlib
import random
import sys
import time

import lcm

try:
    from clearance_lcm import joint_query_t, named_joint_update_t, query_t, reply_t, scene_t
except ImportError:  # not on the path: where the build generates them
    sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / "build" / "python"))
    from clearance_lcm import joint_query_t, named_joint_update_t, query_t, reply_t, scene_t

STATUS = ["ok", "overlap", "contact", "beyond", "unconverged", "bad pose", "no pose", "unknown body", "stale pose"]


class Planner:
    def __init__(self, url, prefix):
        self.lcm = lcm.LCM(url)
        self.prefix = prefix
        self.id = random.getrandbits(63) | 1  # ours alone: as publisher and as client
        self.sequence = self.request = 0
        self.server = None  # server_id of the daemon that we heard first
        self.positions = {}  # by joint: radians and metres
        self.published = 0.0
        self.names, self.replies = {}, {}
        self.subscribe("CLEARANCE_SCENE", scene_t, lambda m: self.names.update(zip(m.ids, m.names)))
        self.subscribe("CLEARANCE_REPLY", reply_t, self.on_reply)

    def subscribe(self, channel, kind, handler):
        subscription = self.lcm.subscribe(self.prefix + channel, lambda _, data: handler(self.ours(kind.decode(data))))
        subscription.set_queue_capacity(1000)  # a long answer is many messages; 30 would be kept otherwise

    def ours(self, message):
        """Each daemon of the network has poses of its own, and answers every query: there must be one."""
        self.server = self.server or message.server_id
        if message.server_id != self.server:
            sys.exit(
                f"lcm_joint_planner: daemons {self.server} and {message.server_id} publish under the same channels, or "
                "one was restarted; give each a prefix of its own"
            )
        return message

    def spin(self, seconds):
        """Takes messages for at most so long; repeats the positions when a second has passed."""
        if self.positions and time.monotonic() - self.published > 1.0:
            self.publish()
        self.lcm.handle_timeout(max(1, int(1000 * seconds)))

    def publish(self):
        message = named_joint_update_t()
        self.sequence += 1
        message.publisher_id, message.sequence, message.stamp_ns = self.id, self.sequence, time.time_ns()
        message.names, message.positions = list(self.positions), list(self.positions.values())
        message.count = len(message.names)
        self.lcm.publish(self.prefix + "CLEARANCE_JOINTS_NAMED", message.encode())
        self.published = time.monotonic()

    def on_reply(self, part):
        if part.client_id == self.id and part.request_id == self.request:
            # Parts of one answer share a sequence; those of different answers never mix.
            self.replies.setdefault((part.server_id, part.sequence), {})[part.part] = part

    def ask(self, message, patience=1.0, attempts=5):
        """The parts of the answer, in order. A lost part costs a repeat of the question."""
        for _ in range(attempts):
            self.request += 1
            self.replies.clear()
            message.query.client_id, message.query.request_id = self.id, self.request
            self.lcm.publish(self.prefix + "CLEARANCE_JOINT_QUERY", message.encode())
            deadline = time.monotonic() + patience
            while time.monotonic() < deadline:
                for parts in self.replies.values():
                    if len(parts) == parts[min(parts)].parts:
                        if parts[0].error_code:
                            sys.exit(f"lcm_joint_planner: the daemon refused: {parts[0].error_text}")
                        return [parts[i] for i in sorted(parts)]
                self.spin(0.05)
        sys.exit("lcm_joint_planner: no answer; is clearanced running with this --lcm url?")


def joint(text):
    """NAME=START,GOAL"""
    name, _, numbers = text.rpartition("=")
    start, goal = map(float, numbers.split(","))
    return name, start, goal


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--url", default="udpm://239.255.76.67:7667?ttl=0", help="LCM url")
    parser.add_argument("--prefix", default="", help="of the daemon's channels")
    parser.add_argument("--joint", type=joint, action="append", required=True, metavar="NAME=START,GOAL",
                        help="a joint that moves, radians or metres; again for others")  # fmt: skip
    parser.add_argument("--steps", type=int, default=11, metavar="K", help="positions on the way (at most 400)")
    options = parser.parse_args()

    planner = Planner(options.url, options.prefix)
    planner.positions = {name: start for name, start, _ in options.joint}
    planner.publish()

    message = joint_query_t()
    message.query = query_t()  # what is left at zero has its default
    message.query.reduce = query_t.REDUCE_MIN  # of each configuration the nearest pair with a link that moves
    message.joints = [name for name, _, _ in options.joint]
    message.joint_count = len(message.joints)
    way = [k / max(1, options.steps - 1) for k in range(options.steps)]
    message.positions = [[start + s * (goal - start) for _, start, goal in options.joint] for s in way]
    message.row_count = len(message.positions)
    parts = planner.ask(message)
    while not {i for part in parts for pair in part.pair for i in pair} <= set(planner.names):
        planner.spin(0.1)  # names come with the scene, every second

    print(f"{'step':>4}  {'nearest pair':<40} {'distance':>12} {'lower':>12} {'upper':>12}  status")
    for part in parts:
        for i in range(part.pair_count):
            a, b = (planner.names.get(j, "none") for j in part.pair[i])
            print(
                f"{part.first_row + i:>4}  {a + ' - ' + b:<40} {part.distance[i]:12.6f} {part.lower[i]:12.6f} "
                f"{part.upper[i]:12.6f}  {STATUS[part.status[i]]}"
            )


if __name__ == "__main__":
    main()
