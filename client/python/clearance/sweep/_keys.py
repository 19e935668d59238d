"""Reader of the keys of a job file, with errors that name the file, the path of the key and the allowed values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Callable, Optional, TypeVar

from .._arguments import did_you_mean, to_count, to_list, to_number, to_text
from ._errors import JobError

_T = TypeVar("_T")
_NEEDED: Any = object()


class Keys:
    """A map whose keys are each taken once. `finish()` rejects the remaining ones."""

    def __init__(self, value: Any, file: str, path: str = "", expected: str = "a map"):
        self.file = file
        self._path = path
        if not isinstance(value, Mapping):
            raise JobError(f"{file}: {path + ': ' if path else ''}expected {expected}, got {value!r}")
        self._given = dict(value)
        self._known: list[str] = []

    def at(self, name: str) -> str:
        """Returns a key's path, for errors."""
        return f"{self.file}: {self._path + '.' if self._path else ''}{name}"

    def has(self, name: str) -> bool:
        return name in self._given

    def names(self) -> list[str]:
        return list(self._given)

    def take(self, name: str, read: Callable[[Any, str], _T], default: Any = _NEEDED) -> _T:
        """Returns `read(value, path)` for the value of a key, or `default` without the key."""
        self._known.append(name)
        if name not in self._given:
            if default is _NEEDED:
                raise JobError(f"{self.at(name)}: is required")
            return default
        try:
            return read(self._given[name], self.at(name))
        except JobError:
            raise
        except (TypeError, ValueError) as error:
            raise JobError(str(error)) from None

    def one_of(self, *names: str, only: bool = False) -> str:
        """Returns the one of these keys in the map. only: whether the map must have no others."""
        self._known += names
        given = [name for name in names if name in self._given]
        if len(given) != 1:
            where = self._path or "the job"
            if only:
                self.finish()
            raise JobError(
                f"{self.file}: {where}: expected one of {', '.join(names)}, got {' and '.join(given) or 'none of them'}"
            )
        return given[0]

    def map(self, name: str, expected: str = "a map") -> Keys:
        """Returns the map under a key."""
        way = f"{self._path}.{name}" if self._path else name
        return self.take(name, lambda value, _: Keys(value, self.file, way, expected))

    def finish(self) -> None:
        for name in self._given:
            if name not in self._known:
                raise self._stranger(name)

    def _stranger(self, name: Any) -> JobError:
        near = did_you_mean(name, self._known)
        return JobError(f"{self.at(str(name))}: there is no such key{near or '; there are ' + ', '.join(self._known)}")


def to_positive(value: Any, what: str) -> int:
    count = to_count(value, what)
    if count < 1:
        raise ValueError(f"{what}: expected an integer >= 1, got {count}")
    return count


def to_share(value: Any, what: str) -> float:
    share = to_number(value, what)
    if not 0 <= share <= 1:
        raise ValueError(f"{what}: expected a number from 0 to 1, got {value}")
    return share


def to_length(value: Any, what: str) -> float:
    number = to_number(value, what)
    if not 0 <= number < float("inf"):
        raise ValueError(f"{what}: expected a finite number >= 0, got {value}")
    return number


def to_interval(value: Any, what: str) -> tuple[float, float]:
    items = to_list(value, what, "two finite numbers [lower, upper]")
    if len(items) != 2:
        raise ValueError(f"{what}: expected two finite numbers [lower, upper], got {value!r}")
    lower, upper = (to_number(item, f"{what}[{i}]") for i, item in enumerate(items))
    if not -1e6 <= lower <= upper <= 1e6:
        raise ValueError(f"{what}: expected two finite numbers, lower <= upper, within 1e6, got {value!r}")
    return lower, upper


def to_names(value: Any, what: str) -> list[str]:
    items = to_list(value, what, "a list of names")
    if not items:
        raise ValueError(f"{what}: expected at least one name, got none")
    return [to_text(item, f"{what}[{i}]") for i, item in enumerate(items)]


def one_or(read: Callable[[Any, str], _T]) -> Callable[[Any, str], Optional[_T]]:
    """Returns a reader that also accepts null."""
    return lambda value, what: None if value is None else read(value, what)
