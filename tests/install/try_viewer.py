"""try_viewer.py BUILD PICTURES: `clearance view` in a browser: its numbers are the engine's, no error in its console.

BUILD: a build folder. PICTURES: a folder for screenshots. CHROMIUM: the browser; by default the one on PATH.
"""

import asyncio
import contextlib
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback

import numpy as np
from playwright.sync_api import sync_playwright
from viser.infra._async_message_buffer import AsyncMessageBuffer

import clearance
from clearance.view.edge import certified_edge
from clearance.view.session import Session
from clearance.view.tables import rounded_down, rounded_up
from clearance.view.viewer import Viewer

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD, PICTURES = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2])
SCENE = ROOT / "scenes/cell/robot.yaml"
PATIENCE_S = 240.0
DASH = " \N{EN DASH} "
GL = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


def wait_until(condition, what):
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > deadline:
            raise SystemExit(f"waited {PATIENCE_S:.0f} s in vain for {what}")
        time.sleep(0.02)


@contextlib.contextmanager
def viewing(front, scene, source, path=None):
    """A viewer in a thread of this process."""
    viewer = Viewer(Session(front, scene, source, path), port=18080, rate_hz=4)
    thread = threading.Thread(target=viewer.run)
    thread.start()
    try:
        yield viewer
    finally:
        viewer.stop()
        thread.join()


class Tab:
    """A page in the browser, and its console output."""

    def __init__(self, browser, url):
        self.errors = []
        self.page = browser.new_page(viewport={"width": 1440, "height": 900})
        self.page.set_default_timeout(1e3 * PATIENCE_S)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", lambda m: self.errors.append(m.text) if m.type == "error" else None)
        self.page.goto(url)
        self.page.wait_for_selector("tr[data-pair]")

    def open(self, name):
        self.page.get_by_role("tab", name=name).click()

    def rows(self):
        """{(a, b): (lower, upper)} with all digits, the same as shown, and whole rows as text."""
        script = """() => [...document.querySelectorAll('tr[data-pair]')].map(r => [r.dataset.pair,
            r.querySelector('.lower').title, r.querySelector('.upper').title,
            r.querySelector('.lower').innerText, r.querySelector('.upper').innerText, r.innerText])"""
        found = {}
        for pair, lower, upper, *shown in self.page.evaluate(script):
            found[tuple(map(int, pair.split(",")))] = (float(lower), float(upper), *shown)
        return found

    def wait_for(self, expected, what):
        wait_until(lambda: {pair: row[:2] for pair, row in self.rows().items()} == expected, what)

    def picture(self, name):
        """A screenshot two frames after everything has arrived."""
        for notice in self.page.locator(".mantine-Notification-root button").all():
            notice.click()
        self.page.wait_for_timeout(1500)
        self.page.screenshot(path=PICTURES / f"{name}.png")


@contextlib.contextmanager
def writing_in_its_loop():
    """Lets the viewer write to its page from viser's own loop only; other threads sometimes end that loop."""
    push, elsewhere, written = AsyncMessageBuffer.push, [], []

    def noted(buffer, message):
        stack = traceback.extract_stack()
        if any("clearance/view/" in frame.filename and frame.name not in ("__init__", "stop") for frame in stack):
            written.append(message)
            try:
                asyncio.get_running_loop()
            except RuntimeError:
                elsewhere.append("".join(traceback.format_list(stack)))
        push(buffer, message)

    AsyncMessageBuffer.push = noted
    try:
        yield
    finally:
        AsyncMessageBuffer.push = push
    assert len(written) > 100 and not elsewhere, (len(written), *elsewhere[:1])


def expected_rows(front, **requested):
    r = front.distances(("*", "*"), reduce="within", max_distance=0.25, fields=("default", "pair"), **requested)
    return {tuple(p): (lo, up) for p, lo, up in zip(r.pairs.tolist(), r.lower.tolist(), r.upper.tolist())}


def try_scene(browser):
    """A scene file, answered in this process: rows, rounding, sliders, overlaps, an edge."""
    scene = clearance.Scene.load(SCENE)
    front, judge = clearance.Engine(scene), clearance.Engine(scene)
    with viewing(front, scene, str(SCENE.name)) as viewer:
        tab = Tab(browser, viewer.url)
        expected = expected_rows(judge)
        assert len(expected) > 20, len(expected)
        tab.wait_for(expected, "the engine's numbers")
        for lower, upper, low, high, _ in tab.rows().values():
            assert (low, high) == (rounded_down(lower), rounded_up(upper)) and float(low) <= lower <= upper <= float(
                high
            )
        tab.picture("pairs")

        tab.open("Joints")
        arm = judge.joints("arm")
        fill(tab.page, "arm/turn", "0.55")
        wait_until(lambda: abs(front.joint_states()[0].position - 0.55) < 1e-3, "the slider to move the joint")
        judge.set_joints([state.position for state in front.joint_states()], joints=arm)
        assert (judge.distances(reduce="min").status == clearance.Status.OVERLAP).all(), "the arm is not in the shelf"
        tab.open("Pairs")
        tab.wait_for(expected_rows(judge), "the numbers where the slider is")
        assert sum("overlap" in row[4] for row in tab.rows().values()) > 0
        tab.picture("overlap")

        try_edge(tab, viewer, judge, arm)
        tab.open("Look")
        tab.page.get_by_label("bodies as").click()
        tab.page.get_by_role("option", name="pieces").click()
        tab.picture("pieces")
        tab.page.get_by_label("bodies as").click()
        tab.page.get_by_role("option", name="points").click()
        tab.page.get_by_label("names").click()
        tab.picture("points")
        tab.page.get_by_label("covers", exact=True).click()
        wait_until(lambda: not viewer._session.uncovered, "the covers")
        tab.picture("covers")
        tab.open("Service")
        tab.picture("service")
        assert not tab.errors, tab.errors
        tab.page.close()


def fill(page, label, value):
    """Enters a number next to a slider."""
    box = page.get_by_text(label, exact=True).locator("xpath=ancestor::*[.//input][1]").locator("input").last
    box.fill(value)
    box.press("Enter")


def try_edge(tab, viewer, judge, arm):
    """From the arm's position to another: each span's status, bounds and pair are the engine's."""
    tab.open("Joints")
    start = viewer._panel.positions()
    tab.page.get_by_role("button", name="as start").click()
    wait_until(lambda: viewer._panel.ends[0] is not None, "the start")
    fill(tab.page, "arm/turn", "-1.2")
    wait_until(lambda: abs(viewer._panel.positions()[0] + 1.2) < 1e-3, "the slider")
    end = viewer._panel.positions()
    tab.page.get_by_role("button", name="as end").click()
    wait_until(lambda: viewer._panel.ends[1] is not None, "the end")
    tab.page.get_by_role("button", name="Prove the edge").click()
    tab.page.wait_for_selector("tr[data-span]")
    edge = certified_edge(judge, arm, start, end, margin=0.01, spans=16)
    script = """() => [...document.querySelectorAll('tr[data-span]')].map(r => [r.querySelector('.lower').title,
        r.querySelector('.upper').title, r.querySelector('i').innerText, r.children[4].innerText])"""
    names = [body.name for body in judge.bodies]
    expected = [
        [s.lower, s.upper, s.verdict.value, DASH.join(names[i] for i in s.decided_by)]
        for s in (edge.whole, *edge.spans)
    ]
    have = [[float(lower), float(upper), *rest] for lower, upper, *rest in tab.page.evaluate(script)]
    assert have == expected, (have, expected)
    assert {row[2] for row in have} == {"hit", "free"}, have
    tab.picture("edge")


def try_path(browser):
    """A path into the shelf: its motions' verdicts, its first contact, and the arm at a time of it."""
    scene = clearance.Scene.load(SCENE)
    front = clearance.Engine(scene)
    names = [state.name for state in front.joint_states()]
    rows = np.repeat([[state.position for state in front.joint_states()]], 3, axis=0)
    rows[1:, 0] += -0.3, 0.9
    path = clearance.Trajectory.linear([0, 1, 2], rows, names)
    contact = front.explain_path(rows, front.joints("arm"), margin=0.01).contact
    with viewing(front, scene, str(SCENE.name), path) as viewer:
        tab = Tab(browser, viewer.url)
        tab.open("Path")
        tab.page.wait_for_selector("tr[data-motion]")
        verdicts = tab.page.evaluate("() => [...document.querySelectorAll('tr[data-motion] i')].map(i => i.innerText)")
        assert verdicts == ["free", "hit"], verdicts
        tab.page.get_by_text(f"first contact at {1 + contact.t:.3f}").wait_for()
        fill(tab.page, "time [s]", "1.5")
        wait_until(lambda: abs(front.joint_states()[0].position - rows[1:, 0].mean()) < 1e-3, "the arm on its path")
        tab.picture("path")
        tab.page.get_by_role("button", name="Go to the least clearance").click()
        report = viewer._session.proved_path(0.01).report
        there = rows[report.nearest.index] + report.nearest.t * np.diff(rows, axis=0)[report.nearest.index]
        wait_until(lambda: abs(front.joint_states()[0].position - there[0]) < 1e-3, "the arm at the least clearance")
        assert not tab.errors, tab.errors
        tab.page.close()


def try_daemon(browser, folder):
    """A daemon: its numbers, those at other joint positions without any change to it; its end, and its return."""
    url = f"ipc://{folder}/clearance.ipc"

    def start():
        read, write = os.pipe()
        command = [BUILD / "bin/clearanced", "--scene", SCENE, "--zmq", url, "--log-level", "warn"]
        process = subprocess.Popen([*command, "--ready-fd", str(write)], pass_fds=[write])
        os.close(write)
        with os.fdopen(read) as ready:
            assert ready.read(), "clearanced ended before it was ready"
        return process

    daemon = start()
    try:
        scene, front, judge = clearance.Scene.load(SCENE), clearance.connect(url), clearance.connect(url)
        with viewing(front, scene, url) as viewer:
            tab = Tab(browser, viewer.url)
            tab.wait_for(expected_rows(judge), "the daemon's numbers")
            judge.set_joints({"arm/turn": 0.3})
            tab.wait_for(expected_rows(judge), "the daemon's numbers after a move")
            revision = judge.distances(reduce="min").snapshot_revision

            tab.open("Joints")
            fill(tab.page, "arm/turn", "-0.9")
            wait_until(lambda: viewer._panel.elsewhere() is not None, "the slider")
            positions = viewer._panel.positions()
            tab.open("Pairs")
            what_if = {"joints": judge.joints("arm"), "configurations": positions[None]}
            tab.wait_for(expected_rows(judge, **what_if), "what would be")
            tab.picture("daemon")
            assert judge.distances(reduce="min").snapshot_revision == revision, "the viewer has moved something"

            daemon.kill()
            daemon.wait()
            tab.page.get_by_text("Connection").first.wait_for()
            daemon = start()
            judge = clearance.connect(url)
            tab.page.wait_for_function("() => !document.body.innerText.includes('Error')")
            viewer._panel._moved = False
            tab.wait_for(expected_rows(judge), "the numbers of the daemon that came after")
            assert not tab.errors, tab.errors
            tab.page.close()
    finally:
        daemon.terminate()
        daemon.wait()


def try_command(browser):
    """The command itself, which serves on this machine alone and ends with Ctrl-C."""
    command = [BUILD / "bin/clearance", "view", ROOT / "scenes/primitives/scene.yaml", "--port", "18180"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHON": sys.executable})
    try:
        url = re.search(r"http://localhost:\d+", process.stdout.readline()).group()
        tab = Tab(browser, url)
        judge = clearance.Engine(clearance.Scene.load(ROOT / "scenes/primitives/scene.yaml"))
        tab.page.get_by_label("within [m]").fill("0.25")
        tab.wait_for(expected_rows(judge), "the engine's numbers")
        tab.picture("primitives")
        assert not tab.errors, tab.errors
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=PATIENCE_S) == 0


def main():
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore the signal
    PICTURES.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        program = os.environ.get("CHROMIUM") or shutil.which("chromium")
        assert program, "there is no chromium on PATH"
        browser = playwright.chromium.launch(executable_path=program, args=GL)
        with writing_in_its_loop():
            try_scene(browser)
            try_path(browser)
            try_daemon(browser, folder)
        try_command(browser)
        browser.close()
    print(f"the page's numbers are the engine's; {len(list(PICTURES.glob('*.png')))} pictures in {PICTURES}")


if __name__ == "__main__":
    main()
