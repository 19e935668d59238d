"""A connection over shared memory. wire/shm_layout.h specifies layout and protocol."""

from __future__ import annotations

import contextlib
import errno
import os
import platform
import pwd
import socket
import struct
import time
from collections.abc import Sequence
from typing import Any, NamedTuple, Optional

from .._errors import ConnectionError, QueryError, TimeoutError
from ..wire import MAX_FRAME_BYTES, MAX_REQUEST_BYTES, VERSION, ErrorCode, FrameType
from .frames import HEADER, Frame
from .shm_segment import ARRIVED, DROPPED, IDLE, POSTED, Lease, Segment

#: Interval between reads of the socket while waiting, and so the maximum delay to detect a daemon's death.
_NAP_S = 0.01
#: Timeout of send() for a larger segment, or for a slot with an abandoned reply.
_SEND_TIMEOUT_S = 5.0

_MESSAGE = struct.Struct("<IHHIIQQ32x192s")
_MAGIC, _LAYOUT_VERSION = 0x4D534C43, 1
_HELLO, _GROW, _RETIRE, _SEGMENT, _REFUSED = 1, 2, 3, 0x81, 0x82
_ERROR = struct.Struct("<HxxIQ")
_MAX_SPIN_US = 1_000_000

_WHY_NOT = {
    errno.ENOENT: "there is no socket: is clearanced running?",
    errno.ECONNREFUSED: "no process listens there: the daemon is gone",
    errno.EPROTOTYPE: "the socket there is not clearanced's",
    errno.EACCES: "the socket belongs to another user, or its folder is not accessible",
}


class _Message(NamedTuple):
    magic: int
    layout_version: int
    wire_version: int
    kind: int
    segment_id: int
    request_capacity: int
    reply_capacity: int
    text: bytes

    def why(self) -> str:
        return self.text.split(b"\0")[0].decode(errors="replace")


class ShmChannel:
    """One connection. Not thread-safe."""

    signs_queue_up = False

    def __init__(self, target: str, deadline: float):
        """target: the socket's absolute path, and options after a question mark."""
        self.url = "shm://" + target
        if platform.machine() != "x86_64":
            raise ConnectionError(
                f"{self.url}: shared memory from Python alone relies on x86-64's order of stores, and this is "
                f"{platform.machine()}; use ipc://, or install the wheel clearance-*.whl"
            )
        self._dead = ""  # reason that the connection is unusable, or empty
        self._outgrown: list[Segment] = []
        self._path, user = _options(target)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._wake = -1
        try:
            self._open(user, deadline)
        except BaseException:
            self.close()
            raise

    @property
    def lost(self) -> bool:
        return bool(self._dead)

    def close(self) -> None:
        self._socket.close()
        if self._wake >= 0:
            os.close(self._wake)
            self._wake = -1

    def sign_of_life(self) -> int:
        self._wake_daemon()
        return self._current.turns()

    # ---- frames ---------------------------------------------------------------------------------------------------

    def send(self, header: bytes, parts: Sequence[Any], reply_bytes: int) -> None:
        self._check()
        self._retire_outgrown()
        views = [memoryview(part).cast("B") for part in (header, *parts) if memoryview(part).nbytes]
        size = sum(len(view) for view in views)
        if size > self._current.request_capacity:
            why = self._grow(size, reply_bytes, time.monotonic() + _SEND_TIMEOUT_S)
            if why is not None:
                text = f"{self.url}: a request of {size} bytes does not fit: {why}"
                raise QueryError(int(ErrorCode.TOO_LARGE), text)
        index = self._take_slot()
        segment = self._current
        area = memoryview(segment.request_area(index))  # type: ignore[arg-type]
        at = 0
        for view in views:
            area[at : at + len(view)] = view
            at += len(view)
        segment.slots[index].request_id = HEADER.unpack(header)[3]
        segment.slots[index].request_bytes = size
        self._post(segment, index)

    def receive(self, request_id: int, deadline: float) -> Optional[Frame]:
        found = self._find(request_id)
        if found is None:
            raise ConnectionError(f"{self.url}: no request {request_id} is under way")
        while True:
            self._collect()
            segment, index = found
            slot = segment.slots[index]
            if slot.state == ARRIVED:
                frame = self._take_reply(segment, index)
                if not self._send_again(segment, index, frame):
                    return frame
                found = self._find(request_id)
                assert found is not None
                continue
            if slot.state == DROPPED:
                slot.state = IDLE
                segment.free.add(index)
                raise ConnectionError(f"{self.url}: the daemon dropped request {request_id}")
            self._check()
            left = deadline - time.monotonic()
            if left <= 0:
                return None
            segment.sleep(min(_NAP_S, left))
            if segment.nothing_new():
                self._look_at_socket()

    def forget(self, request_id: int) -> None:
        found = self._find(request_id)
        if found is None:
            return
        segment, index = found
        slot = segment.slots[index]
        slot.forgotten = True  # the reply will return its slot
        if slot.state != POSTED:
            slot.state = IDLE
            segment.free.add(index)

    def _post(self, segment: Segment, index: int) -> None:
        segment.post(index)
        self._wake_daemon()

    def _wake_daemon(self) -> None:
        with contextlib.suppress(OSError):
            os.write(self._wake, b"\x01\0\0\0\0\0\0\0")

    def _collect(self) -> None:
        sane = [segment.collect() for segment in (self._current, *self._outgrown)]
        if not all(sane) and not self._dead:
            self._dead = f"{self.url}: the shared segment is corrupted"

    def _take_reply(self, segment: Segment, index: int) -> Frame:
        slot = segment.slots[index]
        slot.state = IDLE
        lease = Lease(segment, index)
        reply = segment.reply(index)
        frame = Frame(reply[: HEADER.size].tobytes(), reply[HEADER.size :], self.url, lease)
        if frame.request_id != slot.request_id:
            raise ConnectionError(f"{self.url}: the reply to request {slot.request_id} is corrupted")
        return frame

    def _send_again(self, segment: Segment, index: int, reply: Frame) -> bool:
        """Sends the request again from a larger segment if the reply reports a lack of space.

        The frame still leases the slot, so that the request is intact. Returns false to accept the reply.
        """
        old = segment.slots[index]
        needed = _room_needed(reply)
        if not segment.reply_capacity < needed <= MAX_FRAME_BYTES or old.retried or self._dead:
            return False
        too_small = needed > self._current.reply_capacity or old.request_bytes > self._current.request_capacity
        if too_small and self._grow(old.request_bytes, needed, time.monotonic() + _SEND_TIMEOUT_S) is not None:
            return False
        again = self._current.take_slot()
        if again < 0:
            return False
        size = old.request_bytes
        self._current.request_area(again)[:size] = segment.request_area(index)[:size]
        fresh = self._current.slots[again]
        fresh.request_id, fresh.request_bytes, fresh.retried = old.request_id, size, True
        self._post(self._current, again)
        return True

    # ---- segments and slots ---------------------------------------------------------------------------------------

    def _find(self, request_id: int) -> Optional[tuple[Segment, int]]:
        """Returns segment and slot of a pending request, or None."""
        for segment in (self._current, *self._outgrown):
            for index, slot in enumerate(segment.slots):
                if slot.request_id == request_id and slot.state != IDLE and not slot.forgotten:
                    return segment, index
        return None

    def _take_slot(self) -> int:
        deadline = time.monotonic() + _SEND_TIMEOUT_S
        while True:
            self._collect()
            index = self._current.take_slot()
            if index >= 0:
                return index
            slots = self._current.slots
            posted = sum(slot.state == POSTED and not slot.forgotten for slot in slots)
            arrived = sum(slot.state in (ARRIVED, DROPPED) for slot in slots)
            if not any(slot.state == POSTED and slot.forgotten for slot in slots):
                raise ConnectionError(
                    f"{self.url}: all {len(slots)} slots are taken: {posted} requests under way, {arrived} replies not "
                    f"yet received, {len(slots) - posted - arrived} replies still held; release some"
                )
            self._check()
            left = deadline - time.monotonic()
            if left <= 0:
                raise TimeoutError(f"{self.url}: the daemon has not given back the slot of an abandoned request")
            self._current.sleep(min(_NAP_S, left))
            if self._current.nothing_new():
                self._look_at_socket()

    def _grow(self, request_bytes: int, reply_bytes: int, deadline: float) -> Optional[str]:
        """Changes to a segment with slots of this size. Returns None, or the daemon's reason to reject it."""
        # Doubling avoids a new segment for every slightly larger batch; near the limits, sizes are exact.
        larger = _doubled(request_bytes, MAX_REQUEST_BYTES), _doubled(reply_bytes, MAX_FRAME_BYTES)
        why: Optional[str] = ""
        for wanted in dict.fromkeys([larger, (request_bytes, reply_bytes), (request_bytes, 0)]):
            why = self._ask_segment(*wanted, deadline)
            if why is None:
                break
        return why

    def _ask_segment(self, request_bytes: int, reply_bytes: int, deadline: float) -> Optional[str]:
        request_bytes = max(request_bytes, self._current.request_capacity)
        reply_bytes = max(reply_bytes, self._current.reply_capacity)
        if not self._say(_GROW, 0, request_bytes, reply_bytes):
            self._look_at_socket()
            self._dead = self._dead or f"{self.url}: the daemon takes no messages"
            self._check()
        try:
            answer, fds = self._await_answer(deadline)
        except TimeoutError as error:
            self._dead = str(error)  # a late answer would be assigned to another request
            raise
        if answer.kind == _REFUSED:
            return answer.why()
        larger = self._segment_of(fds)
        if larger.request_capacity < request_bytes or larger.reply_capacity < reply_bytes:
            self._die("the daemon handed over a smaller segment than requested")
        self._outgrown.append(self._current)
        self._current = larger
        self._retire_outgrown()
        return None

    def _retire_outgrown(self) -> None:
        """Releases outgrown segments without requests, replies or frames."""
        self._outgrown = [s for s in self._outgrown if not (s.all_free() and self._say(_RETIRE, s.id))]

    # ---- the socket -----------------------------------------------------------------------------------------------

    def _open(self, user: Optional[int], deadline: float) -> None:
        self._socket.settimeout(max(deadline - time.monotonic(), 1e-3))
        try:
            self._socket.connect(self._path)
        except (socket.timeout, BlockingIOError):
            raise TimeoutError(f"{self.url}: the daemon does not take the connection") from None
        except OSError as error:
            if error.errno is None:
                raise ConnectionError(f"{self.url}: a socket's path has 1 to 107 bytes") from None
            raise ConnectionError(f"{self.url}: {_WHY_NOT.get(error.errno, error.strerror)}") from None
        peer = struct.unpack("3i", self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))[1]
        if peer != (os.geteuid() if user is None else user):
            ours = f"ours (user {os.geteuid()}); add ?user=NAME for the daemon of another user"
            whose = ours if user is None else f"user {user}'s"
            raise ConnectionError(f"{self.url}: the socket is user {peer}'s, not {whose}")
        self._say(_HELLO)  # on failure, the daemon has rejected the connection, and its reason follows
        answer, fds = self._await_answer(deadline)
        if answer.kind == _REFUSED:
            raise ConnectionError(f"{self.url}: rejected: {answer.why()}")
        if len(fds) != 2:
            raise ConnectionError(f"{self.url}: the daemon's greeting lacks the segment")
        self._wake = fds.pop()
        self._current = self._segment_of(fds)

    def _segment_of(self, fds: list[int]) -> Segment:
        try:
            if not fds:
                self._die("the daemon's message lacks the segment")
            return Segment(fds[0], self.url)
        finally:
            for fd in fds:
                os.close(fd)

    def _say(self, kind: int, segment_id: int = 0, request_capacity: int = 0, reply_capacity: int = 0) -> bool:
        message = _Message(_MAGIC, _LAYOUT_VERSION, VERSION, kind, segment_id, request_capacity, reply_capacity, b"")
        self._socket.setblocking(False)
        try:
            return self._socket.send(_MESSAGE.pack(*message)) == _MESSAGE.size
        except OSError:
            return False

    def _await_answer(self, deadline: float) -> tuple[_Message, list[int]]:
        """Returns the daemon's next message, a segment or a rejection, with its descriptors."""
        was_reset = False
        while True:
            self._socket.settimeout(max(deadline - time.monotonic(), 1e-3))
            try:
                data, fds, _, _ = socket.recv_fds(self._socket, _MESSAGE.size, 2)
            except (socket.timeout, BlockingIOError):
                raise TimeoutError(f"{self.url}: the daemon does not answer on its socket") from None
            except ConnectionResetError as error:
                # The daemon closed the socket with unread data. Its last message can still be received.
                if was_reset:
                    self._die(str(error.strerror))
                was_reset = True
                continue
            except OSError as error:
                self._die(str(error.strerror))
            if not data:
                self._die("the daemon closed the connection")
            message = _Message._make(_MESSAGE.unpack(data.ljust(_MESSAGE.size, b"\0")))
            if len(data) < 16 or message.magic != _MAGIC:
                self._die("what listens there is not clearanced")
            if message.kind == _REFUSED:
                return message, list(fds)
            if (message.layout_version, message.wire_version) != (_LAYOUT_VERSION, VERSION):
                self._die("the daemon speaks another version of the shared-memory layout")
            if message.kind != _SEGMENT:
                self._die("the daemon sent a message of unknown kind")
            return message, list(fds)

    def _look_at_socket(self) -> None:
        """Detects the loss of the daemon. Replies that it had posted can still be received."""
        self._socket.setblocking(False)
        try:
            data = self._socket.recv(_MESSAGE.size)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        message = _Message._make(_MESSAGE.unpack(data.ljust(_MESSAGE.size, b"\0")))
        self._dead = f"{self.url}: " + (message.why() if message.kind == _REFUSED else "the daemon is gone")

    def _check(self) -> None:
        if self._dead:
            raise ConnectionError(self._dead)

    def _die(self, why: str) -> Any:
        self._dead = f"{self.url}: {why}"
        raise ConnectionError(self._dead)


def _options(target: str) -> tuple[str, Optional[int]]:
    """Returns the path and the user of the intended daemon."""
    path, _, options = target.partition("?")
    user = None
    for option in filter(None, options.split("&")):
        name, _, value = option.partition("=")
        if name == "user":
            try:
                user = pwd.getpwnam(value).pw_uid
            except KeyError:
                if not value.isdecimal():
                    raise ValueError(f'shm://{target}: there is no user "{value}"') from None
                user = int(value)
        elif name != "spin_us" or not value.isdecimal() or int(value) > _MAX_SPIN_US:  # Python does not spin
            raise ValueError(
                f'shm://{target}: "{option}" is not an option; there is spin_us=0 to spin_us={_MAX_SPIN_US}, and '
                "user=NAME"
            )
    return path, user


def _room_needed(frame: Frame) -> int:
    """Returns the size that a reply needs if it reports a lack of space, otherwise 0."""
    if frame.type != FrameType.ERROR or len(frame.payload) < _ERROR.size:
        return 0
    code, _, needed = _ERROR.unpack_from(frame.payload)
    return needed if code == ErrorCode.TOO_LARGE else 0


def _doubled(size: int, limit: int) -> int:
    return size if size > limit // 2 else 1 << max(size - 1, 0).bit_length()
