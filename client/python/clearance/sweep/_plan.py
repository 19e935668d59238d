"""Preparation of a job: packs the scene, counts the rows, and evaluates one row to find errors early."""

from __future__ import annotations

import hashlib
import json
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Optional

import numpy as np

from .. import __version__
from .._errors import QueryError
from .._front.engine import Engine
from .._scene.scene import Scene
from ._errors import JobError
from ._generators import Rows
from ._job import ANSWERS, Job
from ._scenes import Packed, pack, unpack
from ._sources import Space
from ._work import Spec, answer


@dataclass(frozen=True)
class Plan:
    """Input of a run."""

    spec: Spec  #: input of every worker
    packed: Packed  #: the scene
    header: dict[str, Any]  #: identity of the result; a run resumes only one with the same header
    names: dict[str, Any]  #: names of bodies and joints, to which answers refer by index

    @property
    def output(self) -> Path:
        return self.spec.folder.parent

    @property
    def rows(self) -> int:
        return self.spec.rows.count

    @property
    def parts(self) -> int:
        return -(-self.rows // self.spec.part_rows)


def prepare(job: Job, output: Optional[Path] = None, backend: str = "cpu", threads: int = 1) -> Plan:
    """Loads the scene, creates the generator, and evaluates the first row. Raises JobError naming file and key."""
    output = output or job.output
    if output is None:
        raise JobError(f"{job.file}: output: is required: the folder for the result")
    _needs_pyarrow(job)
    if output.exists() and not output.is_dir():
        raise JobError(f"{job.file}: output: {output} is not a folder")
    parts = output / "parts"
    parts.mkdir(parents=True, exist_ok=True)
    packed = pack(_scene(job))
    engine = Engine(unpack(packed), backend="cpu", threads=1, covers="off")
    for body in engine.bodies:
        if body.max_speed > 0:
            raise JobError(
                f"{job.file}: scene: {body.name!r} has max_speed: its bounds grow while poses age, "
                "so the same row would not get the same bits"
            )
    space = _space(job, engine)
    rows = job.rows.rows(space, output)
    spec = _spec(job, rows, space, parts)
    try:
        answer(engine, spec, np.arange(1))
    except (TypeError, ValueError, QueryError) as error:
        raise JobError(f"{job.file}: {error}") from None
    header = {
        "format": 1,
        "job": job.said,
        "scene": packed.digest,
        "rows": rows.count,
        "content": hashlib.sha256(json.dumps(rows.identity(), sort_keys=True).encode()).hexdigest(),
        "made_with": _versions(),
    }
    spec = replace(spec, backend=backend, threads=threads)
    names = {"joints" if job.joints is not None else "moving": list(space.names)}
    names["bodies"] = [body.name for body in engine.bodies]
    return Plan(spec, packed, header, names)


def _spec(job: Job, rows: Rows, space: Space, parts: Path) -> Spec:
    requested = {"reduce": ANSWERS[job.answer], **job.requested}
    requested["joints" if job.joints is not None else "bodies"] = list(space.names)
    return Spec(rows, requested, job.columns, job.positions, job.part_rows, job.check, parts)


def _needs_pyarrow(job: Job) -> None:
    try:
        import pyarrow.parquet  # noqa: F401
    except ImportError:
        raise JobError(
            f"{job.file}: parts are written by the package pyarrow "
            "(pip install 'WHEEL[sweep]', where WHEEL is the file clearance-*.whl)"
        ) from None


def _scene(job: Job) -> Scene:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of hulls and robots, which were shown when the scene was loaded
        try:
            return Scene.load_urdf(**job.robot) if job.robot is not None else Scene.load(str(job.scene))
        except (TypeError, ValueError) as error:
            key = "robot" if job.robot is not None else "scene"
            raise JobError(f"{job.file}: {key}: {error}") from None


def _space(job: Job, engine: Engine) -> Space:
    try:
        if job.bodies is not None:
            for body in job.bodies:
                engine.body_id(body)
            return Space(tuple(job.bodies), 7 * len(job.bodies), None, None)
        assert job.joints is not None
        joints = engine.joints(job.joints)
    except (TypeError, ValueError) as error:
        key = "bodies" if job.bodies is not None else "joints"
        raise JobError(f"{job.file}: {key}: {error}") from None
    lower, upper = joints.lower.copy(), joints.upper.copy()
    for name, (low, high) in job.limits.items():
        if name not in joints.names:
            there = ", ".join(joints.names)
            raise JobError(f"{job.file}: limits.{name}: is not a joint of this job; there are {there}")
        place = joints.names.index(name)
        lower[place], upper[place] = low, high
    return Space(joints.names, len(joints), lower, upper)


def _versions() -> dict[str, str]:
    import pyarrow

    return {"clearance": __version__, "pyarrow": pyarrow.__version__}
