"""Exceptions of the package. The extension modules raise these very classes."""

from __future__ import annotations

import builtins
import os
import sys
import warnings

_PACKAGE = os.path.dirname(__file__) + os.sep


class ClearanceError(Exception):
    """Base class of Clearance's errors about scenes, queries and connections.

    A wrong argument (a shape, a type, an unknown name) raises TypeError or ValueError naming the argument.
    """


class SceneError(ClearanceError, ValueError):
    """Invalid input at set-up: a scene file, a mesh or a body. Names file, line, key and the expected value."""


class RobotWarning(UserWarning):
    """A part of a robot's SRDF was ignored, or a part of its URDF is probably a mistake."""


class PoseWarning(UserWarning):
    """A quaternion at load looks like one in the order x, y, z, w; Clearance expects w first.

    It is a half turn, and in the order x, y, z, w it would be the identity or a turn about z. The negated quaternion is
    the same rotation, without the warning.
    """


class JointLimitWarning(UserWarning):
    """Joint positions far beyond their limits would be within them as degrees. Positions are radians."""


class MeshWarning(UserWarning):
    """A mesh is probably of another kind than the scene assumes. The text names bodies and measurements.

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


class StaleQuery(QueryError):
    """The scene has changed so that ids of a prepared query mean something else; the text names the first change.

    Prepare the query again. ``code`` is WRONG_SCENE.
    """


class RequestError(ClearanceError, RuntimeError):
    """The daemon rejected a request for a reason outside the query. ``code`` is a wire.ErrorCode."""

    def __init__(self, code: int, text: str):
        super().__init__(text)
        self.code = code

    def __reduce__(self) -> tuple[type, tuple[int, str]]:
        return type(self), (self.code, str(self))


class NewEpoch(RequestError):
    """The daemon was restarted, or is another one, since this client's first contact.

    It has lost the poses, attachments and bodies that clients had sent. Requests are rejected with this error until
    Client.acknowledge_epoch(). ``code`` is wire.ErrorCode.NEW_EPOCH.
    """


class ConnectionError(ClearanceError, builtins.ConnectionError):
    """The daemon cannot be reached or is gone."""


class TimeoutError(ConnectionError, builtins.TimeoutError):
    """No answer in time."""


class DaemonHung(ConnectionError):
    """The daemon exists, but its loop stood still for hang_s during a request."""


def warn(text: str, category: type[Warning]) -> None:
    """Issues a warning at the innermost line outside this package."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_PACKAGE):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, category, stacklevel=level)
