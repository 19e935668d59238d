"""A time limit for each test: a test that hangs ends the run, after the stacks of all threads have been printed."""

from __future__ import annotations

import faulthandler
import os

import pytest

from patience import PATIENCE_S

#: Far longer than any test needs on a busy machine, and than any test waits for a condition.
LIMIT_S = 3 * PATIENCE_S

_stderr = 2


def pytest_configure(config: pytest.Config) -> None:
    global _stderr
    config.addinivalue_line("markers", "limit_s(seconds): another limit than limits.LIMIT_S")
    with config.pluginmanager.getplugin("capturemanager").global_and_fixture_disabled():
        _stderr = os.dup(2)  # during a test, pytest redirects it to a file


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item: pytest.Item):
    marker = item.get_closest_marker("limit_s")
    faulthandler.dump_traceback_later(marker.args[0] if marker else LIMIT_S, exit=True, file=_stderr)
    yield
    faulthandler.cancel_dump_traceback_later()
