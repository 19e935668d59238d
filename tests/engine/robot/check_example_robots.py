"""Checks the robots of the package example-robot-data: each loads, or fails due to an error in the file. Poses of links
are compared with 60-digit ones, computed here independently from the URDF, and with Pinocchio's.

usage: check_example_robots.py BUILD_FOLDER [URDF...] (without files: all of the package's)

Needs example-robot-data, mpmath, numpy and pin.
"""

import csv
import importlib.util
import io
import math
import random
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ET
from pathlib import Path

import mpmath
import numpy as np
import pinocchio
from mpmath import mpf

mpmath.mp.dps = 60

# Rejected files, and a part of each error.
REFUSED = {
    "alex_psyonic_hands.urdf": 'mimic: there is no joint "index_q1"',
    "ur3.urdf": "expected the attribute name",  # an empty <robot/>
}
# SRDFs whose URDF is not in the package or rejected, and a part of each error.
REFUSED_SRDFS = {
    "alexander.srdf": 'this SRDF is for the robot "alexander", the URDF for "Alexander"',
    "cassie_v2.srdf": None,  # the package has no URDF of it
    "z1.srdf": 'this SRDF is for the robot "z1", the URDF for "z1_description"',
}
RADIUS = 0.1  # metres: distance from the link's origin of the points that an error is for
EVERY = 3  # share of the robots, of all sizes, compared with 60 digits in two configurations


def matrix(rows):
    return mpmath.matrix(rows)


def turn(axis, angle):
    """Rodrigues, from an axis of any length."""
    n = mpmath.sqrt(sum(mpf(a) ** 2 for a in axis))
    x, y, z = (mpf(a) / n for a in axis)
    k = matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return mpmath.eye(3) + mpmath.sin(angle) * k + (1 - mpmath.cos(angle)) * k * k


def numbers(element, attribute, default):
    """The float64 nearest to each decimal, as reals."""
    if element is None or attribute not in element.attrib:
        return [mpf(x) for x in default]
    return [mpf(float(x)) for x in element.get(attribute).split()]


class ExactRobot:
    """A URDF by its definition; shares nothing with the tested code."""

    def __init__(self, path):
        self.joints = ET.parse(path).getroot().findall("joint")
        self.by_child = {j.find("child").get("link"): j for j in self.joints}

    def frame(self, link, q):
        """(R, t) of a link for positions by name."""
        joint = self.by_child.get(link)
        if joint is None:
            return mpmath.eye(3), matrix([0, 0, 0])
        R, t = self.frame(joint.find("parent").get("link"), q)
        roll, pitch, yaw = numbers(joint.find("origin"), "rpy", (0, 0, 0))
        t = t + R * matrix(numbers(joint.find("origin"), "xyz", (0, 0, 0)))
        R = R * turn((0, 0, 1), yaw) * turn((0, 1, 0), pitch) * turn((1, 0, 0), roll)
        kind, axis, mimic = joint.get("type"), numbers(joint.find("axis"), "xyz", (1, 0, 0)), joint.find("mimic")
        if kind == "fixed":
            return R, t
        name, position = joint.get("name"), None
        if mimic is not None:
            factor, offset = (mpf(float(mimic.get(a, d))) for a, d in (("multiplier", 1), ("offset", 0)))
            position = factor * mpf(q[mimic.get("joint")]) + offset
        else:
            position = mpf(q[name])
        if kind == "prismatic":
            n = mpmath.sqrt(sum(a * a for a in axis))
            return R, t + R * matrix([a * position / n for a in axis])
        assert kind in ("revolute", "continuous"), kind
        return R * turn(axis, position), t


def rotation(w, x, y, z):
    """M(q) / |q|^2."""
    w, x, y, z = (mpf(v) for v in (w, x, y, z))
    m = matrix([
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w + y * y - x * x - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w + z * z - x * x - y * y],
    ])  # fmt: skip
    return m / (w * w + x * x + y * y + z * z)


def norm(m):
    return mpmath.sqrt(sum(x * x for x in m))


def run(build, *arguments):
    return subprocess.run([f"{build}/bin/clearance", "robot", *map(str, arguments)], capture_output=True, text=True)


def table(text):
    return list(csv.DictReader(io.StringIO(text)))


def placed(build, urdf, names, rows):
    """Rows of `clearance robot fk`, by configuration and link."""
    with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
        file.write(",".join(names) + "\n" + "".join(",".join(map(repr, row)) + "\n" for row in rows))
        file.flush()
        answer = run(build, "fk", urdf, "--positions", file.name, "--radius", RADIUS, "--csv")
    assert answer.returncode == 0, answer.stderr
    numbers_of = {}
    for row in table(answer.stdout):
        link = row.pop("link")
        numbers_of[int(row["configuration"]), link] = {name: float(x) for name, x in row.items()}
    return numbers_of


def judge(robot, names, rows, poses):
    """Largest error over its bound, largest bound over reach."""
    worst = most = 0.0
    for (k, link), pose in poses.items():
        R, t = robot.frame(link, dict(zip(names, rows[k], strict=True)))
        dR = R - rotation(*(pose[c] for c in ("qw", "qx", "qy", "qz")))
        dt = t - matrix([pose["x"], pose["y"], pose["z"]])
        off = norm(dt) + norm(dR) / mpmath.sqrt(2) * RADIUS
        assert off <= pose["error"] + mpf(10) ** -50, f"{link}: {float(off)} m off, {pose['error']} claimed"
        if pose["error"]:
            worst, most = max(worst, float(off / pose["error"])), max(most, pose["error"] / pose["reach"])
    return worst, most


def beside_pinocchio(urdf, names, rows, poses):
    """Largest distance from Pinocchio's poses, over the reach, and its time per configuration in us (from Python)."""
    model = pinocchio.buildModelFromUrdf(str(urdf))
    data = model.createData()
    farthest = 0.0
    for k, row in enumerate(rows):
        q = pinocchio.neutral(model)
        for name, x in zip(names, row, strict=True):
            joint = model.joints[model.getJointId(name)]
            q[joint.idx_q : joint.idx_q + joint.nq] = [x] if joint.nq == 1 else [math.cos(x), math.sin(x)]
        pinocchio.framesForwardKinematics(model, data, q)
        for frame, X in zip(model.frames, data.oMf, strict=True):
            if frame.type == pinocchio.FrameType.BODY and (k, frame.name) in poses:
                pose = poses[k, frame.name]
                off = np.linalg.norm(X.translation - [pose["x"], pose["y"], pose["z"]])
                farthest = max(farthest, off / max(pose["reach"], RADIUS))
    begin = time.perf_counter()
    for _ in range(2000):
        pinocchio.framesForwardKinematics(model, data, q)
    return farthest, (time.perf_counter() - begin) / 2000 * 1e6


def check_urdf(build, urdf, rng, exactly):
    """A line about the robot."""
    answer = run(build, "inspect", urdf, "--csv")
    expected = REFUSED.get(urdf.name)
    if expected:
        assert answer.returncode == 1 and str(urdf) in answer.stderr and expected in answer.stderr, answer.stderr
        return f"refused: {answer.stderr.strip().rsplit(urdf.name, 1)[1]}"
    # Meshes are in packages of ROS, which are not given here.
    assert answer.returncode == 0 or "has no folder here" in answer.stderr, answer.stderr
    rows = table(answer.stdout)
    names = [r["position"] for r in rows if r["position"] and not r["position"].startswith("mimics ")]
    if not names:
        return f"{len(rows)} links, no joint that moves"
    q = [[rng.uniform(-math.pi, math.pi) for _ in names] for _ in range(2 if exactly else 5)]
    poses = placed(build, urdf, names, q)
    text = f"{len(rows)} links, {len(names)} positions"
    if exactly:
        worst, most = judge(ExactRobot(urdf), names, q, poses)
        assert most < 3e-14, most
        text += f"; 60 digits: error at most {worst:.3f} of the claim, claim {most:.2g} of the reach"
    if any(j.find("mimic") is not None and j.get("type") != "fixed" for j in ExactRobot(urdf).joints):
        return text + "; Pinocchio: mimic joints are free ones there"
    off, us = beside_pinocchio(urdf, names, q, poses)
    assert off < 1e-12, off
    return text + f"; Pinocchio: {off:.1g} of the reach apart, {us:.2f} us from Python"


def check_srdf(build, srdf):
    """Whether a URDF in the same folder is its robot."""
    errors = []
    for urdf in sorted(srdf.parent.parent.rglob("*.urdf")):
        answer = run(build, "inspect", urdf, "--srdf", srdf, "--csv")
        if answer.returncode == 0 or "has no folder here" in answer.stderr:
            return f"read, {answer.stderr.count(': warning: ')} warnings"
        errors.append(answer.stderr)
    assert srdf.name in REFUSED_SRDFS, errors
    words = REFUSED_SRDFS[srdf.name]
    assert not errors if words is None else any(words in error for error in errors), errors
    return "refused: " + (words or "the package has no URDF of it")


def main():
    build, files = sys.argv[1], [Path(f) for f in sys.argv[2:]]
    rng = random.Random(1)
    if files:
        for urdf in files:
            print(f"{urdf.name}: {check_urdf(build, urdf, rng, True)}")
        return
    (place,) = importlib.util.find_spec("cmeel").submodule_search_locations
    robots = Path(place).parent / "cmeel.prefix/share/example-robot-data/robots"
    urdfs, srdfs = sorted(robots.rglob("*.urdf")), sorted(robots.rglob("*.srdf"))
    assert (len(urdfs), len(srdfs)) == (69, 38), (len(urdfs), len(srdfs))
    small = sorted((u for u in urdfs if u.name not in REFUSED), key=lambda u: u.stat().st_size)
    judged = set(small[::EVERY])
    for urdf in urdfs:
        print(f"{urdf.relative_to(robots)}: {check_urdf(build, urdf, rng, urdf in judged)}", flush=True)
    for srdf in srdfs:
        print(f"{srdf.relative_to(robots)}: {check_srdf(build, srdf)}", flush=True)


main()
