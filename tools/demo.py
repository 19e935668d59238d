"""The demo: a daemon, an arm that moves by joint messages over LCM, and one query through three transports.

Starts clearanced on a scene, moves its joints and bodies from separate processes, and queries every body's nearest
neighbour through shared memory (Python), ZeroMQ (C++) and LCM (Python) at one pose revision. Compares the answers bit
for bit, measures latency, proves a collision on an edge that sampling reports free, and draws a picture. Ends by itself
and leaves nothing behind.
"""
import argparse
import csv
import io
import itertools
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "build/python"))

import check_certificate  # noqa: E402
import clearance  # noqa: E402
from edge import STEP, TURN, Edge  # noqa: E402
from processes import DemoError, Stage  # noqa: E402
from service import BIN, ROUTE, start_daemon  # noqa: E402

FIELDS = ("default", "points", "pair")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scene", default=ROOT / "scenes/cell/robot.yaml", type=Path)
    parser.add_argument("--picture", default=ROOT / "out/demo.png", type=Path)
    parser.add_argument("--seconds", default=2.0, type=float, help="of latency measurement for each transport")
    parser.add_argument("--move", default=2.0, type=float, help="seconds that all moves before the question")
    options = parser.parse_args()

    stage = Stage()
    status = 1
    try:
        with stage:
            run(stage, options)
            status = 0
    except KeyboardInterrupt:
        print("\nInterrupted.")
        status = 130
    except (DemoError, clearance.ClearanceError, OSError) as error:
        print(f"\nThe demo failed: {error}", file=sys.stderr)
    finally:
        left = stage.left_behind()
        if left:
            print("Left behind: " + ", ".join(left), file=sys.stderr)
            status = status or 1
        else:
            print("Left behind: nothing (no process, no socket)")
    return status


def run(stage, options):
    scene = clearance.Scene.load(options.scene)
    names = [body.name for body in scene.bodies]
    solid = [body.id for body in scene.bodies if body.piece_count]  # frames have no distances
    say(f"Scene     {shown(options.scene)}: {len(solid)} bodies")

    daemon, urls, seconds = start_daemon(stage, options.scene)
    say(f"Daemon    clearanced (process {daemon.pid}), ready after {seconds:.2f} s")
    if "lcm" not in urls:
        say("LCM       left out: this machine has no multicast route. As root, this adds one for this machine alone:")
        say(f"              {ROUTE}")

    with clearance.connect(urls["shm"]) as client:
        mover = Mover(stage, client, urls.get("lcm"))
        for line in mover.describe():
            say(line)
        mover.move(options.move)
        say()
        answers, states, attempts = ask_everywhere(client, urls, mover)
        compare(answers, attempts)
        print_table(names, solid, answers["shm"])
        print_latency(stage, urls, options.seconds)
    print_edge()
    draw_picture(options, scene, solid, states, answers["shm"])


# ---- poses -----------------------------------------------------------------------------------------------------------


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


# ---- the query -------------------------------------------------------------------------------------------------------


def ask_everywhere(client, urls, mover):
    """Queries every body's nearest neighbour through each transport, until all answers belong to one pose revision.

    Returns {transport: Answer}, their poses (as body states), and the number of attempts.
    """
    lcm = clearance.connect(urls["lcm"]) if "lcm" in urls else None
    mover.pause()
    try:
        for attempt in range(1, 101):
            answers = {"shm": ask_python(client), "zmq": ask_cpp(client, urls["zmq"])}
            if lcm:
                answers["lcm"] = ask_python(lcm)
            states = client.body_states()
            revisions = {answer.revision for answer in answers.values()} | {mover.revision()}
            if len(revisions) == 1:
                return answers, states, attempt
            time.sleep(0.01)
        raise DemoError("poses kept changing although their publisher was stopped")
    finally:
        mover.resume()
        if lcm:
            lcm.close()


class Answer:
    """Every body's nearest neighbour: ids (N,) and columns (N,) or (N, 3), row i for body i."""

    def __init__(self, revision, neighbour, status, distance, lower, upper, point, other_point):
        self.revision = revision
        self.neighbour = np.asarray(neighbour, dtype=np.uint32)
        self.status = np.asarray(status, dtype=np.uint8)
        self.distance, self.lower, self.upper, self.point, self.other_point = (
            np.ascontiguousarray(column, dtype=np.float64) for column in (distance, lower, upper, point, other_point))

    COLUMNS = ("neighbour", "status", "distance", "lower", "upper", "point", "other_point")

    def differences(self, other):
        """Names of the columns whose bits differ."""
        return [name for name in self.COLUMNS if getattr(self, name).tobytes() != getattr(other, name).tobytes()]


def ask_python(client):
    r = client.distances(reduce="nearest", fields=FIELDS)
    pairs = r.pairs[0]
    bodies = np.arange(len(pairs))
    first = pairs[:, 0] == bodies  # otherwise the body is the second of its pair
    return Answer(
        r.snapshot_revision,
        np.where(first, pairs[:, 1], pairs[:, 0]),
        r.status[0],
        r.distance[0],
        r.lower[0],
        r.upper[0],
        np.where(first[:, None], r.point_a[0], r.point_b[0]),
        np.where(first[:, None], r.point_b[0], r.point_a[0]),
    )


def ask_cpp(client, url):
    """The same through client/examples/nearest.cpp, whose 17 digits reproduce the bits."""
    done = subprocess.run([ROOT / "build/examples/nearest", url], capture_output=True, text=True, timeout=60)
    if done.returncode:
        raise DemoError(done.stderr.strip())
    first, text = done.stdout.split("\n", 1)
    rows = list(csv.DictReader(io.StringIO(text)))
    ids = {body.name: body.id for body in client.bodies}

    def numbers(*names):
        return np.array([[float(row[name]) for name in names] for row in rows])

    distance, lower, upper = numbers("distance", "lower", "upper").T
    return Answer(int(first.split()[-1]), [ids.get(row["neighbour"], clearance.NONE) for row in rows],
                  [int(row["status"]) for row in rows], distance, lower, upper,
                  numbers("x", "y", "z"), numbers("other_x", "other_y", "other_z"))


def compare(answers, attempts):
    """Prints whether the transports agree; raises DemoError if they do not."""
    reference = answers["shm"]
    say(f"Every body's nearest neighbour at pose revision {reference.revision}"
        + (f" (queried {attempts} times until all were of one revision)" if attempts > 1 else ""))
    for transport, answer in answers.items():
        different = reference.differences(answer)
        if different:
            raise DemoError(f"{WAYS[transport]} differs from shared memory in {', '.join(different)}")
        say(f"  {WAYS[transport]:24} {len(answer.distance)} rows"
            + ("" if answer is reference else ", the same bits in every column"))
    say()


# ---- output ----------------------------------------------------------------------------------------------------------

WAYS = {"shm": "shared memory (Python)", "zmq": "ZeroMQ (C++)", "lcm": "LCM (Python)"}


def print_table(names, solid, answer):
    width = max(map(len, names + ["nearest neighbour"]))
    say(
        f"  {'body':{width}}  {'nearest neighbour':{width}}  {'distance [m]':>12}  {'lower':>18}  {'upper':>18}  status"
    )
    for i in solid:
        name, other = names[i], names[answer.neighbour[i]] if answer.neighbour[i] < len(names) else "(none)"
        say(f"  {name:{width}}  {other:{width}}  {answer.distance[i]:12.6f}  {answer.lower[i]:18.15f}"
            f"  {answer.upper[i]:18.15f}  {status_word(answer.status[i])}")
    say()


def print_latency(stage, urls, seconds):
    """Runs the command line's benchmark on each transport in turn."""
    file = stage.folder / "latency.csv"
    for transport, url in urls.items():
        done = subprocess.run(
            [
                BIN / "clearance",
                "bench",
                "--connect",
                url,
                "--pairs",
                "0",
                "--rate",
                "closed",
                "--seconds",
                str(seconds),
                "--csv",
                file,
            ],
            capture_output=True,
            text=True,
        )
        stage.check()
        if done.returncode:
            raise DemoError(f"clearance bench over {WAYS[transport]}: {done.stderr.strip()}")
        row = list(csv.DictReader(file.open()))[-1]
        if transport == "shm":
            say(f"Latency of a query of {row['pairs']} pairs, one after another for {seconds:g} s, bodies still moving "
                "(floor: a bare echo of as many bytes)")
        say(
            f"  {WAYS[transport].split(' (')[0]:24} p50 {float(row['p50_us']):8.1f} us   p99 "
            f"{float(row['p99_us']):8.1f} us   "
            f"floor p50 {float(row['floor_p50_us']):6.1f} us"
        )
    say()


def print_edge():
    """An edge that is free by sampling, and the proof of a collision, checked by a program without Clearance's code."""
    edge = Edge()
    sampled, proved = edge.sampled(), edge.proved()
    if not sampled.free or not all(good for good, _ in check_certificate.verdicts(proved.witness.document)):
        raise DemoError("the edge that sampling finds free has changed")
    say(f"Edge      the arm turns by {TURN:g} rad: all {sampled.count} samples, {STEP:g} rad apart, are free, by "
        f"{1000 * sampled.nearest:.1f} mm or more")
    say(f"          proved: free until {proved.free_until:.4f} of the way, and at {proved.contact:.4f} "
        f"{' and '.join(proved.bodies)} overlap (its certificate is checked in exact arithmetic)")
    say()


def draw_picture(options, scene, solid, states, answer):
    import picture  # matplotlib takes a while to load

    say("Picture   being drawn ...")
    started = time.monotonic()
    names = [scene.bodies[i].name for i in solid]
    place = {body: i for i, body in enumerate(solid)}
    meshes = []
    for i in solid:
        state = states[i]
        vertices, triangles = scene.display_mesh(i) or hull_of(np.concatenate([v for v, _ in scene.pieces(i)]))
        meshes.append((vertices @ rotation(state.pose[3:]).T + state.pose[:3], triangles))
    rows = [{"body": place[i], "neighbour": place[int(answer.neighbour[i])], "status": status_word(answer.status[i]),
             "distance": answer.distance[i], "point": answer.point[i], "other_point": answer.other_point[i]}
            for i in solid if int(answer.neighbour[i]) in place]
    options.picture.parent.mkdir(parents=True, exist_ok=True)
    picture.draw(
        options.picture,
        names,
        meshes,
        rows,
        title=f"{options.scene.parent.name}: every body's nearest neighbour",
        footnote=f"pose revision {answer.revision}; distances with certified bounds, in metres",
    )
    say(f"Picture   {shown(options.picture)} ({time.monotonic() - started:.0f} s)")


# ---- utilities -------------------------------------------------------------------------------------------------------


def say(line=""):
    print(line, flush=True)


def shown(path):
    return os.path.relpath(path)


def status_word(value):
    return clearance.Status(value).name.lower()


def hull_of(points):
    """Triangles of the hull of a few points, by brute force: bodies given as points have no mesh."""
    points = points[:60]
    triples = np.array(list(itertools.combinations(range(len(points)), 3)), dtype=np.int64).reshape(-1, 3)
    a, b, c = (points[triples[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    side = np.einsum("tk,tpk->tp", normals, points[None] - a[:, None])
    small = 1e-9 * np.abs(side).max(initial=0.0)
    above, below = (side > small).any(1), (side < -small).any(1)
    outward = np.where(above[:, None], triples[:, ::-1], triples)
    return points, outward[~(above & below) & (np.abs(normals).max(1) > 0)]


def rotation(q):
    """(3, 3) from a quaternion w, x, y, z of any norm."""
    w, x, y, z = q / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


if __name__ == "__main__":
    sys.exit(main())
