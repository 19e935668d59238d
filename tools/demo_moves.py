"""Motion for the demo: joints and bodies that move, and stop for a while."""
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

import clearance

ROOT = Path(__file__).resolve().parents[1]


class Mover:
    """Moves joints and bodies: by separate processes over LCM or, without multicast, by this one through shared
    memory."""

    def __init__(self, stage, client, lcm_url):
        self.stage, self.client, self.processes = stage, client, {}
        self.swings = swings_of(client)
        self.free = [(body.id, state.pose) for body, state in zip(client.bodies, client.body_states())
                     if is_free(client, body) and state.status == clearance.Status.OK]
        if lcm_url and self.free:
            self.start("pose_publisher", lcm_url)
        if lcm_url and self.swings:
            self.start("joint_publisher", lcm_url,
                       *(f"--joint={name}={low},{high}" for name, (low, high) in self.swings.items()))
        self.first = self.revision()

    def start(self, name, lcm_url, *options):
        command = [sys.executable, ROOT / f"client/examples/{name}.py", "--lcm", lcm_url, "--rate", "100", *options]
        self.processes[name] = self.stage.start(name, command)

    def revision(self):
        """The daemon's current pose revision."""
        return self.client.distances(reduce="min", max_distance=0.0).snapshot_revision

    def describe(self):
        """A line for each kind of motion."""
        for title, name, count in (("Joints", "joint_publisher", len(self.swings)),
                                   ("Poses", "pose_publisher", len(self.free))):
            if name in self.processes:
                yield (f"{title:9} {name}.py (process {self.processes[name].pid}) moves {count} of them "
                       "100 times a second over LCM")
            elif count:
                yield f"{title:9} {count} of them are moved by this process through shared memory"

    def move(self, seconds):
        """Lets everything move for a while; with publishers, at least until their updates have arrived."""
        deadline = time.monotonic() + seconds
        if self.processes:
            self.stage.wait_until(lambda: self.revision() > self.first + 10, "the publishers' updates to arrive")
            while time.monotonic() < deadline:
                self.stage.check()
                time.sleep(0.05)
            return
        while (left := deadline - time.monotonic()) > 0:
            if self.free:
                self.client.set_poses({i: wandered(i, pose, seconds - left) for i, pose in self.free})
            if self.swings:
                share = (1 + np.sin(seconds - left)) / 2
                self.client.set_joints({name: low + share * (high - low) for name, (low, high) in self.swings.items()})
            time.sleep(0.01)

    def pause(self):
        """Stops all motion until resume(). Messages sent before may still arrive."""
        for process in self.processes.values():
            os.kill(process.pid, signal.SIGSTOP)

    def resume(self):
        for process in self.processes.values():
            os.kill(process.pid, signal.SIGCONT)


def is_free(client, body):
    """Returns whether a body can be moved: it is not static, follows no other body, and is no base of a robot."""
    return not body.is_static and body.parent is None and body.name not in client.groups


def swings_of(client):
    """{joint: (low, high)}: a quarter of a radian or metre around its position, within its limits."""
    states = client.joint_states()
    if not states:
        return {}
    joints = client.joints(range(len(states)))
    at = np.clip([state.position if state.status == clearance.Status.OK else 0.0 for state in states],
                 joints.lower, joints.upper)
    lows, highs = np.maximum(at - 0.25, joints.lower), np.minimum(at + 0.25, joints.upper)
    return {name: (float(low), float(high)) for name, low, high in zip(joints.names, lows, highs)}


def wandered(body, pose, t):
    """A pose slightly off `pose`: a small circle for each body, with its own phase."""
    moved = np.array(pose)
    moved[:2] += 0.05 * np.array([np.cos(2 * t + body) - np.cos(body), np.sin(2 * t + body) - np.sin(body)])
    return moved
