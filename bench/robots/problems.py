"""MotionBenchMaker's problems for Clearance's benchmarks.

They are in the source package of vamp-planner on PyPI (Apache-2.0), which is downloaded but never built: only its
robots, meshes and problems are read.

Numbers 1 to 50 of each family are used (Baxter: 1 to 30); the others are reserved for evaluation.
"""

import math
import subprocess
import sys
import tarfile
import warnings
from dataclasses import dataclass

import numpy as np
import yaml

import harness

FOLDER = harness.ROOT / "build/robots"
PACKAGE = "vamp-planner==0.6.4"
ROBOTS = ("panda", "ur5", "fetch", "baxter")
LAST = {"baxter": 30}


@dataclass
class Obstacle:
    name: str
    shape: str  # box, cylinder or sphere
    sizes: list  # metres: full lengths; length and radius; radius
    pose: np.ndarray  # (7,) X_w: x y z, qw qx qy qz


@dataclass
class Problem:
    robot: str
    family: str
    number: int
    start: dict  # joint: radians or metres
    goal: dict
    obstacles: list

    @property
    def name(self):
        return f"{self.robot}/{self.family}/{self.number}"


def parser(doc, robots, **more):
    """Options of a benchmark of these problems. more: arguments of harness.parser()."""
    made = harness.parser(doc, **more)
    made.add_argument("--robots", nargs="+", default=robots.split(), choices=ROBOTS)
    return made


def fetch():
    """The package's resources, downloaded once. Returns the folder of the robots' folders."""
    warnings.simplefilter("ignore")  # the warnings about robots and meshes are expected
    folder, resources = FOLDER, FOLDER / "resources"
    if all((resources / robot / "problems").is_dir() for robot in ROBOTS):
        return resources
    folder.mkdir(parents=True, exist_ok=True)
    print(f"Download {PACKAGE} (65 MB) ...", flush=True)
    command = [sys.executable, "-m", "pip", "download", "--disable-pip-version-check", "--quiet", "--no-deps"]
    command += ["--no-build-isolation", "--no-binary", ":all:", "-d", folder, PACKAGE]
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"pip could not download {PACKAGE}:\n{done.stderr[-2000:]}")
    archive = next(folder.glob("vamp_planner-*.tar.gz"))
    with tarfile.open(archive) as tar:
        top = archive.name.removesuffix(".tar.gz")
        wanted = [m for m in tar.getmembers() if m.name.startswith(tuple(f"{top}/resources/{r}/" for r in ROBOTS))]
        for member in wanted:
            member.name = member.name.removeprefix(top + "/")
        tar.extractall(folder, wanted, filter="data")
    for robot in ROBOTS:
        with tarfile.open(resources / robot / "problems.tar.bz2") as tar:
            tar.extractall(resources / robot, filter="data")
    return resources


def urdf_of(resources, robot):
    """The robot's files with uniform mesh names: some have package://meshes/..., some meshes/..."""
    folder = resources / robot
    text = (folder / f"{robot}.urdf").read_text()
    path = folder / f"{robot}_meshes.urdf"
    path.write_text(text.replace("package://meshes/", "meshes/").replace('"meshes/', f'"package://{robot}/meshes/'))
    return path, folder / f"{robot}.srdf"


def files_of(resources, robot):
    """Arguments of Scene.add_robot()."""
    urdf, srdf = urdf_of(resources, robot)
    return {"urdf": str(urdf), "srdf": str(srdf), "packages": {robot: str(resources / robot)}}


def load(resources, robot, last=math.inf):
    """The problems of a robot, by family and number. last: the highest number."""
    found = []
    for path in sorted((resources / robot / "problems").glob("*/scene*.yaml")):
        number = int(path.stem.removeprefix("scene"))
        if number > min(LAST.get(robot, 50), last):
            continue
        family = path.parent.name.removesuffix(f"_{robot}")
        scene = _read(path)
        request = _read(path.with_name(path.name.replace("scene", "request")))
        state = request["start_state"]["joint_state"]
        constraints = request["goal_constraints"][0]["joint_constraints"]
        found.append(
            Problem(
                robot,
                family,
                number,
                {name: float(q) for name, q in zip(state["name"], state["position"])},
                {c["joint_name"]: float(c["position"]) for c in constraints},
                list(_obstacles(scene["world"]["collision_objects"])),
            )
        )
    return found


def _read(path):
    with open(path) as f:
        return yaml.load(f, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))


def _obstacles(objects):
    for thing in objects:
        parts = thing.get("primitives", [])
        poses = thing.get("primitive_poses", [])
        for i, (part, pose) in enumerate(zip(parts, poses)):
            at = _pose(pose)
            if "pose" in thing:  # of the object, to which the primitive's pose is relative
                at = _product(_pose(thing["pose"]), at)
            name = thing["id"] if len(parts) == 1 else f"{thing['id']}_{i}"
            yield Obstacle(name, part["type"], [float(x) for x in part["dimensions"]], at)


def _pose(pose):
    x, y, z, w = pose["orientation"]
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    return np.array([*pose["position"], w / norm, x / norm, y / norm, z / norm], dtype=float)


def _product(a, b):
    """The pose b in the frame of the pose a."""
    w, v = a[3], a[4:]
    t = a[:3] + b[:3] + 2 * np.cross(v, np.cross(v, b[:3]) + w * b[:3])
    q = np.concatenate([[w * b[3] - v @ b[4:]], w * b[4:] + b[3] * v + np.cross(v, b[4:])])
    return np.concatenate([t, q])
