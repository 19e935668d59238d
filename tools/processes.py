"""Child processes that end with the demo, however it ends, and a check that nothing is left behind."""
import ctypes
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path


class DemoError(Exception):
    """An error for the user, shown without a traceback."""


def _die_with_parent():
    ctypes.CDLL(None).prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG: also if this process is killed


class Stage:
    """A folder for sockets and logs, and the processes that use it. Leaving this context ends and removes
    everything."""

    def __init__(self):
        self.folder = Path(tempfile.mkdtemp(prefix="clearance-demo-"))
        self.children = []

    def __enter__(self):
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
        return self

    def __exit__(self, *_):
        # A second Ctrl-C must not interrupt the cleanup.
        old = signal.signal(signal.SIGINT, signal.SIG_IGN)
        try:
            for _, child in reversed(self.children):
                _end(child)
            shutil.rmtree(self.folder, ignore_errors=True)
        finally:
            signal.signal(signal.SIGINT, old)

    def start(self, name, command, **options):
        """Starts a child; its output goes to a log in the folder, unless stdout= is given."""
        with open(self.folder / f"{name}.log", "w") as log:
            options.setdefault("stdout", log)
            try:
                child = subprocess.Popen([str(part) for part in command], stdin=subprocess.DEVNULL, stderr=log,
                                         start_new_session=True, preexec_fn=_die_with_parent, **options)
            except OSError as error:
                raise DemoError(f"cannot start {command[0]}: {error.strerror}") from None
        self.children.append((name, child))
        return child

    def log(self, name):
        """The last lines of a child's output."""
        return "\n".join("    " + line for line in (self.folder / f"{name}.log").read_text().splitlines()[-20:])

    def check(self):
        """Raises DemoError if a child has ended."""
        for name, child in self.children:
            if child.poll() is not None:
                raise DemoError(f"{name} ended with exit code {child.returncode}. Its output:\n{self.log(name)}")

    def wait_until(self, condition, what, seconds=30.0):
        """Waits until condition() is true; raises DemoError if a child ends meanwhile or it takes too long."""
        deadline = time.monotonic() + seconds
        while not condition():
            self.check()
            if time.monotonic() > deadline:
                raise DemoError(f"waited {seconds:.0f} s in vain for {what}")
            time.sleep(0.01)

    def left_behind(self):
        """Remains after the end of the stage: processes, and the folder with the sockets. Call it after leaving the
        stage. (Shared memory has no name, and is freed with the processes.)"""
        found = [f"process {child.pid} ({name})" for name, child in self.children if child.poll() is None]
        found += [f"process {pid}" for pid in _processes_naming(str(self.folder))]
        if self.folder.exists():
            found.append(f"folder {self.folder}")
        return found


class ReadyNotice:
    """The socket on which a service reports that it is ready, as for systemd (NOTIFY_SOCKET)."""

    def __init__(self, folder):
        self.path = str(folder / "notify")
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(self.path)
        self.socket.setblocking(False)

    def arrived(self):
        try:
            return b"READY=1" in self.socket.recv(4096)
        except BlockingIOError:
            return False


def _end(child):
    if child.poll() is not None:
        return
    child.send_signal(signal.SIGCONT)
    child.terminate()
    try:
        child.wait(timeout=5)
    except subprocess.TimeoutExpired:
        child.kill()
        child.wait()


def _processes_naming(text):
    found = []
    for entry in os.listdir("/proc"):
        if not entry.isdigit() or int(entry) == os.getpid():
            continue
        try:
            command = Path("/proc", entry, "cmdline").read_bytes().decode(errors="replace")
        except OSError:
            continue
        if text in command:
            found.append(int(entry))
    return found
