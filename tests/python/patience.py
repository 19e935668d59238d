"""How long tests wait for a condition: an upper limit for failures, not a measurement, because machines are busy."""

from __future__ import annotations

import time
from collections.abc import Callable

PATIENCE_S = 300


def wait_until(condition: Callable[..., bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)
