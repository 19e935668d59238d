"""Frames as they travel: a header, a payload, and the records that a payload may end in (docs/wire.md)."""

from __future__ import annotations

import struct
from typing import Any

from .._errors import ConnectionError
from ..wire import MAGIC, RECORD_REQUIRED, VERSION, CommonRecord, FrameType

HEADER = struct.Struct("<IHHQQQQQ16x")
#: Request ids from here on are of what the library itself asks: a caller's requests count from 1.
OWN_REQUESTS = 1 << 62
#: Of an echo that nobody reads: that it comes is a sign of life.
SIGN_REQUEST = OWN_REQUESTS | 1 << 61

_RECORD = struct.Struct("<HHI")


class Frame:
    """A frame that arrived. `lease` keeps its memory: over shared memory the slot is given back with it."""

    __slots__ = ("type", "request_id", "payload", "records", "lease")

    def __init__(self, header: Any, payload: Any, url: str, lease: Any = None):
        magic, version, self.type, self.request_id, size, _, _, records = HEADER.unpack(header)
        if (magic, version) != (MAGIC, VERSION) or size != len(payload) or records > size or records % 8:
            raise malformed(url, "its header does not fit what came")
        self.payload = memoryview(payload)[: size - records]
        self.records = memoryview(payload)[size - records :]
        self.lease = lease

    def epoch(self, url: str) -> int:
        """Which run of the daemon has answered; 0: the reply names none."""
        return self.number(CommonRecord.EPOCH, 8, url)

    def number(self, wanted: int, width: int, url: str) -> int:
        """The unsigned number of so many bytes in the record of that tag; 0: there is none."""
        at, number = 0, 0
        while at < len(self.records):
            tag, _, size = _RECORD.unpack_from(self.records, at)
            at += _RECORD.size
            if size > len(self.records) - at:
                raise malformed(url, "a record goes past the end")
            if tag == wanted and size == width:
                number = int.from_bytes(self.records[at : at + size], "little")
            at += -(-size // 8) * 8
        return number


def malformed(url: str, why: str) -> ConnectionError:
    return ConnectionError(f"{url}: the daemon sent a malformed frame: {why}")


def record(tag: int, payload: bytes) -> bytes:
    """A record that whoever does not know it must refuse."""
    return _RECORD.pack(tag, RECORD_REQUIRED, len(payload)) + payload + bytes(-len(payload) % 8)


def header_bytes(type: int, request_id: int, payload_bytes: int, scene_revision: int = 0, records: int = 0) -> bytes:
    """records: bytes of them that the payload ends in."""
    return HEADER.pack(MAGIC, VERSION, type, request_id, payload_bytes, scene_revision, 0, records)


def name_of_type(type: int) -> str:
    """As other clients name it: "kReply"."""
    try:
        return "k" + FrameType(type).name.title().replace("_", "")
    except ValueError:
        return f"type {type}"
