"""Frames as they travel: a header, a payload, and the records that a payload may end in (docs/service/wire.md)."""

from __future__ import annotations

import struct
from typing import Any

from .._errors import ConnectionError
from ..wire import MAGIC, RECORD_REQUIRED, VERSION, CommonRecord, FrameType

HEADER = struct.Struct("<IHHQQQQQQ8x")
#: First id of the library's own requests; a caller's requests count from 1.
OWN_REQUESTS = 1 << 62
#: Id of an echo request whose reply only serves as a sign of life.
SIGN_REQUEST = OWN_REQUESTS | 1 << 61

_RECORD = struct.Struct("<HHI")


class Frame:
    """A received frame. `lease` keeps its memory; over shared memory, releasing it returns the slot."""

    __slots__ = ("type", "request_id", "payload", "records", "lease")

    def __init__(self, header: Any, payload: Any, url: str, lease: Any = None):
        magic, version, self.type, self.request_id, size, _, _, records, _ = HEADER.unpack(header)
        if (magic, version) != (MAGIC, VERSION) or size != len(payload) or records > size or records % 8:
            raise malformed(url, "its header does not fit what came")
        self.payload = memoryview(payload)[: size - records]
        self.records = memoryview(payload)[size - records :]
        self.lease = lease

    def epoch(self, url: str) -> int:
        """Returns the run of the daemon that answered, or 0 if the reply names none."""
        return self.number(CommonRecord.EPOCH, 8, url)

    def number(self, wanted: int, width: int, url: str) -> int:
        """Returns the unsigned number of so many bytes in the record of that tag, or 0."""
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
    """Returns a required record, which a receiver must reject if it does not know the tag."""
    return _RECORD.pack(tag, RECORD_REQUIRED, len(payload)) + payload + bytes(-len(payload) % 8)


def header_bytes(
    type: int, request_id: int, payload_bytes: int, scene_revision: int = 0, records: int = 0, flags: int = 0
) -> bytes:
    """records: bytes of them that the payload ends in. flags: FrameFlag bits."""
    return HEADER.pack(MAGIC, VERSION, type, request_id, payload_bytes, scene_revision, 0, records, flags)


def name_of_type(type: int) -> str:
    """Returns the C++ name, such as "kReply"."""
    try:
        return "k" + FrameType(type).name.title().replace("_", "")
    except ValueError:
        return f"type {type}"
