"""Exceptions of sweeps."""

from __future__ import annotations

from .._errors import ClearanceError


class JobError(ClearanceError, ValueError):
    """An invalid job. The text names file, key and the allowed values."""


class SweepError(ClearanceError, RuntimeError):
    """A run that cannot continue. Written parts are kept, and the job can resume from them."""
