#!/usr/bin/env python3
"""An arm at 1 kHz among moving balls that never comes nearer to anything than its margin: a control barrier function.

    python3 client/examples/safe_controller.py --seconds 600 --csv out/safe.csv --plot out/safe.png

It starts a daemon, and balls that a separate process publishes over LCM. The arm moves back and forth between goals
that ignore the balls. Every millisecond one query returns all pairs that may be near, with certified lower bounds and
their slopes by joint; a small QP finds the joint speeds nearest to the wanted ones that keep the barrier:

    slope . dq  >=  ball's speed - ALPHA (lower - margin)         for each pair

`margin()` explains why it holds, and the source of each number. Before they are commanded, check_stop() proves that the
arm would stop in time from these speeds, or the share of them for which it would; without any, the arm moves only if
that leads away from everything near. The drives are simulated realistically: a command is valid for HOLD, then they
brake, even if this program fails. At the end ExactArm, which does not use Clearance, checks the arm at every
millisecond, with the actual positions of the balls.
Needs numpy, lcm and proxsuite, and matplotlib for --plot.
"""

from __future__ import annotations

import argparse
import gc
import os
import subprocess
import sys
import time
from typing import Optional

import moving_balls
import numpy as np
import own_daemon
from drive import BRAKE, HOLD, Drive, permitted
from proxsuite import proxqp
from run_log import RunLog

import clearance

TICK = 1e-3  # seconds
KEEP = 0.03  # metres: minimum distance to a ball or to the floor
STALL = 0.1  # seconds without an answer that the margin covers
LATE = 0.01  # seconds from the measurement of the arm until its command, at most
SHIFT = 0.01  # metres: how far the command before may take the arm from where it is expected meanwhile
SPEED = 0.6  # radians per second: limit of each joint
STOP = SPEED / BRAKE  # seconds from a command's end to a standstill, at most
REACH = [1.25, 1.25, 0.85, 0.45, 0.35, 0.25]  # metres: bound on the arm's distance from each joint's axis, beyond it
LINK = 0.5  # metres: the longest link
ALPHA = 8.0  # 1/s: rate at which the barrier may be approached
LOOK = 0.3  # metres: pairs proved to be farther are left out; they cannot come near within STALL
ROWS = 24  # maximum number of pairs in the QP, nearest first
FLOOR = 0.75  # metres
GOALS = np.array([[-1.0, 0.7, 0.9, 0.0, 0.0, 0.0], [1.0, 0.5, 1.2, 0.3, 0.5, 0.0], [0.1, 0.3, 1.7, -0.4, -0.6, 0.5]])
GOAL_SECONDS = 7.0
HOME = [-2.4, -0.3, 0.8, 0.0, 0.0, 0.0]  # initial position, far from all balls
DANGEROUS = 10.0  # seconds after which an arm that ignores the balls would have hit one


def margin() -> float:
    """Lower limit of `lower` that keeps the exact distance above KEEP.

    `lower` holds at the start of the query, because the scene declares the maximum speed of a ball (max_speed) and the
    engine counts the age of its pose. Until the next answer or, without one, until the drives have stopped, there are:
      - a ball, with its speed until an answer comes: covered up to STALL;
      - the arm, with its command during HOLD and the ramp of STOP, equivalent to `way` seconds at full speed. The
        barrier lets the witness approach by at most ALPHA (lower - margin) per second; ALPHA way < 1, so it stays
        above;
      - other points of the witness's link, which may approach faster, by its turn times its length;
      - the curvature of their paths: the acceleration of a chain of joints that turn steadily.
    """
    way = HOLD + STOP / 2
    assert ALPHA * way < 1
    turn = SPEED * len(REACH)
    beside = turn * LINK * way
    bend = 0.5 * turn * SPEED * sum(REACH) * way**2
    return KEEP + moving_balls.MAX_SPEED * STALL + beside + bend


def stop_margin() -> float:
    """Distance that the proof of a stop keeps from the balls where their poses were.

    In addition to KEEP, there are:
      - a ball, with its speed while its pose is on its way, up to STALL: the engine counts the age from receipt;
      - the arm, with the command before until the one that is checked.
    """
    return KEEP + moving_balls.MAX_SPEED * STALL + SHIFT


def scene() -> clearance.Scene:
    """The arm on a floor, and balls whose poses arrive over LCM, of which only the maximum speed is known."""
    cell = clearance.Scene()
    cell.add_robot("arm", own_daemon.ARM, base=[0, 0, FLOOR, 1, 0, 0, 0], static=True, home={})
    cell.add_half_space("floor", pose=[0, 0, FLOOR, 1, 0, 0, 0])
    for name in moving_balls.NAMES:
        cell.add_sphere(name, moving_balls.RADIUS, max_speed=moving_balls.MAX_SPEED)
    # Bodies on the floor by construction; and the arm's own links, which this example leaves out.
    for pair in (("arm/base", "floor"), ("arm/shoulder", "floor"), ("arm/upper_arm", "floor"), ("arm", "arm")):
        cell.ignore(*pair)
    for pair in zip(moving_balls.NAMES, moving_balls.NAMES[1:] + moving_balls.NAMES[:1]):
        cell.ignore(*pair)
    for name in moving_balls.NAMES:
        cell.ignore(name, "floor")
    return cell


def wanted(t: float, q: np.ndarray) -> np.ndarray:
    """(J,) rad/s towards the current goal, ignoring the balls."""
    return np.clip(2.0 * (GOALS[int(t / GOAL_SECONDS) % len(GOALS)] - q), -SPEED, SPEED)


def unaware(seconds: float, step: float = 0.005) -> np.ndarray:
    """(N, 1 + J) times and positions of the arm without any barrier."""
    rows = [np.r_[0.0, HOME]]
    while rows[-1][0] < seconds:
        t, q = rows[-1][0], rows[-1][1:]
        rows.append(np.r_[t + step, q + step * wanted(t, q)])
    return np.array(rows)


class SafeSpeeds:
    """The QP: joint speeds nearest to the wanted ones that keep every barrier."""

    def __init__(self, joints: int):
        self.joints = joints
        self.rows, self.least = np.zeros((ROWS, joints + 1)), np.full(ROWS, -1e20)
        self.wanted = np.zeros(joints + 1)
        # The last variable relaxes barriers that cannot all be kept. It is expensive, and the log shows its use.
        weights = np.diag([1.0] * joints + [1e4])
        low, high = np.r_[np.full(joints, -SPEED), 0.0], np.r_[np.full(joints, SPEED), 1e20]
        self.qp = proxqp.dense.QP(joints + 1, 0, ROWS, True)
        self.qp.settings.eps_abs = 1e-5
        self.qp.settings.max_iter, self.qp.settings.max_iter_in = 50, 50  # longer runs count as no answer
        self.qp.settings.initial_guess = proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
        top = np.full(ROWS, 1e20)
        self.qp.init(weights, self.wanted, None, None, self.rows, self.least, top, low, high)

    def __call__(self, wanted, slopes, least) -> Optional[tuple[np.ndarray, float]]:
        """(J,) rad/s, and the amount by which the barriers were relaxed; None if the QP has no answer.

        slopes: (N, J) metres per radian; least: (N,) metres per second; the nearest pair first.
        """
        n = min(len(slopes), ROWS)
        self.rows[:, :-1], self.rows[:, -1], self.least[:] = 0.0, 1.0, -1e3  # unused rows have no effect
        self.rows[:n, :-1], self.least[:n] = slopes[:n], least[:n]
        self.wanted[:-1] = -wanted
        self.qp.update(g=self.wanted, C=self.rows, l=self.least)
        self.qp.solve()
        x = self.qp.results.x
        if self.qp.results.info.status != proxqp.QPSolverOutput.PROXQP_SOLVED or not np.isfinite(x).all():
            self.qp.settings.initial_guess = proxqp.InitialGuess.NO_INITIAL_GUESS  # its remains are no initial guess
            return None
        self.qp.settings.initial_guess = proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
        return np.clip(x[:-1], -SPEED, SPEED), float(x[-1])


class Controller:
    """Repeated ticks: position of the arm, distances of near bodies, and permitted speeds."""

    def __init__(self, client, log: RunLog):
        self.client, self.log = client, log
        self.joints = client.joints([f"arm/{name}" for name in log.joints])
        self.drive = Drive(HOME)
        self.safe = SafeSpeeds(len(self.joints))
        self.balls = np.zeros(len(client.bodies), bool)
        self.balls[[client.body_id(name) for name in moving_balls.NAMES]] = True
        self.margin = margin()
        # Within STALL the arm and a ball approach by less than LOOK: pairs left out now cannot be too near then.
        self.query = client.prepare(
            "distances", joints=self.joints, pairs=[("arm", "*")], reduce="within", max_distance=LOOK,
            fields=["lower", "upper", "status", "pair", "gradient_joints", "rate"], rel_tol=1e-3, timeout_s=STALL,
        )  # fmt: skip
        self.stop = client.prepare(
            "check_stop", joints=self.joints, pairs=[("arm", "*")], deceleration=BRAKE, reaction_s=LATE + HOLD,
            others=dict.fromkeys(moving_balls.NAMES, moving_balls.MAX_SPEED), margin=stop_margin(), timeout_s=STALL,
        )  # fmt: skip

    def tick(self, began: float, now: float) -> None:
        """Queries the present position, and commands speeds; without a usable answer none, so that the drives stop."""
        positions = self.drive.advance(now, self.log)
        try:
            r = self.query.run(positions[None], self.drive.dq[None])
        except clearance.ClearanceError as error:
            self.log.failed(type(error).__name__)
            return
        lower = r.lower
        if not np.isfinite(lower).all():  # a ball without a pose
            self.log.failed("no pose")
            return
        nearest = lower.argsort()
        # Latencies of the pose and of this query are unknown to the engine: measured with one clock.
        late = 1e-9 * max(0, time.time_ns() - r.snapshot_stamp_ns - max(r.pose_age_ns, 0))
        approach = np.where(self.balls[r.pair].any(axis=1), moving_balls.MAX_SPEED, 0.0)
        # The present command goes on until the next one, and changes the distance by `rate`.
        then = lower - (approach + np.maximum(-r.rate, 0.0)) * late
        least = approach - ALPHA * (then - self.margin)
        answer = self.safe(wanted(now - began, self.drive.q), r.gradient_joints[nearest], least[nearest])
        if answer is None:
            self.log.failed("no QP")
            return
        speeds, given_up = answer
        try:
            scale = self.stop.run(positions, speeds).speed_scale
        except (clearance.ClearanceError, ValueError) as error:
            self.log.failed(type(error).__name__)
            return
        commanded = permitted(speeds, scale, r.gradient_joints, given_up)
        done = time.monotonic()
        shift = (done - now) * float(np.abs(commanded - self.drive.dq) @ REACH)
        if done - now > LATE or shift > SHIFT or late > STALL:
            self.log.failed("late")
            return
        self.drive.command(commanded, done, self.log)
        low, high = (lower[nearest[0]], r.upper[nearest[0]]) if len(nearest) else (LOOK, LOOK)
        self.log.tick(now, done - now, low, high, given_up, scale)


def run(client, log: RunLog, began: float, seconds: float) -> None:
    """Ticks every millisecond. A late start is a missed deadline, and missed ticks are not repeated."""
    controller = Controller(client, log)
    while True:  # the balls exist after their first message
        controller.drive.start(time.monotonic())
        if client.body_states()[client.body_id(moving_balls.NAMES[0])].status == clearance.Status.OK:
            break
        time.sleep(0.01)
    gc.disable()  # a pause of the collector would be a missed deadline
    due = begin = time.monotonic()
    controller.drive.start(begin)
    while (now := time.monotonic()) - begin < seconds:
        if now < due:
            time.sleep(due - now)
            continue
        if now > due + TICK:
            log.missed(now - due)
        controller.tick(begin, now)
        due = max(due + TICK, now)
    controller.drive.advance(time.monotonic(), log)
    gc.enable()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seconds", type=float, default=10.0, help="how long the arm moves")
    parser.add_argument("--csv", metavar="FILE", help="where a summary of each ten seconds goes")
    parser.add_argument("--plot", metavar="FILE", help="where a picture goes")
    parser.add_argument("--real-time", action="store_true", help="run before other programs (needs the right to)")
    options = parser.parse_args()
    moving_balls.check_speed()
    began = time.monotonic()
    if options.real_time:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
    with own_daemon.daemon(scene(), ["--threads", "1", *(["--real-time"] if options.real_time else [])]) as urls:
        publisher = subprocess.Popen(
            [sys.executable, moving_balls.__file__, "--url", urls["udpm"], "--begin", str(began)],
            preexec_fn=own_daemon.die_with_parent,
        )
        try:
            log = RunLog(["turn", "lift", "elbow", "wrist_lift", "wrist_turn", "tool"], options.seconds)
            with clearance.connect(urls["shm"]) as client:
                run(client, log, began, options.seconds)
        finally:
            publisher.terminate()
            publisher.wait()
    log.judge(began, KEEP, STALL, FLOOR)
    log.report(margin(), options.csv, options.plot)
    rows = unaware(options.seconds) + np.r_[log.samples.array[0, 0], np.zeros(len(REACH))]
    careless = log.distances(rows, began).min()
    print(f"without the barrier: {'a collision' if careless <= 0 else f'{1e3 * careless:.2f} mm'}")
    harmless = options.seconds >= DANGEROUS and careless >= KEEP
    return 1 if harmless or not log.kept() else 0


if __name__ == "__main__":
    sys.exit(main())
