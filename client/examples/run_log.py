"""Evaluation of the safe controller without Clearance, as numbers, a table and a picture."""

from __future__ import annotations

import csv
from collections import Counter

import moving_balls
import numpy as np
import own_daemon
from drive import RELAXED
from exact_arm import ExactArm

CHUNK = 20000  # samples evaluated at a time
LINKS = {"forearm", "wrist_1", "wrist_2", "flange", "gripper", "left_finger", "right_finger"}


class Rows:
    """Growing rows of numbers in one block of memory."""

    def __init__(self, width: int, room: int):
        self.block, self.used = np.empty((room, width)), 0

    def add(self, *row) -> None:
        if self.used == len(self.block):
            self.block = np.concatenate([self.block, np.empty_like(self.block)])
        self.block[self.used] = row
        self.used += 1

    @property
    def array(self) -> np.ndarray:
        return self.block[: self.used]


class RunLog:
    """Samples of the arm every millisecond, a row for each answer, and failures."""

    def __init__(self, joints: list[str], seconds: float):
        self.joints = joints
        room = int(2500 * seconds) + 1000
        self.samples, self.ticks = Rows(1 + len(joints), room), Rows(6, room)
        self.misses = Rows(1, 1000)
        self.failures: Counter[str] = Counter()

    def sample(self, t, q) -> None:
        self.samples.add(t, *q)

    def tick(self, *row) -> None:
        """t, seconds that the tick took, lower, upper, how far barriers were relaxed, proved share of the speeds."""
        self.ticks.add(*row)

    def missed(self, seconds: float) -> None:
        self.misses.add(seconds)

    def failed(self, why: str) -> None:
        self.failures[why] += 1

    def judge(self, began: float, keep: float, stall: float, floor: float) -> None:
        """The exact distance at every sample: closed forms, and the actual positions of the balls.

        `allowed` is the possible loss by a stall longer than the margin covers: a ball's path in the excess time, from
        which the barrier recovers. It is 0 if no stall was longer; so the machine's load does not affect the result.
        """
        base = np.eye(4)
        base[2, 3] = self.floor = floor
        self.arm = ExactArm(own_daemon.ARM, self.joints, base)
        samples, self.keep = self.samples.array, keep
        self.t, self.truth = samples[:, 0] - samples[0, 0], self.distances(samples, began)
        answered = self.ticks.array[:, 0]
        last = answered[np.maximum(np.searchsorted(answered, samples[:, 0], "right") - 1, 0)]
        lost = moving_balls.MAX_SPEED * np.maximum(samples[:, 0] - last - stall, 0)
        # A loss recovers at a rate of at least 1/s, as the barrier's own rate is eight times that.
        slow = np.maximum.accumulate(np.log(np.maximum(lost, 1e-300)) + self.t) - self.t
        self.allowed = np.where(slow > np.log(1e-9), np.exp(slow), 0.0)

    def distances(self, rows, began: float) -> np.ndarray:
        """(N,) exact distance in metres to the nearest ball or the floor, for (N, 1 + J) times and positions."""
        least = np.empty(len(rows))
        for k in range(0, len(rows), CHUNK):
            some = rows[k : k + CHUNK]
            balls = self.arm.to_points(some[:, 1:], moving_balls.places(some[:, 0] - began)).min(axis=1)
            below = self.arm.lowest(some[:, 1:], LINKS) - self.floor
            least[k : k + CHUNK] = np.minimum(balls - moving_balls.RADIUS, below)
        return least

    def kept(self) -> bool:
        """Returns whether the arm always kept its minimum distance, and did move."""
        moved = np.abs(np.diff(self.samples.array[:, 1:], axis=0)).sum()
        return bool((self.truth >= self.keep - self.allowed).all() and moved > 1.0)

    def bins(self, seconds: float):
        """Data of the table's rows and the picture, one for each interval of this length."""
        ticks, start = self.ticks.array, self.samples.array[0, 0]
        for begin in np.arange(0, self.t[-1], seconds):
            at = slice(*np.searchsorted(self.t, [begin, begin + seconds]))
            requested = slice(*np.searchsorted(ticks[:, 0] - start, [begin, begin + seconds]))
            rows = ticks[requested]
            if at.start < at.stop and len(rows):
                took = 1e6 * np.percentile(rows[:, 1], [50, 99.9])
                late = np.diff(rows[:, 0]) > 2e-3
                yield begin, self.truth[at].min(), rows[:, 2].min(), rows[:, 3].min(), *took, len(rows), late.sum()

    def report(self, margin: float, table, picture) -> None:
        """Prints the results, and writes the table and the picture if requested."""
        ticks, misses = self.ticks.array, self.misses.array
        p50, p99, p999 = 1e6 * np.percentile(ticks[:, 1], [50, 99, 99.9])
        print(f"{len(ticks)} answers in {self.t[-1]:.1f} s; a tick took {p50:.0f} us (p99 {p99:.0f}, p99.9 {p999:.0f})")
        longest, unanswered = 1e3 * misses.max() if len(misses) else 0.0, dict(self.failures) or 0
        print(f"{len(misses)} deadlines missed, the longest by {longest:.1f} ms; without an answer: {unanswered}")
        given_up = (ticks[:, 4] > RELAXED).sum()
        print(f"barriers given up in {given_up} ticks, stalls longer than the margin covers:", end=" ")
        print(f"{(self.allowed > 0).sum()} samples")
        slowed = ticks[:, 5] < 1
        print(
            f"stops proved at full speed in {(~slowed).sum()} ticks, at {ticks[:, 5].min():.2f} of it or more in others"
        )
        true, lower = 1e3 * self.truth.min(), 1e3 * ticks[:, 2].min()
        print(f"least true distance {true:.2f} mm, least lower bound {lower:.2f} mm", end="; ")
        print(
            f"promised {1e3 * self.keep:.0f} mm (margin {1e3 * margin:.1f} mm): {'kept' if self.kept() else 'BROKEN'}"
        )
        if table:
            with open(table, "w", newline="") as file:
                write = csv.writer(file)
                write.writerow(
                    ["begin_s", "true_m", "lower_m", "upper_m", "tick_p50_us", "tick_p999_us", "answers", "late"]
                )
                for begin, *metres_and_us, answers, late in self.bins(10.0):
                    numbers = [f"{x:.5f}" for x in metres_and_us[:3]] + [f"{x:.0f}" for x in metres_and_us[3:]]
                    write.writerow([f"{begin:.0f}", *numbers, answers, late])
        if picture:
            self.draw(margin, picture)

    def draw(self, margin: float, picture) -> None:
        """Distances with the guaranteed minimum, time of a tick, and missed deadlines, in bins."""
        import matplotlib

        matplotlib.use("Agg")
        import matplotlib.pyplot as plt

        bins = np.array(list(self.bins(max(self.t[-1] / 400, 0.02))))
        figure, (far, took, late) = plt.subplots(3, 1, sharex=True, figsize=(10, 8), height_ratios=[3, 1, 1])
        far.fill_between(
            bins[:, 0], 1e3 * bins[:, 2], 1e3 * bins[:, 3], alpha=0.4, label="interval of the nearest pair"
        )
        far.plot(bins[:, 0], 1e3 * bins[:, 1], lw=1, color="black", label="true distance, judged without Clearance")
        far.axhline(1e3 * margin, ls="--", color="orange", label="margin that the barrier keeps")
        far.axhline(1e3 * self.keep, color="red", label="promise")
        far.set(ylabel="least distance [mm]", ylim=(0, None))
        far.legend(loc="upper right")
        took.semilogy(bins[:, 0], bins[:, 4], label="median")
        took.semilogy(bins[:, 0], bins[:, 5], label="p99.9")
        took.set(ylabel="tick [us]")
        took.legend(loc="upper right")
        late.plot(bins[:, 0], bins[:, 7], color="red")
        late.set(ylabel="missed deadlines", xlabel="time [s]")
        figure.tight_layout()
        figure.savefig(picture, dpi=110)
