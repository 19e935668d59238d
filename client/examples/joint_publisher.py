#!/usr/bin/env python3
"""Swings joints of a robot to and fro, from a process of its own, over LCM.

    python3 client/examples/joint_publisher.py --joint arm/turn=-1.2,1.2 --joint arm/lift=-0.5,0.5 --seconds 10

Each joint follows a sine of its own between the two positions that are given, radians or metres. Every update holds all
of them, so late joiners and losses need nothing else. It uses only lcmtypes/ of Clearance.
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
    from clearance_lcm import named_joint_update_t
except ImportError:  # not on the path: where the build generates them
    sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / "build" / "python"))
    from clearance_lcm import named_joint_update_t


class Swing:
    """The motion of one joint: at t = 0 halfway, with a period of some seconds."""

    def __init__(self, name, low, high, chance):
        self.name, self.middle, self.reach = name, (low + high) / 2, (high - low) / 2
        self.rate = chance.uniform(0.3, 1.0)

    def at(self, t):
        return self.middle + self.reach * math.sin(self.rate * t)


def joint(text):
    """NAME=LOW,HIGH"""
    name, _, numbers = text.rpartition("=")
    low, high = map(float, numbers.split(","))
    return name, low, high


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--url", "--lcm", default="udpm://239.255.76.67:7667?ttl=0", help="LCM url")
    parser.add_argument("--prefix", default="", help="of the daemon's channels")
    parser.add_argument("--joint", type=joint, action="append", required=True, metavar="NAME=LOW,HIGH",
                        help="a joint, and between which positions it moves; again for others")  # fmt: skip
    parser.add_argument("--rate", type=float, default=100.0, help="updates a second (default 100)")
    parser.add_argument("--seconds", type=float, default=math.inf, help="how long (default: until it is ended)")
    options = parser.parse_args()
    if not options.rate > 0:
        parser.error("--rate: expected a number > 0")

    ended = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: ended.append(True))

    chance = random.Random(1)
    swings = [Swing(name, low, high, chance) for name, low, high in options.joint]
    message = named_joint_update_t()
    message.publisher_id = random.getrandbits(63) | 1
    message.count, message.names = len(swings), [swing.name for swing in swings]
    network = lcm.LCM(options.url)
    start = due = time.monotonic()
    while not ended and (now := time.monotonic()) - start < options.seconds:
        if now < due:
            time.sleep(due - now)
            continue
        message.sequence += 1
        message.stamp_ns = time.time_ns()
        message.positions = [swing.at(now - start) for swing in swings]
        network.publish(options.prefix + "CLEARANCE_JOINTS_NAMED", message.encode())
        due = max(due + 1 / options.rate, now - 0.1)  # after a pause: a few at once, not all
    print(f"joint_publisher: {message.sequence} updates in {time.monotonic() - start:.1f} s", flush=True)


if __name__ == "__main__":
    main()
