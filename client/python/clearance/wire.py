"""Frames as numpy structured dtypes (wire/protocol.h, wire/payloads.h), for clients that implement them in Python.

    header = np.zeros((), wire.FrameHeader)
    header["magic"], header["version"], header["type"] = wire.MAGIC, wire.VERSION, wire.FrameType.DESCRIBE

The dtypes come from the C++ structs in the extension module. Little-endian; metres, radians, nanoseconds.
"""

from __future__ import annotations

import enum
import sys
from typing import Any

import numpy as np

from ._words import COLUMNS, DEFAULT_FIELDS

MAGIC = 0x31524C43  #: "CLR1"
VERSION = 1
COLUMN_ALIGNMENT = 64
MAX_FRAME_BYTES = 1 << 31
MAX_REQUEST_BYTES = 1 << 28


class FrameType(enum.IntEnum):
    """Types of frames. Requests are below 0x80, answers start at 0x81."""

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
    ALLOW = 12
    SET_JOINTS = 13
    GET_JOINTS = 14
    SET_POINTS = 15
    CERTIFY = 17
    OPEN_PLAN = 18
    RUN_PLAN = 19
    CLOSE_PLAN = 20
    PONG = 0x81
    SCENE = 0x82
    REPLY = 0x83
    PAIR_TABLE = 0x84
    POSES_DONE = 0x85
    BODY_STATES = 0x87
    STATS = 0x88
    SCENE_CHANGED = 0x89
    JOINTS = 0x8A
    CERTIFICATE = 0x8C
    PLAN = 0x8D
    PLAN_DONE = 0x8E
    ERROR = 0xFF


class QueryRecord(enum.IntEnum):
    """Tags of a query's array records."""

    MARGINS = 6  #: rows of two uint32 selectors and one float64, metres
    PAIR_MARGINS = 7  #: (P,) float64, metres
    JOINTS = 8  #: (J,) uint32 ids
    POSITIONS = 9  #: (K, J) float64
    WEIGHTS = 11  #: (J,) float64
    GROWTHS = 13  #: (K, M) float64, metres
    VELOCITIES = 18  #: (K, J) float64, rad/s and m/s
    TWISTS = 19  #: (K, M, 6) float64, rad/s and m/s
    SPEED_ERRORS = 20  #: (J + 2 M,) float64, for the column rate_bounds
    ROWS = 16  #: uint64 row numbers, for CERTIFY only


class UpdateRecord(enum.IntEnum):
    """Tags of records of SET_POSES and SET_JOINTS."""

    VELOCITIES = 1  #: (count, 6) or (count,) float64; NaN where unknown


class ErrorCode(enum.IntEnum):
    """Reasons for rejecting a request."""

    BAD_QUERY = 1  #: a value is invalid; the text names it
    WRONG_SCENE = 2  #: the request names another scene than the daemon's; the next call fetches the names again
    TOO_LARGE = 3  #: the answer exceeds a limit; request fewer rows or fields
    NOT_SUPPORTED = 4  #: valid, but unsupported by this build, backend or version; the text names the option
    BAD_FRAME = 16  #: inconsistent sizes or counts: a bug in the client
    WRONG_VERSION = 17  #: the daemon speaks another version of the protocol, which the text names
    UNKNOWN_TYPE = 18  #: unknown type of request: a bug in the client, or an older daemon
    BUSY = 19  #: too many of this client's requests are waiting; read answers before sending more
    INTERNAL = 20  #: a bug of Clearance; please report it
    RELOAD_FAILED = 21  #: the scene file could not be loaded, and the old scene stays; the text is the loader's
    FORBIDDEN = 22  #: this client lacks the right that the text names
    POSES_LATE = 23  #: the poses that the query waits for have not arrived in time
    NEW_EPOCH = 24  #: the daemon was restarted, or is another one; Client.acknowledge_epoch() accepts it
    DEADLINE = 25  #: no answer by the query's deadline_ns; the text states the time required or used


RECORD_REQUIRED = 1  #: flag of a record: a receiver that does not know its tag must reject the frame


class ReplyRecord(enum.IntEnum):
    """Tags of a reply's records."""

    IGNORED = 1  #: uint16 tags of the query's records that the daemon ignored
    JOINTS = 2  #: uint32 J; present with the columns gradient_joints and hessian_joints


class CommonRecord(enum.IntEnum):
    """Tags of records with the same meaning in every frame."""

    EPOCH = 0xFF00  #: uint64 run of the daemon: in a reply its own, in a request the intended one


def __getattr__(name: str) -> Any:
    """Creates the structs on first use, as RECORDS["FrameHeader"] and FrameHeader."""
    if name.startswith("_"):  # names that the import system tries
        raise AttributeError(name)
    from . import _client

    RECORDS = {struct: np.dtype(members) for struct, members in _client.wire_structs().items()}
    globals().update(RECORDS, RECORDS=RECORDS)
    try:
        return globals()[name]
    except KeyError:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}") from None


_wire: Any = sys.modules[__name__]  # access to the structs for the functions below


def query_header(**values: object) -> np.ndarray:
    """Returns a QueryHeader with the given values and otherwise the defaults of the C++ struct."""
    header = np.zeros((), _wire.QueryHeader)
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


def record(tag: int, payload: bytes, required: bool = True) -> bytes:
    """Returns one record of a frame. Records must be in ascending order of tags."""
    header = np.zeros((), _wire.RecordHeader)
    header["tag"], header["flags"], header["bytes"] = tag, RECORD_REQUIRED if required else 0, len(payload)
    return header.tobytes() + payload + bytes(-len(payload) % 8)


def frame(
    type: FrameType, payload: bytes = b"", request_id: int = 0, scene_revision: int = 0, records: bytes = b""
) -> bytes:
    """Returns a complete frame: header, payload and records."""
    header = np.zeros((), _wire.FrameHeader)
    header["magic"], header["version"], header["type"] = MAGIC, VERSION, type
    header["request_id"], header["payload_bytes"] = request_id, len(payload) + len(records)
    header["scene_revision"], header["records_bytes"] = scene_revision, len(records)
    return header.tobytes() + payload + records


def columns(payload: bytes, reply: np.ndarray) -> dict[str, np.ndarray]:
    """Returns the flat columns of a kReply payload; `reply` is its ReplyHeader."""
    arrays = {}
    offset = _wire.ReplyHeader.itemsize
    rows = int(reply["rows"])
    for name, column in COLUMNS.items():
        if not int(reply["fields"]) & (1 << column.bit):
            continue
        offset = -(-offset // COLUMN_ALIGNMENT) * COLUMN_ALIGNMENT
        arrays[name] = np.ndarray((rows,) + column.shape, column.dtype, payload, offset)
        offset += arrays[name].nbytes
    return arrays
