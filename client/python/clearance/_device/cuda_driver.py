"""Access to GPU memory of another process, through the CUDA driver found at run time. No build requires CUDA.

Uses the device's primary context, like the CUDA runtime, and so shares it with PyTorch, CuPy and JAX.
"""

from __future__ import annotations

import contextlib
import ctypes
import threading
from collections.abc import Iterator
from typing import Any, Optional

from .._errors import ConnectionError

_LIBRARIES = ("libcuda.so.1", "libcuda.so")
_LAZY_PEER_ACCESS = 1


class _IpcHandle(ctypes.Structure):
    _fields_ = [("reserved", ctypes.c_char * 64)]


class _Uuid(ctypes.Structure):
    _fields_ = [("bytes", ctypes.c_char * 16)]


class Driver:
    """The required driver calls on one device. Raises ConnectionError with the call and the driver's message."""

    def __init__(self, library: Any, uuid: bytes):
        self._cuda = library
        self._cuda.cuIpcOpenMemHandle_v2.argtypes = [ctypes.POINTER(ctypes.c_uint64), _IpcHandle, ctypes.c_uint]
        self._check("cuInit", 0)
        count = ctypes.c_int()
        self._check("cuDeviceGetCount", ctypes.byref(count))
        for number in range(count.value):
            device = ctypes.c_int()
            self._check("cuDeviceGet", ctypes.byref(device), number)
            found = _Uuid()
            self._check("cuDeviceGetUuid", ctypes.byref(found), device)
            if ctypes.string_at(ctypes.byref(found), 16) == uuid:
                break
        else:
            raise ConnectionError(
                f"the plan's memory is on the GPU {uuid.hex()}, which is none of the {count.value} that this process "
                "sees (CUDA_VISIBLE_DEVICES?)"
            )
        #: The device's number in this process.
        self.number: int = number
        self._context = ctypes.c_void_p()
        self._check("cuDevicePrimaryCtxRetain", ctypes.byref(self._context), device)

    def _check(self, name: str, *arguments: Any) -> None:
        code = getattr(self._cuda, name)(*arguments)
        if code == 0:
            return
        words = ctypes.c_char_p()
        self._cuda.cuGetErrorString(code, ctypes.byref(words))
        raise ConnectionError(f"CUDA: {name}: {(words.value or b'error').decode()} ({code})")

    @contextlib.contextmanager
    def _here(self) -> Iterator[None]:
        self._check("cuCtxPushCurrent_v2", self._context)
        try:
            yield
        finally:
            self._cuda.cuCtxPopCurrent_v2(ctypes.byref(ctypes.c_void_p()))

    def open(self, handle: bytes) -> int:
        """Maps another process's memory, and returns its address."""
        at = ctypes.c_uint64()
        with self._here():
            self._check(
                "cuIpcOpenMemHandle_v2", ctypes.byref(at), _IpcHandle.from_buffer_copy(handle), _LAZY_PEER_ACCESS
            )
        return at.value

    def close(self, address: int) -> None:
        with self._here():
            self._check("cuIpcCloseMemHandle", ctypes.c_uint64(address))

    def copy(self, to: int, source: int, size: int, from_host: bool = False) -> None:
        """Copies bytes to device memory, and returns after completion."""
        with self._here():
            if from_host:
                self._check("cuMemcpyHtoD_v2", ctypes.c_uint64(to), ctypes.c_void_p(source), ctypes.c_size_t(size))
            else:
                self._check("cuMemcpyDtoD_v2", ctypes.c_uint64(to), ctypes.c_uint64(source), ctypes.c_size_t(size))
            self._check("cuCtxSynchronize")

    def wait(self, stream: Optional[int]) -> None:
        """Waits for the work in a stream or, with None, for all work of this process on the device."""
        with self._here():
            if stream is None:
                self._check("cuCtxSynchronize")
            else:
                self._check("cuStreamSynchronize", ctypes.c_void_p(stream))


_drivers: dict[bytes, Driver] = {}
_lock = threading.Lock()


def driver_for(uuid: bytes) -> Driver:
    """Returns the driver for the device of that UUID. Raises ConnectionError if there is none."""
    with _lock:
        if uuid not in _drivers:
            _drivers[uuid] = Driver(_load(), uuid)
        return _drivers[uuid]


def _load() -> Any:
    why = ""
    for name in _LIBRARIES:
        try:
            return ctypes.CDLL(name)
        except OSError as error:
            why = why or str(error)
    raise ConnectionError(f"the CUDA driver, by which a plan's memory is mapped, cannot be loaded: {why}")
