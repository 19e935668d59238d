"""Runs the snippets and commands of a page, in a folder with the repository's files."""

import contextlib
import getpass
import grp
import io
import os
import re
import shlex
import shutil
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ.get("CLEARANCE_BUILD", ROOT / "build"))
DAEMON = re.compile(r"(?:build/bin/)?clearanced\s")
EXPORT = re.compile(r"export (\w+)=(\S*)")
LONGEST_S = 600  # timeout of a command that hangs; none takes a tenth of it


class Failed(Exception):
    """A command of a page failed; the message contains the command and the error."""


def lines_of(block):
    """(line of the page, command) of each command of a shell block; \\ at a line's end joins it with the next."""
    joined = re.sub(r"\\\n\s*", lambda found: "\0", block.code)
    at = block.line
    for line in joined.splitlines():
        command = line.replace("\0", " ").strip()
        if command and not command.startswith("#"):
            yield at, command
        at += 1 + line.count("\0")


class Reader:
    """A folder, an environment and a daemon. Replaces names on pages that are unique to a machine: /tmp and /run become
    folders within, host "robot" and port 5555 a free port here, user and groups the current ones.
    """

    def __enter__(self):
        self.folder = Path(tempfile.mkdtemp(prefix="page"))
        self.work, self._daemon = self.folder / "work", None
        for name in ("work", "tmp", "run", "run/clearance", "cache"):
            (self.folder / name).mkdir(mode=0o700)
        for entry in ROOT.iterdir():
            if entry.name not in ("build", "out", ".git"):
                (self.work / entry.name).symlink_to(entry)
        (self.work / "build").symlink_to(BUILD)
        user, group, port = getpass.getuser(), grp.getgrgid(os.getgid()).gr_name, free_port()
        self._stand_ins = {
            "/tmp/": f"{self.folder}/tmp/",
            "/run/clearance/": f"{self.folder}/run/clearance/",
            "0.0.0.0:5555": f"127.0.0.1:{port}",
            "robot:5555": f"127.0.0.1:{port}",
            "127.0.0.1:9464": f"127.0.0.1:{free_port()}",
            "--control-user controller": f"--control-user {user}",
            "--socket-group planners": f"--socket-group {group}",
            "?user=clearance": f"?user={user}",
        }
        path = f"{BUILD}/bin{os.pathsep}{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        self._environment = {
            "PATH": path,
            "PYTHONPATH": str(BUILD / "python"),
            "XDG_RUNTIME_DIR": f"{self.folder}/run",
            "CLEARANCE_CACHE": f"{self.folder}/cache/clearance",
        }
        return self

    def __exit__(self, *_):
        self._stop()
        shutil.rmtree(self.folder)

    def stand_in(self, text: str) -> str:
        for name, own in self._stand_ins.items():
            text = text.replace(name, own)
        return text

    def _as_written(self, printed: str) -> str:
        for name in ("/tmp/", "/run/clearance/"):
            printed = printed.replace(self._stand_ins[name], name)
        return printed

    def python(self, names: dict, code: str, name: str, line: int) -> str:
        """The output of a snippet; its line numbers are those of the page."""
        printed, before, environment = io.StringIO(), os.getcwd(), dict(os.environ)
        os.chdir(self.work)
        os.environ["XDG_RUNTIME_DIR"] = self._environment["XDG_RUNTIME_DIR"]
        try:
            with contextlib.redirect_stdout(printed):
                exec(compile("\n" * (line - 1) + self.stand_in(code), name, "exec"), names)
        finally:
            os.chdir(before)
            os.environ.clear()
            os.environ.update(environment)
        return self._as_written(printed.getvalue())

    def command(self, line: str, where: str) -> str:
        """The output of a command. One that starts a daemon ends the previous one, and returns when the daemon is
        ready.
        """
        line = self.stand_in(line)
        exported = EXPORT.match(line)
        if DAEMON.match(line):
            self._serve(line, where)
        elif exported:
            self._environment[exported[1]] = exported[2]
        else:
            done = subprocess.run(
                ["bash", "-c", line],
                cwd=self.work,
                env={**os.environ, **self._environment},
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                timeout=LONGEST_S,
            )
            if done.returncode:
                raise Failed(f"{where}: {line}\nends with {done.returncode}: {done.stderr}{done.stdout}")
            return self._as_written(done.stdout)
        return ""

    def _serve(self, line: str, where: str) -> None:
        self._stop()
        _, *arguments = shlex.split(line.partition(" &")[0], comments=True)
        read_end, write_end = os.pipe()
        command = [f"{BUILD}/bin/clearanced", *arguments, "--ready-fd", str(write_end)]
        with open(self.folder / "log", "w") as log:
            self._daemon = subprocess.Popen(
                command, cwd=self.work, env={**os.environ, **self._environment}, pass_fds=[write_end], stderr=log
            )
        os.close(write_end)
        with os.fdopen(read_end) as ready:
            if not ready.read():
                said = (self.folder / "log").read_text()
                raise Failed(f"{where}: {line}\nended before it was ready: {said}")

    def _stop(self) -> None:
        if self._daemon:
            self._daemon.terminate()
            self._daemon.wait()
            self._daemon = None


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]
