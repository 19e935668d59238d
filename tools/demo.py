"""The demo: a daemon, an arm that moves by joint messages over LCM, and one query through three transports.

Starts clearanced on a scene, moves its joints and bodies from separate processes, and queries every body's nearest
neighbour through shared memory (Python), ZeroMQ (C++) and LCM (Python) at one pose revision. Compares the answers bit
for bit, measures latency, proves a collision on an edge that sampling reports free, and draws a picture. Ends by itself
and leaves nothing behind.
"""
import argparse
import csv
import itertools
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "build/python"))

import check_certificate  # noqa: E402
import clearance  # noqa: E402
from demo_answers import ask_everywhere  # noqa: E402
from demo_moves import Mover  # noqa: E402
from edge import STEP, TURN, Edge  # noqa: E402
from processes import DemoError, Stage  # noqa: E402
from service import BIN, ROUTE, start_daemon  # noqa: E402

WAYS = {"shm": "shared memory (Python)", "zmq": "ZeroMQ (C++)", "lcm": "LCM (Python)"}


def say(line=""):
    print(line, flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scene", default=ROOT / "scenes/cell/robot.yaml", type=Path)
    parser.add_argument("--picture", default=ROOT / "out/demo.png", type=Path)
    parser.add_argument("--samples", default=2, type=int, help="in each direction of a pixel of the picture")
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
        command = [BIN / "clearance", "bench", "--connect", url, "--pairs", "0", "--rate", "closed",
                   "--seconds", str(seconds), "--csv", file]
        done = subprocess.run(command, capture_output=True, text=True)
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
        samples=options.samples,
    )
    say(f"Picture   {shown(options.picture)} ({time.monotonic() - started:.0f} s)")


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
