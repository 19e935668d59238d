"""Clearance: how far apart are these bodies, and where?

    scene = clearance.Scene.load("scene.yaml")
    engine = clearance.Engine(scene)                        # in this process
    client = clearance.connect("shm:///run/user/1000/clearance.sock")   # or through the daemon: the same methods

    client.set_poses({"gripper": [0.4, 0, 0.3, 1, 0, 0, 0]})
    r = client.distances(pairs=("gripper", "*"), max_distance=0.5)
    r.distance, r.lower, r.upper, r.status                  # numpy, (K, P)

Metres, radians, nanoseconds; right-handed frames; a pose is [x, y, z, qw, qx, qy, qz].
"""

from __future__ import annotations

import importlib
import importlib.util
from typing import TYPE_CHECKING, Any

from . import wire
from ._errors import (
    ClearanceError,
    ConnectionError,
    DaemonHung,
    JointLimitWarning,
    MeshWarning,
    NewEpoch,
    PoseWarning,
    QueryError,
    RequestError,
    RobotWarning,
    SceneError,
    StaleQuery,
    TimeoutError,
)
from ._front.front import BodyState
from ._front.scene_changes import SceneChanged
from ._front.updates import UpdateResult
from ._joints import Joints, JointState
from ._names import BodyInfo
from ._poses import pose7_from_matrix
from ._query.certificate import Certificate
from ._query.check import Check
from ._query.future import Future
from ._query.limits import LimitViolation
from ._query.meanwhile import BodyPath
from ._query.path import PathCheck
from ._query.path_report import PathPoint, PathReport
from ._query.plan import PathPlan
from ._query.prepared import Prepared
from ._query.result import Result
from ._query.stop import StopCheck
from ._query.stop_terms import Separation
from ._query.trajectory import Trajectory
from ._version import __version__
from ._words import EVERY_BODY, NONE, Field, Flag, Precision, Reduce, Status

if TYPE_CHECKING:
    from ._adapters.mujoco import MujocoWorld, from_mujoco
    from ._adapters.pinocchio import PinocchioWorld, from_pinocchio
    from ._coal import from_coal
    from ._device.plan import DeviceArray, DevicePlan, DeviceRows
    from ._device.remote_plan import RemotePlan
    from ._front.client import Client, connect
    from ._front.engine import Engine
    from ._scene.scene import Scene

__all__ = [
    "BodyInfo",
    "BodyState",
    "Certificate",
    "ClearanceError",
    "Client",
    "ConnectionError",
    "DaemonHung",
    "DeviceArray",
    "DevicePlan",
    "DeviceRows",
    "EVERY_BODY",
    "Engine",
    "Field",
    "Flag",
    "Future",
    "MeshWarning",
    "JointLimitWarning",
    "JointState",
    "Joints",
    "LimitViolation",
    "MujocoWorld",
    "NONE",
    "NewEpoch",
    "PoseWarning",
    "UpdateResult",
    "Precision",
    "PathCheck",
    "PathPlan",
    "PathPoint",
    "PathReport",
    "PinocchioWorld",
    "Prepared",
    "QueryError",
    "Reduce",
    "RemotePlan",
    "RequestError",
    "Check",
    "Result",
    "RobotWarning",
    "Scene",
    "SceneChanged",
    "SceneError",
    "Separation",
    "StaleQuery",
    "Status",
    "StopCheck",
    "TimeoutError",
    "BodyPath",
    "Trajectory",
    "__version__",
    "connect",
    "from_coal",
    "from_mujoco",
    "from_pinocchio",
    "pose7_from_matrix",
    "wire",
]

# Loaded when first used: a client of the daemon then pulls neither the engine nor its mesh and hull libraries into the
# process, and a client-only install has no engine at all.
_LAZY = {
    "Client": "._front.client",
    "connect": "._front.client",
    "MujocoWorld": "._adapters.mujoco",
    "from_coal": "._coal",
    "from_mujoco": "._adapters.mujoco",
    "from_pinocchio": "._adapters.pinocchio",
    "DeviceArray": "._device.plan",
    "DevicePlan": "._device.plan",
    "DeviceRows": "._device.plan",
    "Engine": "._front.engine",
    "PinocchioWorld": "._adapters.pinocchio",
    "RemotePlan": "._device.remote_plan",
    "Scene": "._scene.scene",
}
_NEED_ENGINE = (
    "DeviceArray",
    "DevicePlan",
    "DeviceRows",
    "Engine",
    "MujocoWorld",
    "PinocchioWorld",
    "Scene",
    "from_mujoco",
    "from_pinocchio",
)

# `from clearance import *` takes what there is.
_has_engine = importlib.util.find_spec(f"{__name__}._engine") is not None
if not _has_engine:
    __all__[:] = [name for name in __all__ if name not in _NEED_ENGINE]


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module 'clearance' has no attribute {name!r}")
    if name in _NEED_ENGINE and not _has_engine:
        raise ImportError(
            f"{__name__}.{name} is not there: this is a client-only install; install the whole package "
            "(clearance, without CLEARANCE_CLIENT_ONLY) for the engine in this process"
        )
    value = getattr(importlib.import_module(_LAZY[name], __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
