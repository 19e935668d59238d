"""Device plans as XLA custom calls, through XLA's C interface for foreign functions and ctypes.

The interface is xla/ffi/api/c_api.h (OpenXLA, major version 0), part of jaxlib. Structures start with their size and
only grow at the end; another layout has another major version, which is rejected.
"""

from __future__ import annotations

import ctypes
import itertools
import weakref
from ctypes import POINTER, c_char_p, c_int, c_int32, c_int64, c_size_t, c_uint32, c_void_p
from typing import Any

from .plan import DevicePlan

TARGET = "clearance_plan"

_MAJOR, _MINOR = 0, 1  # the oldest version with everything used here
_INTERNAL = 13  # XLA_FFI_Error_Code_INTERNAL
_METADATA = 1  # XLA_FFI_Extension_Metadata
_EXECUTE = 3  # XLA_FFI_ExecutionStage_EXECUTE


def _structure(name: str, *fields: tuple[str, Any]) -> type[ctypes.Structure]:
    return type(name, (ctypes.Structure,), {"_fields_": fields})


_HEAD = (("size", c_size_t), ("extension", c_void_p))
_Version = _structure("_Version", *_HEAD, ("major", c_int), ("minor", c_int))
_Extension = _structure("_Extension", ("size", c_size_t), ("type", c_int32), ("next", c_void_p), ("metadata", c_void_p))
_Metadata = _structure("_Metadata", ("size", c_size_t), ("version", _Version), ("traits", c_uint32))
_Buffer = _structure(
    "_Buffer", *_HEAD, ("dtype", c_int32), ("data", c_void_p), ("rank", c_int64), ("dims", POINTER(c_int64))
)
_Buffers = _structure("_Buffers", *_HEAD, ("count", c_int64), ("types", c_void_p), ("at", POINTER(POINTER(_Buffer))))
_Scalar = _structure("_Scalar", ("dtype", c_int32), ("value", POINTER(c_int64)))
_Attributes = _structure(
    "_Attributes",
    *_HEAD,
    ("count", c_int64),
    ("types", c_void_p),
    ("names", c_void_p),
    ("at", POINTER(POINTER(_Scalar))),
)
_Array = _structure("_Array", ("dtype", c_int32), ("count", c_size_t), ("data", POINTER(c_int64)))
_Api = _structure(
    "_Api", *_HEAD, ("version", _Version), ("internal", c_void_p), ("create_error", c_void_p), ("message_of", c_void_p),
    ("destroy_error", c_void_p), ("register", c_void_p), ("stream", c_void_p),
)  # fmt: skip
_Frame = _structure(
    "_Frame", *_HEAD, ("api", POINTER(_Api)), ("context", c_void_p), ("stage", c_int32), ("arguments", _Buffers),
    ("results", _Buffers), ("attributes", _Attributes),
)  # fmt: skip
_ErrorArguments = _structure("_ErrorArguments", *_HEAD, ("message", c_char_p), ("code", c_int32))
_MessageArguments = _structure("_MessageArguments", *_HEAD, ("error", c_void_p), ("message", c_char_p))
_StreamArguments = _structure("_StreamArguments", *_HEAD, ("context", c_void_p), ("stream", c_void_p))
_Handler = ctypes.CFUNCTYPE(c_void_p, POINTER(_Frame))

_plans: weakref.WeakValueDictionary[int, DevicePlan] = weakref.WeakValueDictionary()
_numbers = itertools.count(1)
_registered: dict[str, Any] = {}  # the handler of each platform; XLA can call it until the process ends


def number_of(plan: DevicePlan) -> int:
    """Returns the number that identifies the plan in calls, for the plan's lifetime."""
    number = next(_numbers)
    _plans[number] = plan
    return number


def register(platform: str) -> None:
    """Registers TARGET with XLA. platform: "CUDA", or "cpu" for fake device plans."""
    import jax

    if platform in _registered:
        return
    _registered[platform] = handler = _Handler(lambda frame: _handle(frame.contents, platform == "CUDA"))
    jax.ffi.register_ffi_target(TARGET, jax.ffi.pycapsule(ctypes.cast(handler, c_void_p).value), platform=platform)


def _handle(frame: Any, has_streams: bool) -> Any:
    extension = ctypes.cast(frame.extension, POINTER(_Extension))
    if extension and extension.contents.type == _METADATA:
        metadata = ctypes.cast(extension.contents.metadata, POINTER(_Metadata)).contents
        metadata.version.major, metadata.version.minor, metadata.traits = _MAJOR, _MINOR, 0
        return None
    try:
        if frame.stage == _EXECUTE:
            _run(frame, has_streams)
        return None
    except Exception as error:  # XLA expects every error as a result
        text = f"clearance: {error}".encode()
        arguments = _ErrorArguments(ctypes.sizeof(_ErrorArguments), None, text, _INTERNAL)
        return _function(frame.api.contents.create_error, c_void_p)(ctypes.byref(arguments))


def _run(frame: Any, has_streams: bool) -> None:
    # Attributes are in the order of their names: the columns' bits, and the plan.
    columns, plan_number = (frame.attributes.at[k] for k in range(2))
    bits = ctypes.cast(columns, POINTER(_Array)).contents
    plan = _plans.get(plan_number.contents.value[0])
    if plan is None:
        raise RuntimeError("the plan was deleted: keep it while functions compiled with it are called")
    addresses = {bits.data[k]: frame.results.at[k].contents.data for k in range(bits.count)}
    given = iter([frame.arguments.at[k].contents.data or 0 for k in range(frame.arguments.count)])
    poses = 0 if plan.bodies is None else next(given)
    positions = 0 if plan.joints is None else next(given)
    plan.run_at(poses, positions, addresses, _stream_of(frame) if has_streams else 0)


def _stream_of(frame: Any) -> int:
    api, arguments = frame.api.contents, _StreamArguments(ctypes.sizeof(_StreamArguments), None, frame.context, None)
    error = _function(api.stream, c_void_p)(ctypes.byref(arguments))
    if error:
        message = _MessageArguments(ctypes.sizeof(_MessageArguments), None, error, None)
        _function(api.message_of, None)(ctypes.byref(message))
        text = (message.message or b"").decode()
        destroyed = _MessageArguments(ctypes.sizeof(_MessageArguments) - ctypes.sizeof(c_char_p), None, error, None)
        _function(api.destroy_error, None)(ctypes.byref(destroyed))
        raise RuntimeError(f"no stream: {text}")
    return arguments.stream or 0


def _function(address: int, result: Any) -> Any:
    return ctypes.CFUNCTYPE(result, c_void_p)(address)
