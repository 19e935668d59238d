#!/usr/bin/env python3
"""Moves every body of a scene smoothly, from a process of its own, over LCM.

    python3 client/examples/pose_publisher.py --url "udpm://239.255.76.67:7667?ttl=0" --rate 100 --seconds 10

It learns the bodies from CLEARANCE_SCENE and their poses from CLEARANCE_STATES, and lets each body wander about its
place (bodies without a pose are laid out on a grid). Static bodies and those that follow another stay as they are.
Every update holds all poses, so late joiners and losses need nothing else. It uses only lcmtypes/ of Clearance.
It ends after --seconds, or on SIGTERM or Ctrl-C, with exit code 0.
"""

import argparse
import math
import pathlib
import random
import signal
import sys
import time

import lcm

try:
    from clearance_lcm import pose_update_t, reply_t, scene_t, states_t
except ImportError:  # not on the path: where the build generates them
    sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / "build" / "python"))
    from clearance_lcm import pose_update_t, reply_t, scene_t, states_t

BODIES_PER_MESSAGE = 700  # 42 KB: one datagram


class Wanderer:
    """The motion of one body about its place: sums of sines in position and orientation, with periods of seconds."""

    def __init__(self, body, place, reach):
        chance = random.Random(body)
        self.body, self.place = body, place
        self.waves = [
            (reach * chance.uniform(0.3, 0.6), chance.uniform(0.3, 1.2), chance.uniform(0, 2 * math.pi))
            for _ in range(3)
        ]
        axis = [chance.gauss(0, 1) for _ in range(3)]
        length = math.hypot(*axis)
        self.axis = [a / length for a in axis]
        self.turn = (chance.uniform(0.5, 1.5), chance.uniform(0.2, 0.8))

    def at(self, t):
        """X_wb at time t [s]: x, y, z [m], qw, qx, qy, qz. At t = 0 it is the place itself."""
        x = [p + a * (math.sin(w * t + f) - math.sin(f)) for p, (a, w, f) in zip(self.place, self.waves)]
        half = 0.5 * self.turn[0] * math.sin(self.turn[1] * t)
        turn = [math.cos(half)] + [math.sin(half) * a for a in self.axis]
        return x + multiply(turn, self.place[3:])


def multiply(p, q):
    """The product of two quaternions, scalar first."""
    return [
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    ]


class Publisher:
    def __init__(self, url, prefix, reach):
        self.lcm, self.prefix, self.reach = lcm.LCM(url), prefix, reach
        self.id = random.getrandbits(63) | 1
        self.sequence = 0
        self.scene, self.states = {}, {}
        self.revision, self.wanderers = None, []
        for channel, handler in (("CLEARANCE_SCENE", self.on_scene), ("CLEARANCE_STATES", self.on_states)):
            self.lcm.subscribe(prefix + channel, handler).set_queue_capacity(200)

    def on_scene(self, _, data):
        self.keep(self.scene, scene_t.decode(data), "revision")

    def on_states(self, _, data):
        self.keep(self.states, states_t.decode(data), "scene_revision")

    @staticmethod
    def keep(store, message, key):
        """Collects the parts of one scene (those of another begin anew); a lost one comes again the next second."""
        value = (message.server_id, getattr(message, key))
        if store.get("key") != value:
            store.clear()
            store.update(key=value, parts={})
        store["parts"][message.part] = message
        store["whole"] = len(store["parts"]) == message.parts

    def follow_scene(self):
        """Once scene and states are there, and again after the scene has changed."""
        if not self.scene.get("whole") or self.scene["key"] == self.revision:
            return
        revision = self.scene["key"][1]
        if not self.states.get("whole") or self.states["key"] != self.scene["key"]:
            return
        extent, movable = {}, []
        for part in self.scene["parts"].values():
            for i, far, is_static, parent in zip(part.ids, part.extent, part.is_static, part.parents):
                extent[i] = far
                if not is_static and parent == scene_t.NONE:
                    movable.append(i)
        known = {
            i: list(pose)
            for part in self.states["parts"].values()
            for i, pose, status in zip(part.ids, part.poses, part.status)
            if status == reply_t.STATUS_OK
        }
        pitch = 2.0 * max((extent[i] for i in movable), default=1.0)
        side = math.ceil(len(movable) ** (1 / 3) - 1e-9) or 1
        kept = {w.body: w for w in self.wanderers}
        self.wanderers = []
        for n, i in enumerate(sorted(movable)):
            grid = [pitch * (n % side), pitch * (n // side % side), pitch * (n // side**2), 1.0, 0.0, 0.0, 0.0]
            reach = self.reach if self.reach is not None else extent[i]
            self.wanderers.append(kept.get(i) or Wanderer(i, known.get(i, grid), reach))
        self.revision = self.scene["key"]
        print(f"pose_publisher: scene {revision}: moving {len(movable)} of {len(extent)} bodies", flush=True)

    def publish(self, t):
        for begin in range(0, len(self.wanderers), BODIES_PER_MESSAGE):
            some = self.wanderers[begin : begin + BODIES_PER_MESSAGE]
            message = pose_update_t()
            self.sequence += 1
            message.publisher_id, message.sequence, message.stamp_ns = self.id, self.sequence, time.time_ns()
            message.scene_revision = self.revision[1]
            message.count = len(some)
            message.bodies = [w.body for w in some]
            message.poses = [w.at(t) for w in some]
            self.lcm.publish(self.prefix + "CLEARANCE_POSES", message.encode())


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--url", "--lcm", default="udpm://239.255.76.67:7667?ttl=0", help="LCM url")
    parser.add_argument("--prefix", default="", help="of the daemon's channels")
    parser.add_argument("--rate", type=float, default=100.0, help="updates a second (default 100)")
    parser.add_argument("--seconds", type=float, default=math.inf, help="how long (default: until it is ended)")
    parser.add_argument("--reach", type=float, help="metres a body may wander (default: its own extent)")
    parser.add_argument("--wait", type=float, default=30.0, help="seconds to wait for a daemon (default 30)")
    options = parser.parse_args()
    if not options.rate > 0:
        parser.error("--rate: expected a number > 0")

    ended = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: ended.append(True))

    publisher = Publisher(options.url, options.prefix, options.reach)
    deadline = time.monotonic() + options.wait
    while not ended and publisher.revision is None:
        if time.monotonic() > deadline:
            sys.exit(
                f"pose_publisher: no scene on {options.url} within {options.wait:g} s; is clearanced running there?"
            )
        publisher.lcm.handle_timeout(50)
        publisher.follow_scene()

    start = due = time.monotonic()
    updates = 0
    while not ended and (now := time.monotonic()) - start < options.seconds:
        if now < due:
            publisher.lcm.handle_timeout(max(1, int(1000 * (due - now))))
            publisher.follow_scene()
            continue
        publisher.publish(now - start)
        updates += 1
        due = max(due + 1 / options.rate, now - 0.1)  # after a pause: a few at once, not all
    print(f"pose_publisher: {updates} updates in {time.monotonic() - start:.1f} s", flush=True)


if __name__ == "__main__":
    main()
