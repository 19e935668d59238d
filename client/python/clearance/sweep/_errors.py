"""What a sweep raises."""

from __future__ import annotations

from .._errors import ClearanceError


class JobError(ClearanceError, ValueError):
    """A job that cannot be done as it stands. The text names file, key, and what is allowed there."""


class SweepError(ClearanceError, RuntimeError):
    """A run that cannot go on. What it has written stays; the same job goes on from there."""
