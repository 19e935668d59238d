"""The socket of a connection over shared memory, which hands over its segments. wire/shm_layout.h specifies both."""

from __future__ import annotations

import errno
import os
import pwd
import socket
import struct
import time
from typing import NamedTuple, NoReturn, Optional

from .._errors import ConnectionError, TimeoutError
from ..wire import VERSION

_MESSAGE = struct.Struct("<IHHIIQQ32x192s")
_MAGIC, _LAYOUT_VERSION = 0x4D534C43, 1
HELLO, GROW, RETIRE, SEGMENT, REFUSED = 1, 2, 3, 0x81, 0x82
_MAX_SPIN_US = 1_000_000

_WHY_NOT = {
    errno.ENOENT: "there is no socket: is clearanced running?",
    errno.ECONNREFUSED: "no process listens there: the daemon is gone",
    errno.EPROTOTYPE: "the socket there is not clearanced's",
    errno.EACCES: "the socket belongs to another user, or its folder is not accessible",
}


class Message(NamedTuple):
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


class ShmSocket:
    """A socket to a daemon. After the loss of the daemon, `dead` has the reason, and is empty before."""

    def __init__(self, target: str, deadline: float):
        """target: the socket's absolute path, and options after a question mark."""
        self.url = "shm://" + target
        self.dead = ""
        path, user = _options(target)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            self._connect(path, user, deadline)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        self._socket.close()

    def _connect(self, path: str, user: Optional[int], deadline: float) -> None:
        self._socket.settimeout(max(deadline - time.monotonic(), 1e-3))
        try:
            self._socket.connect(path)
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

    def say(self, kind: int, segment_id: int = 0, request_capacity: int = 0, reply_capacity: int = 0) -> bool:
        """Sends a message. Returns false if the socket does not take it."""
        message = Message(_MAGIC, _LAYOUT_VERSION, VERSION, kind, segment_id, request_capacity, reply_capacity, b"")
        self._socket.setblocking(False)
        try:
            return self._socket.send(_MESSAGE.pack(*message)) == _MESSAGE.size
        except OSError:
            return False

    def await_answer(self, deadline: float) -> tuple[Message, list[int]]:
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
                    self.die(str(error.strerror))
                was_reset = True
                continue
            except OSError as error:
                self.die(str(error.strerror))
            if not data:
                self.die("the daemon closed the connection")
            message = Message._make(_MESSAGE.unpack(data.ljust(_MESSAGE.size, b"\0")))
            if len(data) < 16 or message.magic != _MAGIC:
                self.die("what listens there is not clearanced")
            if message.kind == REFUSED:
                return message, list(fds)
            if (message.layout_version, message.wire_version) != (_LAYOUT_VERSION, VERSION):
                self.die("the daemon speaks another version of the shared-memory layout")
            if message.kind != SEGMENT:
                self.die("the daemon sent a message of unknown kind")
            return message, list(fds)

    def look(self) -> None:
        """Detects the loss of the daemon. Replies that it had posted can still be received."""
        self._socket.setblocking(False)
        try:
            data = self._socket.recv(_MESSAGE.size)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        message = Message._make(_MESSAGE.unpack(data.ljust(_MESSAGE.size, b"\0")))
        self.dead = f"{self.url}: " + (message.why() if message.kind == REFUSED else "the daemon is gone")

    def check(self) -> None:
        """Raises ConnectionError if the connection is lost."""
        if self.dead:
            raise ConnectionError(self.dead)

    def die(self, why: str) -> NoReturn:
        """Marks the connection as lost, and raises ConnectionError."""
        self.dead = f"{self.url}: {why}"
        raise ConnectionError(self.dead)


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
