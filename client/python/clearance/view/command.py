"""The command `clearance view`: options and errors."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Optional

if TYPE_CHECKING:
    from .._scene.scene import Scene
    from .session import Session

_REFUSED, _COMMAND_LINE, _NO_CONNECTION = 1, 2, 3  # as in the command `clearance`
_EPILOG = """
Example
  clearance view scenes/cell/robot.yaml                              a scene file, answered in this process
  clearance view panda.urdf --packages franka_description=.           a robot alone
  clearance view scenes/cell/robot.yaml --path path.csv              a path, with its least distance or first contact
  clearance view scenes/cell/robot.yaml --connect ipc:///tmp/c.ipc   a daemon, with the file's shapes

A daemon does not send shapes: without its scene file, bodies are drawn as their bounding spheres. Sliders query
other poses and change nothing in the daemon.
"""


def parser() -> argparse.ArgumentParser:
    """Returns the parser of the command's options."""
    options = argparse.ArgumentParser(
        prog="clearance view",
        description="Shows a scene in a browser: bodies, the nearest points between them, certified intervals.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    options.add_argument("scene", nargs="?", type=Path, metavar="FILE", help="a scene file (.yaml) or a robot (.urdf)")
    options.add_argument("--connect", metavar="URL", help="the daemon (without FILE: this, or CLEARANCE_URL)")
    options.add_argument("--srdf", type=Path, metavar="FILE", help="SRDF of the robot: groups and disabled pairs")
    options.add_argument(
        "--packages",
        action="append",
        default=[],
        metavar="NAME=FOLDER",
        help="folder of package://NAME; may be repeated",
    )
    options.add_argument(
        "--path",
        type=Path,
        metavar="FILE",
        help="waypoints (.csv, as for `clearance path`), JointTrajectory (.json)",
    )
    options.add_argument("--host", default="127.0.0.1", help="address to serve on; default: this machine alone")
    options.add_argument("--port", type=int, default=8080, help="first port to try; default 8080")
    options.add_argument("--rate", type=_rate, default=10.0, metavar="HZ", help="pictures a second at most; default 10")
    options.add_argument("--timeout", type=float, default=5.0, metavar="S", help="seconds to wait for an answer")
    return options


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Runs the command; returns its exit code."""
    from .._errors import ClearanceError, ConnectionError, TimeoutError

    options = parser().parse_args(arguments)
    try:
        from .viewer import Viewer
    except ImportError as error:
        if (error.name or "").partition(".")[0] != "viser":
            raise
        return _fail(
            _REFUSED, 'the page needs viser: pip install "WHEEL[view]", where WHEEL is the file clearance-*.whl'
        )
    try:
        session = open_session(options)
        viewer = Viewer(session, options.host, options.port, options.rate)
    except ValueError as error:
        return _fail(_COMMAND_LINE, str(error))
    except (ConnectionError, TimeoutError) as error:
        return _fail(_NO_CONNECTION, str(error))
    except (ClearanceError, ImportError, OSError) as error:
        return _fail(_REFUSED, str(error))
    print(f"{session.source}: {viewer.url}", flush=True)
    try:
        viewer.run()
    except KeyboardInterrupt:
        viewer.stop()
    return 0


def open_session(options: argparse.Namespace) -> Session:
    """Creates the session for the options. Raises ValueError for inconsistent options."""
    from .model import all_joints, positions_now
    from .path import read_path
    from .session import Session

    url = options.connect or (None if options.scene else os.environ.get("CLEARANCE_URL"))
    if options.scene is None and url is None:
        raise ValueError("expected a scene file, a URDF, or --connect URL")
    path = None if options.path is None else read_path(options.path)
    scene = None if options.scene is None else load(options.scene, options.srdf, options.packages)
    if url is not None:
        from .._front.client import connect

        return Session(connect(url, options.timeout, service_class="planning"), scene, url, path)
    assert scene is not None
    from .._front.engine import Engine

    engine = Engine(scene)
    joints = all_joints(engine)
    if joints is not None:
        engine.set_joints(positions_now(engine), joints)  # otherwise a robot without a home has no pose
    return Session(engine, scene, str(options.scene), path)


def load(file: Path, srdf: Optional[Path], packages: Sequence[str]) -> Scene:
    """Loads a scene file, or a scene of one robot."""
    from .. import Scene  # raises ImportError without the engine

    if file.suffix.lower() not in (".urdf", ".xml"):
        if srdf or packages:
            raise ValueError("--srdf and --packages are of a URDF; a scene file names its own")
        return Scene.load(file)
    folders = dict(_package(text) for text in packages)
    return Scene.load_urdf(file, srdf=srdf, packages=folders or None, static=True)


def _package(text: str) -> tuple[str, str]:
    name, equals, folder = text.partition("=")
    if not name or not equals or not folder:
        raise ValueError(f"--packages: expected NAME=FOLDER, got {text!r}")
    return name, folder


def _rate(text: str) -> float:
    try:
        rate = float(text)
    except ValueError:
        rate = 0.0
    if not 0.1 <= rate <= 60.0:
        raise argparse.ArgumentTypeError(f"expected 0.1 to 60 pictures a second, got {text!r}")
    return rate


def _fail(code: int, what: str) -> int:
    print(f"clearance view: {what}", file=sys.stderr)
    return code
