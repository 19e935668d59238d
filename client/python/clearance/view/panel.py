"""The control panel: query, pairs, joints, an edge, and the daemon's state."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, field
from typing import Any, Optional

import numpy as np
import viser

from .covers import LEVELS
from .edge import Edge
from .model import Picture, ViewQuery, slider_range
from .path import ProvedPath
from .plots import Series, plot
from .session import Session
from .shapes import LOOKS
from .tables import BLUE, FREE, HIT, edge_table, pairs_table, paragraph, path_table, service_table

_HISTORY_S = 30.0
_MOST_SPANS = 64
_PLOTS_S = 0.5  # interval between plots of the daemon's state


@dataclass
class History:
    """Data of the plots, one entry per answer."""

    rows: deque[tuple[float, float, float, float]] = field(default_factory=deque)

    def add(self, now: float, picture: Picture) -> None:
        self.rows.append((now, 1e3 * picture.took_s, 1e3 * picture.engine_s, 1e3 * picture.pose_age_s))
        while now - self.rows[0][0] > _HISTORY_S:
            self.rows.popleft()

    def columns(self, now: float) -> tuple[np.ndarray, ...]:
        """Returns times relative to now in seconds; answer time, engine time and age of the oldest pose in ms."""
        times, took, engine, age = np.array(self.rows or [(now, np.nan, np.nan, np.nan)]).T
        return times - now, took, engine, age


class Panel:
    """Controls, tables and plots. Callbacks only record requests, which the drawing loop executes."""

    def __init__(self, server: viser.ViserServer, session: Session):
        self._server = server
        self._session = session
        self.history = History()
        self._plotted = -_PLOTS_S
        self.look_changed = True
        self.edge_asked = False
        self.path_asked = session.path is not None
        self._along: Optional[float] = None  # seconds: time of the path at which the user has put the joints
        self._nearest: Optional[float] = None  # seconds: time of the path's least clearance
        self.ends: list[Optional[np.ndarray]] = [None, None]
        self._moved = False
        self._sliders: list[Any] = []
        self._shown: dict[int, Any] = {}
        server.gui.set_panel_label("Clearance")
        self._message = server.gui.add_html("")
        tabs = server.gui.add_tab_group()
        with tabs.add_tab("Pairs"):
            self._make_question()
        with tabs.add_tab("Joints"):
            self._joints_folder = server.gui.add_folder("Positions")
            with server.gui.add_folder("Certified edge"):
                self._make_edge()
        if session.path is not None:
            with tabs.add_tab("Path"):
                self._make_path(session.path.times)
        with tabs.add_tab("Service"):
            self._make_service()
        with tabs.add_tab("Look"):
            self._make_look()

    # ---- controls -------------------------------------------------------------------------------------------------

    def _make_question(self) -> None:
        gui = self._server.gui
        self._kind = gui.add_dropdown("query", ("pairs within", "each body's nearest"), hint="options of the query")
        self._distance = gui.add_number("within [m]", ViewQuery.max_distance, min=0.0, max=100.0, step=0.01)
        self._pairs = gui.add_html("")

    def _make_edge(self) -> None:
        gui = self._server.gui
        self._margin = gui.add_number("margin [m]", 0.01, min=0.0, max=10.0, step=0.005)
        self._spans = gui.add_slider("spans", 1, _MOST_SPANS, 1, 16)
        ends = gui.add_button_group("take positions", ("as start", "as end"))
        ask = gui.add_button("Prove the edge", hint="nothing is sampled: each span is proved, or is not")
        self._edge_plot = gui.add_html("")
        self._edge = gui.add_html(paragraph("Take positions of the sliders as start, others as end."))

        ends.on_click(self._on_end)
        ask.on_click(self._on_ask)

    async def _on_end(self, event: Any) -> None:  # async, so that viser calls it in its own loop, where it can write
        self.ends[event.target.value != "as start"] = self.positions()
        have = [name for name, end in zip(("start", "end"), self.ends) if end is not None]
        self.say_of_edge(f"Taken: {' and '.join(have)}.")

    def _on_ask(self, event: Any) -> None:
        self.edge_asked = True

    def _make_path(self, times: np.ndarray) -> None:
        gui = self._server.gui
        first, last = float(times[0]), float(times[-1])
        self._time = gui.add_slider("time [s]", first, last, (last - first) / 1000, first)
        self._path_margin = gui.add_number("margin [m]", 0.01, min=0.0, max=10.0, step=0.005)
        ask = gui.add_button("Prove the path", hint="nothing is sampled: each motion is proved, or is not")
        nearest = gui.add_button("Go to the least clearance", hint="where the path is nearest or deepest")
        self._path = gui.add_html("")
        self._time.on_update(self._on_time)
        ask.on_click(self._on_ask_path)
        nearest.on_click(self._on_nearest)

    def _on_time(self, event: Any) -> None:
        if event.client is not None:
            self._along, self._moved = float(self._time.value), True

    def _on_ask_path(self, event: Any) -> None:
        self.path_asked = True

    async def _on_nearest(self, event: Any) -> None:
        if self._nearest is not None:
            self._along, self._moved = self._nearest, True
            self._time.value = self._nearest

    def _make_service(self) -> None:
        gui = self._server.gui
        self._service = gui.add_html("")
        self._latency = gui.add_html("")
        self._age = gui.add_html("")

    def _make_look(self) -> None:
        gui = self._server.gui
        self._look = gui.add_dropdown("bodies as", LOOKS, hint="mesh: as given; pieces: what bounds are about")
        self._labels = gui.add_checkbox("names", False)
        self._segments = gui.add_checkbox("segments", True)
        self._covers = gui.add_checkbox("covers", False, hint="balls that bound distances")
        self._level = gui.add_slider("level of covers", 0, LEVELS - 1, 1, LEVELS - 2)
        for control in (self._look, self._labels, self._segments, self._covers, self._level):
            control.on_update(self._on_look)

    def _on_look(self, event: Any) -> None:
        self.look_changed = True

    def rebuild(self) -> None:
        """Creates a slider for each current joint."""
        for slider in self._sliders:
            slider.remove()
        self._sliders, self._moved, self.ends, self._along = [], False, [None, None], None
        joints = self._session.joints
        with self._joints_folder:
            if joints is None:
                self._sliders = [self._server.gui.add_html(paragraph("The scene has no robot."))]
                return
            low, high = slider_range(joints)
            now = np.clip(self._session.positions(), low, high)
            for name, a, b, q in zip(joints.names, low.tolist(), high.tolist(), now.tolist()):
                slider = self._server.gui.add_slider(name, a, b, max((b - a) / 1e4, 1e-9), q)
                slider.on_update(self._on_slider)
                self._sliders.append(slider)
            if self._session.asks_only:
                hint = "sliders query other poses: nothing is sent to the daemon"
                back = self._server.gui.add_button("Follow the daemon again", hint=hint)
                back.on_click(self._on_follow)
                self._sliders.append(back)

    def _on_slider(self, event: Any) -> None:
        if event.client is not None:  # a change by the user, not by follow()
            self._moved, self._along = True, None

    def _on_follow(self, event: Any) -> None:
        self._moved, self._along = False, None

    # ---- requests -------------------------------------------------------------------------------------------------

    @property
    def question(self) -> ViewQuery:
        kind = "within" if self._kind.value == "pairs within" else "nearest"
        return ViewQuery(kind, float(self._distance.value))  # type: ignore[arg-type]

    @property
    def look(self) -> str:
        return str(self._look.value)

    @property
    def labels(self) -> bool:
        return bool(self._labels.value)

    @property
    def segments(self) -> bool:
        return bool(self._segments.value)

    @property
    def cover_level(self) -> Optional[int]:
        """The level of covers to show, or None."""
        return int(self._level.value) if self._covers.value else None

    @property
    def margin(self) -> float:
        return float(self._margin.value)

    @property
    def spans(self) -> int:
        return int(self._spans.value)

    def positions(self) -> np.ndarray:
        """(J,) positions of the sliders."""
        count = 0 if self._session.joints is None else len(self._session.joints)
        return np.array([slider.value for slider in self._sliders[:count]], dtype=np.float64)

    def elsewhere(self) -> Optional[np.ndarray]:
        """(J,) positions if the user has moved the sliders, or along the path, otherwise None."""
        if self._along is not None:
            return self._session.along(self._along)
        return self.positions() if self._moved else None

    @property
    def is_along(self) -> bool:
        """Whether elsewhere() is a state of the path."""
        return self._along is not None

    @property
    def path_margin(self) -> float:
        return float(self._path_margin.value)

    # ---- display --------------------------------------------------------------------------------------------------

    def say(self, text: str) -> None:
        """Shows a line at the top, or removes it if empty."""
        self._set(self._message, paragraph(text, HIT) if text else "")

    def follow(self, positions: np.ndarray) -> None:
        """Moves the sliders to the joints' positions, unless the user has moved them."""
        if not self._moved or self.is_along:
            for slider, position in zip(self._sliders, positions.tolist()):
                if abs(slider.value - position) > 1e-9:
                    slider.value = min(max(position, slider.min), slider.max)

    def show(self, picture: Picture) -> None:
        """Shows the numbers of an answer."""
        now = time.monotonic()
        self.history.add(now, picture)
        self._set(self._pairs, pairs_table(picture))
        self._set(self._service, service_table(picture, self._session.source))
        if now - self._plotted >= _PLOTS_S:
            self._plotted = now
            self._plot(now)

    def _plot(self, now: float) -> None:
        times, took, engine, age = self.history.columns(now)
        span = (-_HISTORY_S, 0.0)
        latency = [Series("answer", BLUE, took), Series("engine", FREE, engine)]
        self._set(self._latency, plot("Latency [ms]", times, latency, span, " s"))
        self._set(self._age, plot("Age of the oldest pose [ms]", times, [Series("age", HIT, age)], span, " s"))

    def show_edge(self, edge: Edge, names: tuple[str, ...]) -> None:
        """Shows the spans of an edge, and a plot of their bounds."""
        self._set(self._edge, edge_table(edge, names))
        times = np.repeat([edge.spans[0].begin, *(span.end for span in edge.spans)], 2)[1:-1]
        lower, upper = (
            np.maximum(0.0, np.repeat([getattr(span, name) for span in edge.spans], 2)) for name in ("lower", "upper")
        )
        margin = np.full(len(times), edge.margin)
        series = [Series("lower", BLUE, lower), Series("upper", FREE, upper), Series("margin", HIT, margin)]
        self._set(self._edge_plot, plot("Bounds along the edge [m]", times, series, (0.0, 1.0), ""))

    def show_path(self, proved: ProvedPath) -> None:
        """Shows the motions of a path, and where it is closest."""
        nearest = proved.report.nearest
        self._nearest = None if nearest is None else proved.time_of(nearest.index, nearest.t)
        self._set(self._path, path_table(proved))

    def say_of_path(self, text: str) -> None:
        self._set(self._path, paragraph(text))

    def say_of_edge(self, text: str) -> None:
        self._set(self._edge_plot, "")
        self._set(self._edge, paragraph(text))

    def _set(self, handle: Any, content: str) -> None:
        """Writes HTML if it has changed."""
        if self._shown.get(id(handle)) != content:
            self._shown[id(handle)] = content
            handle.content = content
