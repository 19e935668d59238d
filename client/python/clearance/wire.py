"""The frames of client/protocol.h as numpy structured dtypes, for those who speak the wire from Python.

    header = np.zeros((), wire.FrameHeader)
    header["magic"], header["version"], header["type"] = wire.MAGIC, wire.VERSION, wire.FrameType.DESCRIBE

Sizes and offsets equal those of the C++ structs (a test compares them). Little-endian; metres, radians, nanoseconds.
"""

from __future__ import annotations

import enum

import numpy as np

from ._words import COLUMNS, DEFAULT_FIELDS

MAGIC = 0x31524C43  #: "CLR1"
VERSION = 1
COLUMN_ALIGNMENT = 64
MAX_FRAME_BYTES = 1 << 31
MAX_REQUEST_BYTES = 1 << 28


class FrameType(enum.IntEnum):
    """What a frame is. Requests below 0x80, answers from 0x81."""

    PING = 1
    DESCRIBE = 2
    QUERY = 3
    PAIRS = 4
    SET_POSES = 5
    ATTACH = 6
    GET_STATES = 7
    GET_STATS = 8
    RELOAD = 9
    ADD_BODY = 10
    REMOVE_BODY = 11
    PONG = 0x81
    SCENE = 0x82
    REPLY = 0x83
    PAIR_TABLE = 0x84
    POSES_DONE = 0x85
    BODY_STATES = 0x87
    STATS = 0x88
    SCENE_CHANGED = 0x89
    ERROR = 0xFF


class ErrorCode(enum.IntEnum):
    """Why a request was refused."""

    BAD_QUERY = 1
    WRONG_SCENE = 2
    TOO_LARGE = 3
    NOT_SUPPORTED = 4
    BAD_FRAME = 16
    WRONG_VERSION = 17
    UNKNOWN_TYPE = 18
    BUSY = 19
    INTERNAL = 20
    RELOAD_FAILED = 21
    FORBIDDEN = 22
    POSES_LATE = 23


FrameHeader = np.dtype(
    [
        ("magic", "<u4"),
        ("version", "<u2"),
        ("type", "<u2"),
        ("request_id", "<u8"),
        ("payload_bytes", "<u8"),
        ("scene_revision", "<u8"),
        ("client_id", "<u8"),
        ("reserved", "<u8", 3),
    ]
)
QueryHeader = np.dtype(
    [
        ("max_distance", "<f8"),
        ("abs_tol", "<f8"),
        ("rel_tol", "<f8"),
        ("pair_count", "<u4"),
        ("body_count", "<u4"),
        ("configuration_count", "<u4"),
        ("fields", "<u4"),
        ("max_results", "<u8"),
        ("max_pose_age_ns", "<i8"),
        ("all_pairs", "u1"),
        ("precision", "u1"),
        ("signed_distance", "u1"),
        ("reduce", "u1"),
        ("format", "u1"),
        ("warm", "u1"),
        ("padding", "u1", 2),
        ("min_pose_stamp_ns", "<i8"),
        ("pose_wait_ns", "<i8"),
        ("wait_for", "<u4"),
        ("padding2", "<u4", 1),
        ("reserved", "<u8", 5),
    ]
)
ReplyHeader = np.dtype(
    [
        ("rows", "<u8"),
        ("total", "<u8"),
        ("configurations", "<u8"),
        ("pairs", "<u8"),
        ("fields", "<u4"),
        ("reduce", "u1"),
        ("format", "u1"),
        ("padding", "u1", 2),
        ("scene_revision", "<u8"),
        ("snapshot_revision", "<u8"),
        ("snapshot_stamp_ns", "<i8"),
        ("oldest_receipt_ns", "<i8"),
        ("pairs_evaluated", "<u8"),
        ("engine_ns", "<u8"),
        ("server_ns", "<u8"),
        ("backend", "S16"),
        ("snapshot_sequence", "<i8"),
        ("pose_age_ns", "<i8"),
    ]
)
PosesHeader = np.dtype([("count", "<u8"), ("stamp_ns", "<i8"), ("sequence", "<i8"), ("reserved", "<u8", 1)])
PoseRecord = np.dtype([("body", "<u4"), ("padding", "<u4"), ("pose", "<f8", 7)])
AttachRecord = np.dtype(
    [("child", "<u4"), ("parent", "<u4"), ("has_pose", "u1"), ("padding", "u1", 7), ("pose", "<f8", 7)]
)
PosesResult = np.dtype(
    [
        ("revision", "<u8"),
        ("scene_revision", "<u8"),
        ("applied", "<u4"),
        ("bad", "<u4"),
        ("unknown", "<u4"),
        ("fixed", "<u4"),
    ]
)
SceneHeader = np.dtype(
    [
        ("scene_revision", "<u8"),
        ("body_count", "<u4"),
        ("group_count", "<u4"),
        ("member_count", "<u4"),
        ("padding", "<u4"),
        ("pair_count", "<u8"),
        ("backend", "S16"),
        ("reserved", "<u8", 2),
    ]
)
BodyRecord = np.dtype(
    [
        ("name", "S64"),
        ("parent", "<u4"),
        ("is_static", "u1"),
        ("padding", "u1", 3),
        ("piece_count", "<u4"),
        ("padding2", "<u4"),
        ("vertex_count", "<u8"),
        ("model_error", "<f8"),
        ("extent", "<f8"),
        ("hull_excess", "<f8"),
        ("empty_share", "<f8"),
        ("reserved", "<u8"),
    ]
)
GroupRecord = np.dtype([("name", "S64"), ("first_member", "<u4"), ("member_count", "<u4"), ("reserved", "<u8")])
PairsHeader = np.dtype([("scene_revision", "<u8"), ("count", "<u8")])
StatesHeader = np.dtype([("count", "<u8"), ("revision", "<u8"), ("now_ns", "<i8"), ("reserved", "<u8")])
BodyStateRecord = np.dtype(
    [
        ("pose", "<f8", 7),
        ("stamp_ns", "<i8"),
        ("receipt_ns", "<i8"),
        ("parent", "<u4"),
        ("status", "u1"),
        ("padding", "u1", 3),
        ("reserved", "<u8", 2),
    ]
)
NewBodyRecord = np.dtype(
    [
        ("name", "S64"),
        ("parent", "<u4"),
        ("shape", "u1"),
        ("is_static", "u1"),
        ("has_pose", "u1"),
        ("padding", "u1"),
        ("size", "<f8", 3),
        ("radius", "<f8"),
        ("pose", "<f8", 7),
        ("vertex_count", "<u8"),
        ("reserved", "<u8", 2),
    ]
)
VertexRecord = np.dtype([("xyz", "<f8", 3)])
RemoveBodyRecord = np.dtype([("name", "S64")])
SceneChange = np.dtype(
    [("scene_revision", "<u8"), ("body_count", "<u4"), ("body", "<u4"), ("seconds", "<f8"), ("reserved", "<u8", 1)]
)
CounterRecord = np.dtype([("name", "S56"), ("value", "<u8")])
ErrorHeader = np.dtype([("code", "<u2"), ("padding", "<u2"), ("text_bytes", "<u4"), ("needed_bytes", "<u8")])

#: Every record by name.
RECORDS = {name: value for name, value in list(globals().items()) if isinstance(value, np.dtype)}


def query_header(**values: object) -> np.ndarray:
    """A QueryHeader with the defaults of the C++ struct, and the values given."""
    header = np.zeros((), QueryHeader)
    defaults = {
        "max_distance": np.inf,
        "rel_tol": -1.0,
        "fields": DEFAULT_FIELDS,
        "max_results": 1 << 20,
        "all_pairs": 1,
    }
    for key, value in {**defaults, **values}.items():
        header[key] = value
    return header


def frame(type: FrameType, payload: bytes = b"", request_id: int = 0, scene_revision: int = 0) -> bytes:
    """A whole frame: header and payload."""
    header = np.zeros((), FrameHeader)
    header["magic"], header["version"], header["type"] = MAGIC, VERSION, type
    header["request_id"], header["payload_bytes"] = request_id, len(payload)
    header["scene_revision"] = scene_revision
    return header.tobytes() + payload


def columns(payload: bytes, reply: np.ndarray) -> dict[str, np.ndarray]:
    """Flat columns of a kReply payload; `reply` is its ReplyHeader."""
    arrays = {}
    offset = ReplyHeader.itemsize
    rows = int(reply["rows"])
    for name, column in COLUMNS.items():
        if not int(reply["fields"]) & (1 << column.bit):
            continue
        offset = -(-offset // COLUMN_ALIGNMENT) * COLUMN_ALIGNMENT
        arrays[name] = np.ndarray((rows,) + column.shape, column.dtype, payload, offset)
        offset += arrays[name].nbytes
    return arrays
