"""Latency of a control loop while `clearance view` displays its daemon's scene, and without the viewer.

A query of one pair over shared memory, a thousand times a second, by a client of class control, alternately without and
with a viewer's queries: all requests of a page, ten times a second, from a separate process. The browser and the
drawing are left out, because they send nothing to a daemon and run on the viewer's machine. Prints and writes, as CSV,
the medians over the turns of p50, p99.9 and max, the least and greatest p99.9, and the daemon's CPU time per picture,
which other programs hardly change. The loop's client runs at real-time priority if permitted. Measured with an ordinary
daemon and with one that has --real-time, whose loop no other program delays, so that a difference is due to the viewer.
"""

import os
import statistics
import subprocess
import sys
import time

from bench_classes import Cpus, Players, Priority, control_options
from bench_sections import bench_one_pair, cpu_ms, parser_of, start_clearanced, stolen_ms

from harness import ROOT, shown, write

SCENE = ROOT / "scenes/cell/robot.yaml"
RATE_HZ, PICTURES = 10, 2000


def pictures(url):
    """Sends a page's requests once per iteration."""
    import clearance
    from clearance.view.model import ViewQuery
    from clearance.view.session import Session

    session = Session(clearance.connect(url), clearance.Scene.load(SCENE), url)
    while True:
        session.picture(ViewQuery())
        session.positions()
        yield


def look(url):
    """Acts as the viewer until it is terminated."""
    requested = pictures(url)
    next(requested)
    print("asked", flush=True)
    due = time.monotonic()
    for _ in requested:
        due += 1 / RATE_HZ
        time.sleep(max(0.0, due - time.monotonic()))


def measure(binaries, seconds, turns, real_time):
    """{"nothing": rows of `clearance bench`, "viewer": rows}, and the daemon's CPU time for a picture in us."""
    cpus, priority = Cpus(), Priority()
    rows = {"nothing": [], "viewer": []}
    with Players(priority) as stage:
        of_daemon = control_options(real_time), cpus.run_on(cpus.daemon)
        process, url = start_clearanced(stage, binaries, SCENE, *of_daemon)
        client = [*priority.of_client, *cpus.run_on(cpus.client)]
        requested = pictures(url)
        next(requested)
        before = cpu_ms(process.pid)
        for _ in range(PICTURES):
            next(requested)
        picture_us = (cpu_ms(process.pid) - before) * 1000 / PICTURES
        requested.close()
        for turn in range(turns):
            for kind, of_kind in rows.items():
                stolen = stolen_ms()
                if kind == "viewer":
                    command = [*cpus.run_on(cpus.others), sys.executable, __file__, "--look", url]
                    viewer = stage.start(f"viewer{turn}", command, stdout=subprocess.PIPE, text=True)
                    viewer.stdout.readline()
                row = bench_one_pair(binaries, url, seconds, kind, client)
                of_kind.append({**row, "stolen_ms": stolen_ms() - stolen})
                if kind == "viewer":
                    assert viewer.poll() is None, stage.log(f"viewer{turn}")
                    viewer.kill()
                    viewer.wait()
    return rows, cpus, picture_us


def median_of(rows, name):
    return round(statistics.median(row[name] for row in rows), 1)


def main():
    parser = parser_of(__doc__)
    parser.add_argument("--seconds", type=float, default=10, help="of each turn")
    parser.add_argument("--turns", type=int, default=8)
    parser.add_argument("--look", metavar="URL", help="be the viewer")
    options = parser.parse_args()
    if options.look:
        look(options.look)
    write(shown(rows_of(options)), options.csv)


def rows_of(options):
    for real_time in (False, True):
        rows, cpus, picture_us = measure(options.binaries, options.seconds, options.turns, real_time)
        for kind, of_kind in rows.items():
            yield {
                "daemon": "--real-time" if real_time else "ordinary",
                "beside": kind,
                "machine": of_kind[0]["machine"],
                "shared": "yes" if cpus.are_shared else "no",
                "turns": options.turns,
                "seconds": options.seconds,
                **{n: median_of(of_kind, n) for n in ("p50_us", "p99.9_us", "max_us")},
                "least_p99.9_us": round(min(row["p99.9_us"] for row in of_kind), 1),
                "most_p99.9_us": round(max(row["p99.9_us"] for row in of_kind), 1),
                "picture_us": round(picture_us, 1),
                "stolen_ms": median_of(of_kind, "stolen_ms"),
                "load": round(os.getloadavg()[0], 1),
            }


if __name__ == "__main__":
    main()
