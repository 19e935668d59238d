"""The drawing loop, with a limited rate, and only while a browser is connected."""

from __future__ import annotations

import contextlib
import html
import io
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, wait
from typing import Any, Optional, TypeVar

import numpy as np
import viser

from .._errors import ClearanceError
from .edge import Edge
from .model import Picture
from .page import Page
from .panel import Panel
from .path import ProvedPath
from .session import Session, reason

_RETRY_S = 1.0
_T = TypeVar("_T")


class Viewer:
    """A page of a session, on an address of this machine.

    rate_hz: maximum number of pictures per second.
    """

    def __init__(self, session: Session, host: str = "127.0.0.1", port: int = 8080, rate_hz: float = 10.0):
        self._session = session
        self._period = 1.0 / rate_hz
        with contextlib.redirect_stdout(io.StringIO()):  # viser prints a box of its own
            self._server = viser.ViserServer(host=host, port=port, label="Clearance", verbose=False)
        self._stopping = threading.Event()
        self._on_page(self._make)
        self._generation = -1
        self.pictures = 0  #: number drawn so far
        self.url = f"http://{'localhost' if host in ('127.0.0.1', '::1') else host}:{self._server.get_port()}"

    def _make(self) -> None:
        self._server.gui.configure_theme(show_logo=False, show_share_button=False)
        self._server.gui.main_panel.dock_right()
        self._server.gui.main_panel.set_width(460)
        self._page = Page(self._server)
        self._panel = Panel(self._server, self._session)

    def _on_page(self, write: Callable[..., _T], *arguments: Any) -> Optional[_T]:
        """Runs a function that writes to the page in viser's own loop. Returns None after the page has ended.

        viser wakes its loop with an asyncio.Event, which is not thread-safe and occasionally ended this thread.
        """
        done: Future[_T] = Future()

        def call() -> None:
            try:
                done.set_result(write(*arguments))
            except Exception as error:
                done.set_exception(error)

        try:
            self._server.get_event_loop().call_soon_threadsafe(call)
        except RuntimeError:  # the loop is closed
            if not self._stopping.is_set():
                raise
        while not self._stopping.is_set():
            if wait([done], timeout=0.1).done:
                return done.result()
        return None

    def run(self) -> None:
        """Draws until stop()."""
        due = time.monotonic()
        while not self._stopping.wait(max(0.0, due - time.monotonic())):
            due = max(due + self._period, time.monotonic())
            if not self._server.get_clients():
                continue
            try:
                self._turn()
            except (ClearanceError, OSError, ValueError) as error:  # for example names of a replaced scene
                self._on_page(self._panel.say, html.escape(reason(error)))
                due = time.monotonic() + _RETRY_S

    def stop(self) -> None:
        """Ends run() and the page. Thread-safe."""
        self._stopping.set()
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def _turn(self) -> None:
        elsewhere = self._panel.elsewhere()
        if self._panel.cover_level is not None:
            self._session.make_cover()
        picture = self._session.picture(self._panel.question, elsewhere)
        positions = None if self._session.joints is None else self._session.positions()
        if self._panel.is_along:
            positions = elsewhere
        self._on_page(self._draw, picture, positions, self._notice(elsewhere))
        if self._panel.edge_asked:
            self._panel.edge_asked = False
            self._prove(picture)
        if self._panel.path_asked:
            self._panel.path_asked = False
            self._prove_path()
        self.pictures += 1

    def _draw(self, picture: Picture, positions: Optional[np.ndarray], notice: str) -> None:
        if self._session.generation != self._generation:
            self._rebuild(picture)
        if self._panel.look_changed:
            self._panel.look_changed = False
            self._page.show(self._panel.look)
            self._page.label(self._panel.labels)
        self._page.cover(self._session.covers, self._panel.cover_level)
        self._page.draw(picture, self._panel.segments)
        self._panel.show(picture)
        if positions is not None:
            self._panel.follow(positions)
        self._panel.say(notice)

    def _rebuild(self, picture: Picture) -> None:
        self._generation = self._session.generation
        is_static = [body.is_static for body in self._session.front.bodies]
        self._page.rebuild(picture, self._session.shapes, is_static, self._session.known)
        self._page.draw_edge(None, None)
        self._page.draw_path(None, None)
        self._panel.path_asked = self._session.path is not None
        self._panel.rebuild()
        self._panel.look_changed = True

    def _notice(self, elsewhere: Optional[np.ndarray]) -> str:
        if elsewhere is not None and self._session.asks_only:
            return "What would be: joints are where the sliders are, and not where the daemon has them."
        if self._panel.cover_level is not None and self._session.uncovered:
            return f"Covers of {len(self._session.uncovered)} bodies are still to be made, one a picture."
        return self._session.warning

    def _prove(self, picture: Picture) -> None:
        start, end = self._panel.ends
        if start is None or end is None:
            self._on_page(self._panel.say_of_edge, "Take positions as start and as end first.")
            return
        try:
            edge = self._session.edge(start, end, self._panel.margin, self._panel.spans)
        except (ClearanceError, ValueError) as error:
            self._on_page(self._panel.say_of_edge, html.escape(reason(error)))
            return
        self._on_page(self._show_edge, edge, self._session.trace(edge), picture)

    def _prove_path(self) -> None:
        try:
            proved = self._session.proved_path(self._panel.path_margin)
        except (ClearanceError, ValueError) as error:
            self._on_page(self._panel.say_of_path, html.escape(reason(error)))
            return
        self._on_page(self._show_path, proved, self._session.ways(proved))

    def _show_path(self, proved: ProvedPath, ways: Any) -> None:
        self._page.draw_path(proved, ways)
        self._panel.show_path(proved)

    def _show_edge(self, edge: Edge, trace: Any, picture: Picture) -> None:
        self._page.draw_edge(edge, trace)
        self._panel.show_edge(edge, picture.names)
