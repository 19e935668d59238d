"""The client's side of a shared segment (wire/shm_layout.h): mapping, slots and rings.

Stores are made in the order in which the daemon must see them. Python has no memory barriers; x86-64 keeps the order of
stores, and shm_channel.py rejects other machines. Where the protocol requires a store before a load, this side makes a
system call, which is a barrier: it wakes the daemon unconditionally, and waits with a futex.
"""

from __future__ import annotations

import ctypes
import mmap
import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._errors import ConnectionError
from .frames import HEADER

IDLE, POSTED, ARRIVED, DROPPED = range(4)

_MAGIC, _LAYOUT_VERSION, _PAGE, _RING_ENTRIES = 0x4D534C43, 1, 4096, 64
# Indices of the words, in units of four and of eight bytes.
_VERSION, _SLEEPING, _REQUEST_HEAD, _REPLY_HEAD, _WAITING = 56 // 4, 64 // 4, 128 // 4, 192 // 4, 256 // 4
_REQUESTS, _REPLIES, _TURNS = 320 // 8, 1344 // 8, 2368 // 8

_SYS_FUTEX, _FUTEX_WAIT = 202, 0  # of x86-64
_libc = ctypes.CDLL(None, use_errno=True)


class _Timespec(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


@dataclass
class Slot:
    """The client's state of one slot."""

    state: int = IDLE
    forgotten: bool = False  #: whether the request was abandoned
    retried: bool = False  #: whether the request was sent again because its reply did not fit
    generation: int = 0
    request_id: int = 0
    request_bytes: int = 0
    reply_bytes: int = 0


class Lease:
    """A slot with bytes in use, which the destructor frees on any thread."""

    __slots__ = ("segment", "index", "process")

    def __init__(self, segment: Segment, index: int):
        self.segment, self.index, self.process = segment, index, os.getpid()

    def __del__(self) -> None:
        if self.process == os.getpid():
            self.segment.free.add(self.index)


class Segment:
    """A mapped segment. Not thread-safe, except for leases."""

    def __init__(self, memfd: int, url: str):
        size = os.fstat(memfd).st_size
        if size < _PAGE:
            raise ConnectionError(f"{url}: the daemon handed over something that is not a segment")
        self.memory = mmap.mmap(memfd, size)
        self.bytes = np.frombuffer(self.memory, np.uint8)
        self._words = np.frombuffer(self.memory, np.uint32)
        self._longs = np.frombuffer(self.memory, np.uint64)
        version = int(self._words[_VERSION])
        magic, self.id, count, entries = map(int, self._words[:4])
        total, self.request_capacity, self.reply_capacity, requests, replies = map(int, self._longs[2:7])
        pages = self.request_capacity % _PAGE == 0 and self.reply_capacity % _PAGE == 0 and self.reply_capacity > 0
        expected = _PAGE + count * (self.request_capacity + self.reply_capacity)
        if (
            (version, magic, entries) != (_LAYOUT_VERSION, _MAGIC, _RING_ENTRIES)
            or not (0 < count <= _RING_ENTRIES and pages and total == expected == size)
            or (requests, replies) != (_PAGE, _PAGE + count * self.request_capacity)
        ):
            raise ConnectionError(f"{url}: the daemon's segment has a layout unknown to this client")
        self.memory.madvise(mmap.MADV_DONTFORK)  # a forked child cannot scribble over its parent's requests
        self.slots = [Slot() for _ in range(count)]
        self.free = set(range(count))
        self._requests_at, self._replies_at = requests, replies
        self._request_head = self._reply_tail = 0

    def request_area(self, slot: int) -> np.ndarray:
        """Returns the request area of a slot, (request_capacity,) uint8."""
        start = self._requests_at + slot * self.request_capacity
        return self.bytes[start : start + self.request_capacity]

    def reply(self, slot: int) -> np.ndarray:
        """Returns the received reply of a slot, (reply_bytes,) uint8, read-only."""
        start = self._replies_at + slot * self.reply_capacity
        view = self.bytes[start : start + self.slots[slot].reply_bytes]
        view.flags.writeable = False
        return view

    def take_slot(self) -> int:
        """Returns the lowest free slot, or -1."""
        if not self.free:
            return -1
        index = min(self.free)
        self.free.discard(index)
        self.slots[index] = Slot(generation=self.slots[index].generation)
        return index

    def all_free(self) -> bool:
        return len(self.free) == len(self.slots)

    def post(self, index: int) -> None:
        """Posts the frame in a slot's request area. The caller must then wake the daemon."""
        slot = self.slots[index]
        slot.state = POSTED
        slot.generation = (slot.generation + 1) & 0xFFFFFFFF
        entry = _REQUESTS + 2 * (self._request_head % _RING_ENTRIES)
        self._longs[entry] = slot.generation << 32 | index
        self._longs[entry + 1] = slot.request_bytes
        self._request_head = (self._request_head + 1) & 0xFFFFFFFF
        self._words[_REQUEST_HEAD] = self._request_head

    def collect(self) -> bool:
        """Receives the newly posted replies. Returns false for an invalid entry."""
        head = int(self._words[_REPLY_HEAD])
        if (head - self._reply_tail) & 0xFFFFFFFF > len(self.slots):
            return False
        while self._reply_tail != head:
            entry = _REPLIES + 2 * (self._reply_tail % _RING_ENTRIES)
            ticket, size = int(self._longs[entry]), int(self._longs[entry + 1])
            index = ticket & 0xFFFFFFFF
            if index >= len(self.slots) or size > self.reply_capacity or 0 < size < HEADER.size:
                return False
            slot = self.slots[index]
            if slot.state != POSTED or ticket >> 32 != slot.generation:
                return False
            slot.reply_bytes = size
            if slot.forgotten:
                slot.state = IDLE
                self.free.add(index)
            else:
                slot.state = ARRIVED if size else DROPPED
            self._reply_tail = (self._reply_tail + 1) & 0xFFFFFFFF
        return True

    def nothing_new(self) -> bool:
        return int(self._words[_REPLY_HEAD]) == self._reply_tail

    def turns(self) -> int:
        """Returns the iterations of the daemon's loop so far, or 0 if it does not count them."""
        return int(self._longs[_TURNS])

    def sleep(self, seconds: float) -> None:
        """Sleeps until a reply is posted, for at most so long. May return early."""
        if seconds <= 0:
            return
        self._words[_WAITING] = 1
        timeout = _Timespec(int(seconds), int(seconds % 1 * 1e9))
        word: Any = ctypes.c_void_p(self._words.ctypes.data + 4 * _REPLY_HEAD)
        _libc.syscall(_SYS_FUTEX, word, _FUTEX_WAIT, ctypes.c_uint32(self._reply_tail), ctypes.byref(timeout), None, 0)
        self._words[_WAITING] = 0
