"""The frames of wire/protocol.h as numpy structured dtypes, for those who speak the wire from Python.

    header = np.zeros((), wire.FrameHeader)
    header["magic"], header["version"], header["type"] = wire.MAGIC, wire.VERSION, wire.FrameType.DESCRIBE

The dtypes are made of what the extension module says of the C++ structs. Little-endian; metres, radians, nanoseconds.
"""

from __future__ import annotations

import enum
import sys
from typing import Any

import numpy as np

from ._words import COLUMNS, DEFAULT_FIELDS

MAGIC = 0x31524C43  #: "CLR1"
VERSION = 1  #: of a frame without records
RECORDS_VERSION = 2  #: of a frame whose payload may end in records
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
    """Records of a query that are arrays."""

    MARGINS = 6  #: two uint32, float64 each: selectors, metres
    PAIR_MARGINS = 7  #: float64 each: (P,) metres
    JOINTS = 8  #: uint32 each: (J,) ids
    POSITIONS = 9  #: float64 each: (K, J)
    WEIGHTS = 11  #: float64 each: (J,)
    ROWS = 16  #: uint64 each: numbers of rows, of CERTIFY alone


class ErrorCode(enum.IntEnum):
    """Why a request was refused."""

    BAD_QUERY = 1  #: a value makes no sense; the text names it
    WRONG_SCENE = 2  #: the daemon has another scene than the request names; the next call looks names up anew
    TOO_LARGE = 3  #: the answer does not fit; ask for fewer rows or fields
    NOT_SUPPORTED = 4  #: legal, but not in this build, backend or version; the text says what
    BAD_FRAME = 16  #: sizes or counts do not fit: a bug in the client
    WRONG_VERSION = 17  #: the daemon speaks an older version of the contract; the text says which
    UNKNOWN_TYPE = 18  #: there is no such request: a bug in the client, or a daemon that is older
    BUSY = 19  #: too many of this client's requests are waiting; read answers before sending more
    INTERNAL = 20  #: a bug of Clearance; please report it
    RELOAD_FAILED = 21  #: the scene file could not be loaded, and the old scene stays; the text is the loader's
    FORBIDDEN = 22  #: this client lacks the right that the text names
    POSES_LATE = 23  #: the poses that the query waits for have not come in time
    NEW_EPOCH = 24  #: the daemon was started anew, or is another one; Client.acknowledge_epoch() goes on with it
    DEADLINE = 25  #: no answer by the query's deadline_ns; the text says how long it takes, or took


RECORD_REQUIRED = 1  #: flag of a record: who does not know its tag refuses the frame


class ReplyRecord(enum.IntEnum):
    """Tags of a reply's records."""

    IGNORED = 1  #: uint16 each: tags of the query's records that the daemon passed over
    JOINTS = 2  #: uint32: J, entries a row of the column gradient_joints, with which it comes


class CommonRecord(enum.IntEnum):
    """Tags of records that mean the same in every frame."""

    EPOCH = 0xFF00  #: uint64: of a reply the run of the daemon that answers, of a request the one that it is for


def __getattr__(name: str) -> Any:
    """The structs, made when one is first asked for: RECORDS["FrameHeader"], or FrameHeader."""
    if name.startswith("_"):  # the import system looks for some that no module of one file has
        raise AttributeError(name)
    from . import _client

    RECORDS = {struct: np.dtype(members) for struct, members in _client.wire_structs().items()}
    globals().update(RECORDS, RECORDS=RECORDS)
    try:
        return globals()[name]
    except KeyError:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}") from None


_wire: Any = sys.modules[__name__]  # through which functions here get at the structs


def query_header(**values: object) -> np.ndarray:
    """A QueryHeader with the defaults of the C++ struct, and the values given."""
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
    """One record of a frame; tags rise from record to record."""
    header = np.zeros((), _wire.RecordHeader)
    header["tag"], header["flags"], header["bytes"] = tag, RECORD_REQUIRED if required else 0, len(payload)
    return header.tobytes() + payload + bytes(-len(payload) % 8)


def frame(
    type: FrameType, payload: bytes = b"", request_id: int = 0, scene_revision: int = 0, records: bytes = b""
) -> bytes:
    """A whole frame: header, payload and records; of version 1 if there are none."""
    header = np.zeros((), _wire.FrameHeader)
    header["magic"], header["version"], header["type"] = MAGIC, RECORDS_VERSION if records else VERSION, type
    header["request_id"], header["payload_bytes"] = request_id, len(payload) + len(records)
    header["scene_revision"], header["records_bytes"] = scene_revision, len(records)
    return header.tobytes() + payload + records


def columns(payload: bytes, reply: np.ndarray) -> dict[str, np.ndarray]:
    """Flat columns of a kReply payload; `reply` is its ReplyHeader."""
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
