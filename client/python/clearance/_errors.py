"""Exceptions of the package. The extension modules raise these very classes."""

from __future__ import annotations

import builtins
import os
import sys
import warnings

_PACKAGE = os.path.dirname(__file__) + os.sep


class ClearanceError(Exception):
    """Base of every error that Clearance raises about scenes, queries and connections.

    A wrong argument (a shape, a type, an unknown name) is an ordinary TypeError or ValueError that names the argument.
    """


class SceneError(ClearanceError, ValueError):
    """Bad input at set-up: a scene file, a mesh or a body. The text names file, line, key and what was expected."""


class RobotWarning(UserWarning):
    """Something in a robot's SRDF was left out, or something in its URDF is probably a mistake."""


class PoseWarning(UserWarning):
    """A quaternion at load looks like one in the order x, y, z, w, where Clearance has w first.

    It reads as a half turn, and as x, y, z, w it would be no turn or one about z. Where the half turn is meant, the
    negated quaternion is the same rotation and is not warned about.
    """


class JointLimitWarning(UserWarning):
    """Positions of joints are far beyond their limits, and would be within them as degrees. Positions are radians."""


class MeshWarning(UserWarning):
    """A mesh is probably not what the scene takes it for. The text names bodies and figures.

    It is far from convex, and distances are measured to its hull; or it is at least 50 m wide, and its file is probably
    in millimetres. ``warnings.simplefilter("ignore", clearance.MeshWarning)`` silences it, "error" rejects such scenes.
    """


class QueryError(ClearanceError, ValueError):
    """A query as a whole cannot be answered, in process or by the daemon.

    ``code`` is one of the first wire.ErrorCode values: BAD_QUERY, WRONG_SCENE, TOO_LARGE, NOT_SUPPORTED.
    """

    def __init__(self, code: int, text: str):
        super().__init__(text)
        self.code = code

    def __reduce__(self) -> tuple[type, tuple[int, str]]:
        return type(self), (self.code, str(self))


class RequestError(ClearanceError, RuntimeError):
    """The daemon refused a request for a reason that lies not in the query. ``code`` is a wire.ErrorCode."""

    def __init__(self, code: int, text: str):
        super().__init__(text)
        self.code = code

    def __reduce__(self) -> tuple[type, tuple[int, str]]:
        return type(self), (self.code, str(self))


class NewEpoch(RequestError):
    """The daemon was started anew, or is another one, since this client's first contact.

    What clients had sent it - poses, attachments, bodies - is gone. Requests are refused so until
    Client.acknowledge_epoch(). ``code`` is wire.ErrorCode.NEW_EPOCH.
    """


class ConnectionError(ClearanceError, builtins.ConnectionError):
    """The daemon cannot be reached or is gone."""


class TimeoutError(ConnectionError, builtins.TimeoutError):
    """No answer in time."""


class DaemonHung(ConnectionError):
    """The daemon is there, but its loop stood still for hang_s while a request was under way."""


def warn(text: str, category: type[Warning]) -> None:
    """Warns of `text` at the innermost line that is not this package's."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_PACKAGE):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, category, stacklevel=level)
