"""What callers pass, as numbers and words, or TypeError and ValueError that name the argument."""

from __future__ import annotations

import math
from typing import Any, Dict


def to_number(value: Any, what: str) -> float:
    try:
        if isinstance(value, (str, bytes, bool)):
            raise TypeError
        number = float(value)
    except TypeError:
        raise TypeError(f"{what}: expected a number, got {value!r}") from None
    if math.isnan(number):
        raise ValueError(f"{what}: expected a number, got nan")
    return number


def to_tolerance(value: Any) -> float:
    number = to_number(value, "rel_tol")
    if number < 0:
        raise ValueError(f"rel_tol: expected a number >= 0 or None, got {number}")
    return number


def to_integer(value: Any, what: str) -> int:
    try:
        if isinstance(value, bool):
            raise TypeError
        return value.__index__()
    except (TypeError, AttributeError):
        raise TypeError(f"{what}: expected an integer, got {value!r}") from None


def to_count(value: Any, what: str) -> int:
    number = to_integer(value, what)
    if not 0 <= number < 1 << 63:
        raise ValueError(f"{what}: expected an integer >= 0, got {number}")
    return number


def to_word(value: Any, words: Dict[str, int], what: str) -> int:
    word = words.get(value) if isinstance(value, str) else None
    if word is None:
        raise ValueError(f"{what}: expected {' or '.join(map(repr, words))}, got {value!r}")
    return word
