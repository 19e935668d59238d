#!/usr/bin/env python3
"""Balls on closed paths, published over LCM from a separate process.

    python3 client/examples/moving_balls.py --url "udpm://239.255.76.67:7667?ttl=0" --begin 123.4

A ball's position depends on the machine's monotonic clock alone, so that another program can compute the actual
position at any time, rather than the one of the last message. No ball is ever faster than MAX_SPEED.
"""

from __future__ import annotations

import argparse
import random
import time

import lcm
import numpy as np
import own_daemon  # noqa: F401  finds the message types if they are not installed
from clearance_lcm import pose_update_t

RADIUS = 0.06  # metres
MAX_SPEED = 0.15  # metres per second
#: Middle [m], amplitude along each axis [m], angular rates [rad/s] and phases of each ball's path.
WAYS = [
    ((0.55, 0.00, 1.35), (0.10, 0.45, 0.10), (0.40, 0.23, 0.50), (0.0, 1.6, 0.0)),
    ((0.35, -0.45, 1.20), (0.25, 0.10, 0.20), (0.31, 0.50, 0.27), (1.0, 0.0, 2.0)),
    ((0.40, 0.45, 1.25), (0.20, 0.12, 0.25), (0.37, 0.33, 0.29), (2.0, 1.0, 4.0)),
]
NAMES = [f"ball_{i}" for i in range(len(WAYS))]


def places(t) -> np.ndarray:
    """(K, N, 3) metres: positions of the balls at (K,) seconds since their begin."""
    middle, reach, rate, phase = (np.array(each) for each in zip(*WAYS))
    return middle + reach * np.sin(rate * np.asarray(t, float)[:, None, None] + phase)


def check_speed() -> None:
    """Checks the speed bound of the scene, assuming that all sines have their greatest slope at once."""
    _, reach, rate, _ = (np.array(each) for each in zip(*WAYS))
    fastest = np.linalg.norm(reach * rate, axis=1).max()
    assert fastest <= MAX_SPEED, f"a ball reaches {fastest} m/s"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--url", default="udpm://239.255.76.67:7667?ttl=0", help="LCM url")
    parser.add_argument("--rate", type=float, default=200.0, help="messages a second")
    parser.add_argument("--begin", type=float, default=time.monotonic(), help="seconds of the monotonic clock")
    options = parser.parse_args()
    check_speed()
    network = lcm.LCM(options.url)
    message = pose_update_t()
    message.publisher_id = random.getrandbits(63) | 1
    message.count, message.names = len(NAMES), NAMES
    due = time.monotonic()
    while True:
        # The clock first: a stamp older than the positions is safe.
        message.stamp_ns, now = time.time_ns(), time.monotonic()
        message.sequence += 1
        message.poses = [[*place, 1.0, 0.0, 0.0, 0.0] for place in places([now - options.begin])[0]]
        network.publish("CLEARANCE_POSES", message.encode())
        due = max(due + 1 / options.rate, now - 0.05)
        time.sleep(max(0.0, due - time.monotonic()))


if __name__ == "__main__":
    main()
