#!/usr/bin/env python3
"""MuJoCo as the world: it publishes poses over LCM, and uses our distances for a hand that evades obstacles.

    python3 client/examples/mujoco_simulator.py --seconds 10

A MuJoCo model becomes a scene, with a body for each geom. After each control step the simulator publishes the poses of
its geoms and queries the daemon, over shared memory, for the bodies nearest to the hand *at those poses*: the query
waits for their stamp, so that the result does not depend on which path is faster. The hand moves back and forth, slower
near other bodies, and away from approaching ones. MuJoCo's own distances check each answer, and whether the hand ever
came too near. Needs numpy, lcm and mujoco.
"""

from __future__ import annotations

import argparse
import random
import sys
import time

import lcm
import mujoco
import numpy as np
import own_daemon
from clearance_lcm import pose_update_t

import clearance

KEEP = 0.02  # metres: minimum distance of the hand
APPROACH = 8.0  # 1/s: rate at which it may use up the distance beyond KEEP
OTHERS = 0.8  # metres per second: maximum speed of other bodies
CONTROL = 0.01  # seconds between queries
SPEED = 0.5  # metres per second
GOALS = [np.array([0.5, 0.0, 0.35]), np.array([-0.5, 0.0, 0.35])]
AGREE = 2e-6  # metres: accepted error of MuJoCo's distances
WORLD = """<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <default><geom density="400"/></default>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 0.1"/>
    <body name="hand" pos="0.5 0 0.35" gravcomp="1">
      <joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/>
      <joint name="z" type="slide" axis="0 0 1"/>
      <geom name="hand" type="sphere" size="0.05"/>
    </body>
    <body name="pendulum" pos="0 0.1 1.13" euler="20 0 0">
      <joint type="hinge" axis="1 0 0" damping="0.01"/>
      <geom name="bob" type="capsule" fromto="0 0 -0.4 0 0 -0.7" size="0.05"/>
    </body>
    <body name="crate" pos="0.05 -0.25 0.4"><freejoint/><geom name="crate" type="box" size="0.1 0.08 0.06"/></body>
    <body name="ball" pos="-0.3 0.2 0.6"><freejoint/><geom name="ball" type="sphere" size="0.07"/></body>
  </worldbody>
  <actuator>
    <velocity joint="x" kv="50"/><velocity joint="y" kv="50"/><velocity joint="z" kv="50"/>
  </actuator>
</mujoco>"""


def scene_of(model) -> clearance.Scene:
    """A body for each named geom of a model; planes are static half-spaces."""
    scene = clearance.Scene()
    kinds = mujoco.mjtGeom
    for i in range(model.ngeom):
        geom, size = model.geom(i), model.geom_size[i]
        if geom.type == kinds.mjGEOM_PLANE:
            scene.add_half_space(geom.name, pose=[*geom.pos, *geom.quat])
        elif geom.type == kinds.mjGEOM_SPHERE:
            scene.add_sphere(geom.name, size[0])
        elif geom.type == kinds.mjGEOM_CAPSULE:
            scene.add_capsule(geom.name, size[0], 2 * size[1])
        elif geom.type == kinds.mjGEOM_CYLINDER:
            scene.add_cylinder(geom.name, size[0], 2 * size[1])
        elif geom.type == kinds.mjGEOM_BOX:
            scene.add_box(geom.name, 2 * size)
        elif geom.type == kinds.mjGEOM_ELLIPSOID:
            scene.add_ellipsoid(geom.name, size)
        else:
            raise ValueError(f"geom {geom.name!r}: this example knows no shape {kinds(geom.type[0]).name}")
    return scene


class Publisher:
    """Publishes poses of geoms over LCM, by name."""

    def __init__(self, model, url: str):
        self.network, self.message = lcm.LCM(url), pose_update_t()
        self.moving = [i for i in range(model.ngeom) if model.geom_type[i] != mujoco.mjtGeom.mjGEOM_PLANE]
        self.message.publisher_id = random.getrandbits(63) | 1
        self.message.names = [model.geom(i).name for i in self.moving]
        self.message.count = len(self.moving)

    def publish(self, data) -> int:
        """Publishes the poses and returns their stamp."""
        quaternion, poses = np.empty(4), []
        for i in self.moving:
            mujoco.mju_mat2Quat(quaternion, data.geom_xmat[i])
            poses.append([*data.geom_xpos[i], *quaternion])
        self.message.poses, self.message.stamp_ns = poses, max(time.time_ns(), self.message.stamp_ns + 1)
        self.message.sequence += 1
        self.network.publish("CLEARANCE_POSES", self.message.encode())
        return self.message.stamp_ns


def send_poses(client, publisher: Publisher, data) -> None:
    """Publishes the current poses and waits until the daemon has them. Repeats a lost message."""
    for _ in range(10):
        try:
            return client.wait_for_poses(publisher.publish(data), timeout_s=0.5)
        except clearance.RequestError as error:
            if error.code != clearance.wire.ErrorCode.POSES_LATE:
                raise
    raise SystemExit("mujoco_simulator: the daemon gets no poses over LCM")


def straight(hand: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """(3,) m/s of the hand to its goal, ignoring obstacles."""
    return (goal - hand) * SPEED / max(np.linalg.norm(goal - hand), SPEED * 0.2)


def careful(wanted: np.ndarray, lower: np.ndarray, away: np.ndarray) -> np.ndarray:
    """(3,) m/s of the hand as wanted, but not towards near bodies, and away from those that come too near."""
    for i in lower.argsort()[::-1]:  # the nearest takes precedence
        towards, allowed = -wanted @ away[i], APPROACH * (lower[i] - 1.5 * KEEP) - OTHERS
        if towards > allowed:
            wanted = wanted + (towards - allowed) * away[i]
    return wanted


def simulate(model, query, publisher, client, seconds: float, care: bool = True) -> dict[str, float]:
    """Steps until the time is over; returns the results."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hand, id_of = model.geom("hand").id, {body.id: model.geom(body.name).id for body in client.bodies}
    nearest, off, goal, reached, questions = np.inf, 0.0, 0, 0, 0
    while data.time < seconds:
        send_poses(client, publisher, data)
        r = query.run()
        questions += 1
        geoms = np.vectorize(id_of.get)(r.pairs)
        away = np.where((geoms[:, 0] == hand)[:, None], -r.normal[0], r.normal[0])
        for k, (a, b) in enumerate(geoms):
            true = mujoco.mj_geomDistance(model, data, int(a), int(b), 10.0, None)
            off = max(off, r.lower[0, k] - max(true, 0.0), max(true, 0.0) - r.upper[0, k])
            nearest = min(nearest, true)
        if np.linalg.norm(GOALS[goal] - data.geom_xpos[hand]) < 0.05:
            goal, reached = 1 - goal, reached + 1
        wanted = straight(data.geom_xpos[hand], GOALS[goal])
        data.ctrl[:] = careful(wanted, r.lower[0], away) if care else wanted
        for _ in range(round(CONTROL / model.opt.timestep)):
            mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
    return {"nearest": nearest, "off": off, "reached": reached, "questions": questions}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seconds", type=float, default=10.0, help="of simulated time")
    options = parser.parse_args()
    model = mujoco.MjModel.from_xml_string(WORLD)
    with own_daemon.daemon(scene_of(model), ["--threads", "1"]) as urls, clearance.connect(urls["shm"]) as client:
        publisher = Publisher(model, urls["udpm"])
        query = client.prepare("distances", pairs=[("hand", "*")], fields=["default", "normal"], timeout_s=30.0)
        begin = time.monotonic()
        out = simulate(model, query, publisher, client, options.seconds)
        took = time.monotonic() - begin
        careless = simulate(model, query, publisher, client, options.seconds, care=False)
    print(f"{options.seconds:g} s simulated in {took:.1f} s, {out['questions']} questions")
    print(f"MuJoCo's distances are outside of our intervals by {1e9 * out['off']:.0f} nm at most")
    print(
        f"the hand came to {out['reached']} goals, never nearer than {1e3 * out['nearest']:.1f} mm; without care ",
        end="",
    )
    print(f"{1e3 * careless['nearest']:.1f} mm")
    assert out["off"] < AGREE, "the two disagree"
    assert out["nearest"] >= KEEP, "the hand came too near"
    assert out["reached"] >= 2 or options.seconds < 5, "the hand was stuck"
    assert careless["nearest"] < KEEP or options.seconds < 5, "nothing was ever in the way: nothing was shown"
    return 0


if __name__ == "__main__":
    sys.exit(main())
