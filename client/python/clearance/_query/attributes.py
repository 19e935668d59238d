"""Attributes of results that are read on access."""

from __future__ import annotations

from typing import Any, Optional


class ColumnAttribute:
    """A column, converted to an array on first access and cached."""

    def __init__(self, doc: str):
        self.__doc__ = doc

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, result: Any, owner: Optional[type] = None) -> Any:
        if result is None:
            return self
        array = result.__dict__[self.name] = result._column(self.name)
        return array


class AnswerAttribute:
    """A number of the answer, read on access, since most callers use only a few of them."""

    def __init__(self, doc: str):
        self.__doc__ = doc

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, result: Any, owner: Optional[type] = None) -> Any:
        return self if result is None else getattr(result._answer, self.name)
