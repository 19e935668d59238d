"""Job files: parsing and validation."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable, Optional, Union

from .._arguments import to_bool, to_list, to_number_from_0, to_path, to_text, to_word
from .._words import COLUMNS
from ._errors import JobError
from ._keys import Keys, one_or, to_interval, to_length, to_names, to_positive, to_share
from ._sources import Source, read_rows

ANSWERS = {"validity": "any", "least": "min"}  #: the answer per row, and the reduction in queries
_MOTION_COLUMNS = ("time", "first_contact", "steps")
_LEAST_COLUMNS = (
    "lower", "upper", "distance", "status", "flags", "pair", "pair_lower", "point_a", "point_b", "normal", "gradient",
    "gradient_joints",
)  # fmt: skip
_ALLOWED = {
    ("validity", False): ("free", "status", "pair", "lower", "upper"),
    ("validity", True): ("free", "status", "pair", *_MOTION_COLUMNS),
    ("least", False): _LEAST_COLUMNS,
    ("least", True): ("lower", "upper", "distance", "status", "flags", "pair", *_MOTION_COLUMNS),
}
_DEFAULT = {"validity": ["free", "status", "pair"], "least": ["lower", "upper", "status", "pair"]}
_PART_ROWS = {False: 65536, True: 4096}  # configurations, motions


@dataclass(frozen=True)
class Job:
    """A job: everything that determines the bits of its result, and the output folder."""

    file: str  #: its name in errors
    folder: Path  #: base of its relative paths
    said: dict[str, Any]  #: its keys without the output
    scene: Optional[Path]
    robot: Optional[dict[str, Any]]  #: arguments of Scene.load_urdf(), instead of a scene
    joints: Union[str, list[str], None]
    bodies: Optional[list[str]]
    limits: dict[str, tuple[float, float]]
    rows: Source
    answer: str
    columns: tuple[str, ...]
    requested: dict[str, Any]  #: further arguments of the query
    part_rows: int
    positions: bool  #: whether parts contain the positions, too
    check: float  #: the fraction of all rows that is evaluated twice
    output: Optional[Path]

    @classmethod
    def load(cls, path: Union[str, Path]) -> Job:
        """Reads a job file, YAML or (by its suffix) JSON. Raises JobError naming file, key and the allowed values."""
        path = Path(to_path(path, "path"))
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise JobError(f"{path}: the job cannot be read: {getattr(error, 'strerror', None) or error}") from None
        return cls.from_dict(_parsed(text, path), path.parent, str(path))

    @classmethod
    def from_dict(cls, said: Mapping[str, Any], folder: Union[str, Path] = ".", file: str = "job") -> Job:
        """Creates a job from the keys of a job file. Paths are relative to `folder`."""
        keys, folder = Keys(said, file), Path(folder)
        source = keys.one_of("scene", "robot")
        scene = keys.take("scene", _file_in(folder)) if source == "scene" else None
        robot = _robot(keys.map("robot"), folder) if source == "robot" else None
        moving = keys.one_of("joints", "bodies")
        joints = keys.take("joints", _name_or_names) if moving == "joints" else None
        bodies = keys.take("bodies", to_names) if moving == "bodies" else None
        limits = keys.take("limits", _limits, {})
        if limits and joints is None:
            raise JobError(f"{keys.at('limits')}: are only for joints, but this job moves bodies")
        rows = read_rows(keys.map("rows"), folder, bodies is not None)
        answer = keys.take("answer", lambda value, what: _word(value, tuple(ANSWERS), what), "validity")
        job = cls(
            file=file,
            folder=folder,
            said={key: value for key, value in said.items() if key != "output"},
            scene=scene,
            robot=robot,
            joints=joints,
            bodies=bodies,
            limits=limits,
            rows=rows,
            answer=answer,
            columns=keys.take("columns", _columns(answer, rows.motions, joints is not None), tuple(_DEFAULT[answer])),
            requested=_asked(keys, answer, rows.motions),
            part_rows=keys.take("part_rows", to_positive, _PART_ROWS[rows.motions]),
            positions=keys.take("positions", to_bool, False),
            check=keys.take("check", to_share, 0.0),
            output=keys.take("output", lambda value, what: folder / to_path(value, what), None),
        )
        keys.finish()
        return job


def _parsed(text: str, path: Path) -> Any:
    if path.suffix == ".json":
        try:
            return json.loads(text)
        except ValueError as error:
            raise JobError(f"{path}: is not JSON: {error}") from None
    try:
        import yaml
    except ImportError:
        raise JobError(
            f"{path}: a YAML job needs the package PyYAML "
            "(pip install 'WHEEL[sweep]', where WHEEL is the file clearance-*.whl)"
        ) from None
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise JobError(f"{path}: is not YAML: {' '.join(str(error).split())}") from None


def _file_in(folder: Path) -> Callable[[Any, str], Path]:
    def read(value: Any, what: str) -> Path:
        path = folder / to_path(value, what)
        if not path.is_file():
            raise JobError(f"{what}: there is no file {path}")
        return path

    return read


def _robot(keys: Keys, folder: Path) -> dict[str, Any]:
    robot: dict[str, Any] = {"urdf": keys.take("urdf", _file_in(folder))}
    robot["srdf"] = keys.take("srdf", _file_in(folder), None)
    robot["name"] = keys.take("name", one_or(to_text), None)
    packages = keys.take("packages", lambda value, what: Keys(value, what, "", "a map of folders by package"), None)
    if packages is not None:
        robot["packages"] = {
            name: folder / packages.take(name, lambda value, what: to_path(value, what)) for name in packages.names()
        }
    robot["home"] = keys.take("home", lambda value, what: value, None)  # validated by Scene.load_urdf()
    robot["static"] = keys.take("static", to_bool, True)
    keys.finish()
    return {name: value for name, value in robot.items() if value is not None}


def _name_or_names(value: Any, what: str) -> Union[str, list[str]]:
    return value if isinstance(value, str) else to_names(value, what)


def _limits(value: Any, what: str) -> dict[str, tuple[float, float]]:
    if not isinstance(value, Mapping):
        raise TypeError(f"{what}: expected a map of [lower, upper] by joint, got {value!r}")
    return {to_text(joint, what): to_interval(pair, f"{what}.{joint}") for joint, pair in value.items()}


def _columns(answer: str, motions: bool, joints: bool) -> Callable[[Any, str], tuple[str, ...]]:
    allowed = _ALLOWED[answer, motions]
    if not joints:
        allowed = tuple(name for name in allowed if name != "gradient_joints")

    def read(value: Any, what: str) -> tuple[str, ...]:
        names = to_names(value, what)
        for i, name in enumerate(names):
            _word(name, allowed, f"{what}[{i}]")
            if name in names[:i]:
                raise JobError(f"{what}[{i}]: {name!r} is named twice")
        return tuple(names)

    return read


def _word(value: Any, allowed: tuple[str, ...], what: str) -> str:
    return to_word(value, {name: name for name in allowed}, what)


def _asked(keys: Keys, answer: str, motions: bool) -> dict[str, Any]:
    requested: dict[str, Any] = {"pairs": keys.take("pairs", _pairs, None)}
    requested["margin"] = keys.take("margin", _margin, None)
    requested["max_distance"] = keys.take("max_distance", to_number_from_0, None)
    requested["max_evaluations"] = keys.take("max_evaluations", to_positive, None)
    requested["abs_tol"] = keys.take("abs_tol", to_length, None)
    requested["rel_tol"] = keys.take("rel_tol", to_length, None)
    reasons = (
        ("margin", answer != "validity" and not motions, "needs answer: validity, or motions"),
        ("max_distance", answer == "validity", "does not apply to answer: validity, which uses the margin"),
        ("max_evaluations", not motions, "is only for motions, but these rows are configurations"),
    )
    for name, rejected, why in reasons:
        if rejected and requested[name] is not None:
            raise JobError(f"{keys.at(name)}: {why}")
    return {name: value for name, value in requested.items() if value is not None}


def _pairs(value: Any, what: str) -> Any:
    items = to_list(value, what, "two names [a, b], or a list of such pairs")
    if len(items) == 2 and all(isinstance(item, str) for item in items):
        return tuple(items)
    return [tuple(_two(to_names(item, f"{what}[{i}]"), f"{what}[{i}]")) for i, item in enumerate(items)]


def _two(names: list[str], what: str) -> list[str]:
    if len(names) != 2:
        raise ValueError(f"{what}: expected two names of bodies or groups, got {len(names)}")
    return names


def _margin(value: Any, what: str) -> Any:
    if not isinstance(value, list):
        return to_length(value, what)
    margins = {}
    for i, entry in enumerate(value):
        at = f"{what}[{i}]"
        items = to_list(entry, at, "[a, b, metres]")
        if len(items) != 3:
            raise ValueError(f"{at}: expected [a, b, metres], got {entry!r}")
        a, b = _two(to_names(items[:2], at), at)
        margins[a, b] = to_length(items[2], f"{at}[2]")
    return margins


def columns_of(name: str, shape: tuple[int, ...]) -> list[str]:
    """Returns the names of the flat columns of a column with shaped rows, such as pair_a and pair_b for pair."""
    if not shape:
        return [name]
    if name.startswith("pair"):
        ends = ["a", "b"]
    elif name == "first_contact":
        ends = ["free_until", "hit_at"]
    elif shape == (3,):
        ends = ["x", "y", "z"]
    elif name == "gradient":
        ends = [f"{body}_{turn}{axis}" for body in "ab" for turn in ("r", "") for axis in "xyz"]
    else:
        ends = [str(i) for i in range(math.prod(shape))]
    return [f"{name}_{end}" for end in ends]


assert all(name in COLUMNS or name == "free" for names in _ALLOWED.values() for name in names)
