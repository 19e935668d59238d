"""The drawing with viser: bodies, segments, an edge, a path."""

from __future__ import annotations

import colorsys
from collections.abc import Mapping, Sequence
from typing import Any, Optional

import numpy as np
import viser

from .._query.path_report import PathReport
from .camera import camera_at_first
from .covers import Balls, DrawnBalls
from .edge import Edge, Verdict
from .model import Picture
from .path import ProvedPath
from .shapes import Shape
from .tables import BLUE, COLOURS, HIT

_STATIC, _UNKNOWN = (150, 156, 166), (196, 200, 206)


def colour_of(name: str, is_static: bool) -> tuple[int, int, int]:
    """Returns a muted colour that depends on the name only; red and blue have a meaning."""
    if is_static:
        return _STATIC
    hue = 0.10 + 0.42 * (sum(name.encode()) * 0.61803398875 % 1.0)
    r, g, b = colorsys.hls_to_rgb(hue, 0.62, 0.38)
    return int(255 * r), int(255 * g), int(255 * b)


class Drawn:
    """One body on the page: a moving frame with child nodes, which are created when first shown."""

    def __init__(self, scene: viser.SceneApi, body: int, name: str, is_static: bool, known: bool, shape: Shape):
        self._scene, self._path, self._name, self._shape = scene, f"/bodies/{body}", name, shape
        self._colour = np.array(colour_of(name, is_static) if known else _UNKNOWN)
        self._opacity = None if known else 0.25
        self._frame = scene.add_frame(self._path, show_axes=False, visible=False)
        self._looks: dict[str, list[tuple[Any, np.ndarray]]] = {}  # handles with their colours
        self._label: Any = None
        self._balls = DrawnBalls(scene, f"{self._path}/cover")
        self._pose: Optional[bytes] = None
        self._red = False

    def _make(self, look: str) -> list[tuple[Any, np.ndarray]]:
        path = f"{self._path}/{look}"
        if look == "points" and len(self._shape.points):
            points = self._shape.points.astype(np.float32)
            options: dict[str, Any] = {"point_size": 0.006, "point_shape": "circle", "precision": "float32"}
            return [(self._scene.add_point_cloud(path, points, self._colour.astype(np.uint8), **options), self._colour)]
        made = []
        for i, mesh in enumerate(self._shape.look(look)):
            colour = np.minimum(255, self._colour + (22 * (i % 3) if look == "pieces" else 0)).astype(np.uint8)
            handle = self._scene.add_mesh_simple(
                f"{path}/{i}", mesh.vertices.astype(np.float32), mesh.triangles,
                color=colour, flat_shading=True, side="double", opacity=self._opacity,
            )  # fmt: skip
            made.append((handle, colour))
        return made

    def show(self, look: str) -> None:
        """One of LOOKS."""
        if look not in self._looks:
            self._looks[look] = self._make(look)
            self._paint(look)
        for each, handles in self._looks.items():
            for handle, _ in handles:
                handle.visible = each == look

    def label(self, visible: bool) -> None:
        """Shows or hides its name."""
        if self._label is None and visible and len(self._shape.points):
            self._label = self._scene.add_label(f"{self._path}/label", self._name)
        if self._label is not None:
            self._label.visible = visible

    def cover(self, balls: Sequence[Balls], level: Optional[int]) -> None:
        """Shows a level of its cover, or none."""
        self._balls.show(balls, level)

    def _paint(self, look: str) -> None:
        for handle, colour in self._looks[look]:
            now = np.array(_rgb(HIT), dtype=np.uint8) if self._red else colour
            if look == "points":
                handle.colors = now.astype(np.uint8)
            else:
                handle.color = tuple(now.tolist())

    def place(self, pose: np.ndarray, placed: bool, red: bool) -> None:
        """Moves it. Sends nothing to the browser if the pose is unchanged."""
        now = pose.tobytes() if placed else b""
        if now != self._pose:
            self._pose = now
            self._frame.visible = placed
            if placed:
                self._frame.position = tuple(pose[:3])
                self._frame.wxyz = tuple(pose[3:] / np.linalg.norm(pose[3:]))
        if red != self._red:
            self._red = red
            for look in self._looks:
                self._paint(look)

    def remove(self) -> None:
        self._frame.remove()


class Page:
    """The three-dimensional part of the page."""

    def __init__(self, server: viser.ViserServer):
        self._scene = server.scene
        self._server = server
        self._bodies: list[Drawn] = []
        self._look = "mesh"
        self._segments: Any = None
        self._drawn_segments = b""
        self._edge: list[Any] = []
        self._path: list[Any] = []
        self._scene.set_up_direction("+z")
        self._scene.add_grid("/grid", 4.0, 4.0, cell_size=0.25, infinite_grid=True, fade_distance=12.0)

    def rebuild(
        self, picture: Picture, shapes: Sequence[Shape], is_static: Sequence[bool], known: Sequence[bool]
    ) -> None:
        """Replaces the bodies, and places the camera at the nearest pair."""
        with self._server.atomic():
            for body in self._bodies:
                body.remove()
            self._bodies = [
                Drawn(self._scene, i, name, is_static[i], known[i], shape)
                for i, (name, shape) in enumerate(zip(picture.names, shapes))
            ]
            self.show(self._look)
        self._look_at(picture, shapes)

    def _look_at(self, picture: Picture, shapes: Sequence[Shape]) -> None:
        target, position = camera_at_first(picture, shapes)
        camera = self._server.initial_camera
        camera.up = (0.0, 0.0, 1.0)
        camera.look_at = tuple(target)
        camera.position = tuple(position)
        for client in self._server.get_clients().values():
            client.camera.look_at = target
            client.camera.position = position

    def show(self, look: str) -> None:
        """Draws bodies as `mesh`, `pieces` or `points`."""
        self._look = look
        for body in self._bodies:
            body.show(look)

    def label(self, visible: bool) -> None:
        """Shows or hides the names of bodies."""
        for body in self._bodies:
            body.label(visible)

    def cover(self, covers: Mapping[int, Sequence[Balls]], level: Optional[int]) -> None:
        """Shows a level of the bodies' covers, as far as these are made, or none."""
        for i, body in enumerate(self._bodies):
            body.cover(covers.get(i, ()), level)

    def draw(self, picture: Picture, segments: bool) -> None:
        """Updates the poses of bodies and the segments between them."""
        red = picture.overlapping
        with self._server.atomic():
            for body, pose, placed, marked in zip(self._bodies, picture.poses, picture.placed, red):
                body.place(pose, bool(placed), bool(marked))
            self._draw_segments(picture.segments[picture.drawn] if segments else np.zeros((0, 2, 3)))

    def _draw_segments(self, points: np.ndarray) -> None:
        if points.tobytes() == self._drawn_segments:
            return
        self._drawn_segments = points.tobytes()
        if self._segments is not None:
            self._segments.remove()
            self._segments = None
        if len(points):
            self._segments = _lines(self._scene, "/segments", points, _rgb(BLUE), 2.0)

    def draw_edge(self, edge: Optional[Edge], trace: Optional[np.ndarray]) -> None:
        """Draws the path of the body that moves farthest, and each span's witness points, coloured by its proof.

        The first contact and the nearest or deepest state have thick lines between their witness points.
        """
        _remove(self._edge)
        if edge is None:
            return
        points = np.stack([span.segment for span in edge.spans])
        there = np.isfinite(points).all(axis=(1, 2))
        for verdict, colour in COLOURS.items():  # one set per colour, since viser draws mixed ones too light
            decided = np.array([span.verdict is verdict for span in edge.spans])
            self._add(self._edge, f"edge/witnesses/{verdict.name}", points[decided & there], _rgb(colour), 1.5)
            if trace is not None:
                way = np.stack([trace[:-1], trace[1:]], axis=1)
                parts = np.repeat(decided, len(way) // len(edge.spans))
                self._add(self._edge, f"edge/way/{verdict.name}", way[parts], _rgb(colour), 5.0)
        self._add_points(self._edge, "edge", edge.report, _rgb(COLOURS[edge.whole.verdict]))

    def draw_path(self, proved: Optional[ProvedPath], ways: Optional[np.ndarray]) -> None:
        """Draws the polyline of each body that a path moves, coloured by the proof of each motion.

        ways: (K * each + 1, B, 3), of Session.ways(). The first contact and the nearest or deepest state have thick
        lines between their witness points.
        """
        _remove(self._path)
        if proved is None:
            return
        for verdict, colour in COLOURS.items():
            decided = np.array([each is verdict for each in proved.verdicts])
            if ways is not None and decided.any():
                steps = np.stack([ways[:-1], ways[1:]], axis=2)  # (S, B, 2, 3)
                parts = steps[np.repeat(decided, len(steps) // len(decided))]
                self._add(self._path, f"path/way/{verdict.name}", parts.reshape(-1, 2, 3), _rgb(colour), 2.5)
        is_free = proved.report.check.free
        self._add_points(self._path, "path", proved.report, _rgb(COLOURS[Verdict.FREE if is_free else Verdict.HIT]))

    def _add_points(self, to: list[Any], name: str, report: PathReport, colour: tuple[int, int, int]) -> None:
        for what, point in (("contact", report.contact), ("nearest", report.nearest)):
            if point is not None and np.isfinite(point.segment).all():
                self._add(to, f"{name}/{what}", point.segment[None], colour, 6.0)

    def _add(self, to: list[Any], name: str, points: np.ndarray, colour: tuple[int, int, int], pixels: float) -> None:
        if len(points):
            to.append(_lines(self._scene, f"/{name}", points, colour, pixels))


def _remove(handles: list[Any]) -> None:
    for handle in handles:
        handle.remove()
    handles.clear()


def _rgb(colour: str) -> tuple[int, int, int]:
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def _lines(scene: viser.SceneApi, name: str, points: np.ndarray, colour: tuple[int, int, int], pixels: float) -> Any:
    return scene.add_line_segments(name, points.astype(np.float32), colour, thickness=pixels, thickness_units="screen")
