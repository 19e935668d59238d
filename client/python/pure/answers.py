"""A reply's columns: copies, or views of the reply."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .. import wire
from .._words import COLUMNS, KNOWN_FIELDS, Field, Status, row_shape
from .frames import HEADER, Frame, malformed
from .zmq_channel import aligned_bytes

_ALIGNMENT = wire.COLUMN_ALIGNMENT
_JOINTS_RECORD = 2  #: of a reply: ReplyRecord::kJoints


class Answer(np.ndarray):
    """(bytes,) uint8 memory of the columns, with the properties of the whole answer.

    An array, since a pure Python class cannot export a buffer before Python 3.12.
    """

    fields: int
    rows: int
    total: int
    configurations: int
    pairs: int
    joints: int  #: joints of gradient_joints or hessian_joints, or 0 without them
    scene_revision: int
    snapshot_revision: int
    snapshot_stamp_ns: int
    snapshot_sequence: int
    pose_age_ns: int
    engine_ns: int
    server_ns: int
    backend: str
    beyond_limits: bool  #: whether a position of the run is beyond the limits of the query's joints
    _offsets: dict[int, int]
    _lease: Any

    def offset(self, field: int) -> int:
        """Returns the offset of a column, or -1."""
        return self._offsets.get(field, -1)

    def all_free(self) -> bool:
        """Whether the verdict of every row is BEYOND."""
        at = self.offset(COLUMNS["verdict"].bit)
        if at < 0:
            raise AttributeError("the column 'verdict' was not requested")
        return bool((self[at : at + self.rows].view(np.ndarray) == int(Status.BEYOND)).all())


def answer_of(frame: Frame, copy: bool, url: str) -> Answer:
    """Raises ConnectionError for a malformed reply."""
    joints = frame.number(_JOINTS_RECORD, 4, url)
    header, columns = _parse(frame, joints, url)
    if copy:
        answer, offsets = _copied(frame, columns)
    else:
        first = min(columns.values(), default=(0, 0))[0]
        # An array's base skips intermediate views of plain arrays, but not this class, which keeps the lease alive.
        whole = np.frombuffer(frame.payload, np.uint8).view(Answer)
        whole._lease = frame
        answer = whole[first:].view(Answer)
        answer._lease = whole
        answer.flags.writeable = False
        offsets = {bit: begin - first for bit, (begin, _) in columns.items()}
    answer._offsets = offsets
    answer.rows = int(header["rows"])
    answer.joints = joints
    for name in (
        "fields", "total", "configurations", "pairs", "scene_revision", "snapshot_revision", "snapshot_stamp_ns",
        "snapshot_sequence", "pose_age_ns", "engine_ns", "server_ns",
    ):  # fmt: skip
        setattr(answer, name, int(header[name]))
    answer.backend = bytes(header["backend"]).split(b"\0")[0].decode(errors="replace")
    return answer


def column_shape(name: str, joints: int) -> tuple[int, ...]:
    """Returns the shape of a row of a column."""
    return row_shape(name, joints)


def _parse(frame: Frame, joints: int, url: str) -> tuple[np.ndarray, dict[int, tuple[int, int]]]:
    """Returns the reply's header, and offset and size of each column in the payload."""
    size = wire._wire.ReplyHeader.itemsize
    if len(frame.payload) < size:
        raise malformed(url, "a reply without its header")
    header = np.frombuffer(bytes(frame.payload[:size]), wire._wire.ReplyHeader)[0]
    fields, rows = int(header["fields"]), int(header["rows"])
    if fields & ~KNOWN_FIELDS:
        raise malformed(url, f"fields has unknown bits: {fields:#x}")
    if fields & Field.HESSIAN_JOINTS and 8 * joints * joints > wire.MAX_FRAME_BYTES - HEADER.size:
        raise malformed(url, f"joints: a row of {joints} x {joints} numbers is more than a frame may have")
    columns, at = {}, size
    for name, column in COLUMNS.items():
        if fields >> column.bit & 1:
            bytes_of_it = rows * column.dtype.itemsize * math.prod(column_shape(name, joints))
            columns[column.bit] = at, bytes_of_it
            at = _padded(at + bytes_of_it)
    if at != len(frame.payload):
        raise malformed(url, f"{rows} rows need a payload of {at} bytes, got {len(frame.payload)}")
    return header, columns


def _copied(frame: Frame, columns: dict[int, tuple[int, int]]) -> tuple[Answer, dict[int, int]]:
    payload = np.frombuffer(frame.payload, np.uint8)
    answer = aligned_bytes(sum(_padded(size) for _, size in columns.values())).view(Answer)
    at, offsets = 0, {}
    for bit, (begin, size) in columns.items():
        answer[at : at + size] = payload[begin : begin + size]
        offsets[bit] = at
        at += _padded(size)
    return answer, offsets


def _padded(size: int) -> int:
    return -(-size // _ALIGNMENT) * _ALIGNMENT
