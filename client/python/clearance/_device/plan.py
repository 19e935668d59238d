"""Queries with input and output in GPU memory, without copies to the host or synchronisation with it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Optional

import numpy as np

from .._arguments import did_you_mean
from .._words import COLUMNS, Column, row_shape

_DLPACK_CUDA, _DLPACK_KINDS = 2, {0: "i", 1: "u", 2: "f"}


class DeviceArray:
    """A column in GPU memory, with __cuda_array_interface__ for torch.as_tensor(), cupy.asarray(), ...

    A view of the plan's memory, which the next run overwrites. Keeps the plan alive.
    """

    def __init__(self, address: int, shape: tuple[int, ...], dtype: np.dtype, owner: Any):
        self.shape, self.dtype, self.address, self._owner = shape, dtype, address, owner
        self.__cuda_array_interface__ = {
            "shape": shape,
            "typestr": dtype.str,
            "descr": dtype.descr,
            "data": (address, False),
            "strides": None,
            "version": 3,
        }

    def __repr__(self) -> str:
        return f"<clearance.DeviceArray {self.shape} {self.dtype}>"


class DeviceRows:
    """The columns of a run as attributes: the arrays of `out` or the plan's memory, valid once the stream is done."""

    def __init__(self, columns: Mapping[str, Any]):
        self.__dict__.update(columns)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"the run wrote no column {name!r}{did_you_mean(name, list(self.__dict__))}")


class DevicePlan:
    """A callable query that reads its input from GPU memory and writes its columns to GPU memory.

    Created by Prepared.on_device(). Rows have the bits of Engine.distances(), except for pairs on which the GPU does
    not converge. Engine.distances() finishes these on the CPU; here they have the GPU's bounds, which are valid but may
    exceed the tolerance (Status.UNCONVERGED). The same holds for a reduced row with such a pair, which reduce="any"
    does not report as free. Other bodies keep the poses that they had at the plan's creation.
    """

    shape: tuple[int, ...]  #: shape of the rows: (K, P), or (K,) for a reduction; K is 1 for the current poses
    bodies: Optional[np.ndarray]  #: (M,) ids of the bodies that poses move, or None
    joints: Optional[np.ndarray]  #: (J,) ids of the joints that positions move, or None
    pairs: np.ndarray  #: (P, 2) body ids

    def __reduce__(self) -> Any:
        raise TypeError(f"a {type(self).__name__} cannot be pickled or copied: make it in each process")

    def __init__(
        self,
        module: Any,
        plan: Any,
        bodies: Optional[np.ndarray],
        pairs: np.ndarray,
        joints: Optional[np.ndarray] = None,
        reduced: bool = False,
    ):
        self._module, self._plan = module, plan
        configurations, count, mask = plan.shape
        self._setup(configurations, count, mask, bodies, pairs, joints, reduced)
        self._own: Optional[DeviceRows] = None
        self._own_addresses: list[int] = []

    def _setup(
        self,
        configurations: int,
        count: int,
        mask: int,
        bodies: Optional[np.ndarray],
        pairs: np.ndarray,
        joints: Optional[np.ndarray],
        reduced: bool,
    ) -> None:
        """Sets the attributes. mask: Field bits of its columns."""
        self.bodies, self.joints, self.pairs = bodies, joints, pairs
        self.shape = (configurations,) if reduced else (configurations, count)
        self._given_shapes = {
            "poses": None if bodies is None else (configurations, len(bodies), 7),
            "positions": None if joints is None else (configurations, len(joints)),
        }
        self._columns = {name: column for name, column in COLUMNS.items() if mask >> column.bit & 1}

    @property
    def device(self) -> int:
        """The GPU's number."""
        return self._plan.device

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the columns that it can write."""
        return tuple(self._columns)

    @property
    def poses_shape(self) -> tuple[int, int, int]:
        """(K, M, 7), the shape of its poses; M is 0 if it moves no bodies."""
        return (self.shape[0], 0 if self.bodies is None else len(self.bodies), 7)

    def column(self, name: str) -> Optional[Column]:
        """Returns a column by name, or None if the plan cannot write it."""
        return self._columns.get(name)

    @property
    def positions_shape(self) -> tuple[int, int]:
        """(K, J), the shape of its joint positions; J is 0 if it moves no joints."""
        return (self.shape[0], 0 if self.joints is None else len(self.joints))

    def run_at(self, poses: int, positions: int, columns: Mapping[int, int], stream: int) -> None:
        """Runs the query without checks. Arguments are addresses: of poses and positions (0 if unused), of columns by
        their bits (others are not written), and of a cudaStream_t."""
        self._plan.run(poses, positions, _addresses(columns), stream)

    def __call__(
        self,
        poses: Any = None,
        out: Optional[Mapping[str, Any]] = None,
        stream: Any = None,
        *,
        positions: Any = None,
    ) -> DeviceRows:
        """Launches the query in a stream and returns.

        poses: (K, M, 7) float64 in C order, in GPU memory: [x, y, z, qw, qx, qy, qz] of each body; None for a plan that
            moves no bodies. Any object with __cuda_array_interface__ or __dlpack__.
        positions: (K, J) float64 likewise: radians and metres of the plan's joints; None for a plan without joints.
        out: {name: array} for some of the plan's columns, in GPU memory, C order and the column's type. Shapes are
            `shape` plus the shape of a row ((J,) for gradient_joints). Default: the plan's memory, which its next run
            overwrites.
        stream: the address of a cudaStream_t, or an object with it as `cuda_stream` (PyTorch) or `ptr` (CuPy). Default:
            the default stream.

        Neither synchronises with the host nor allocates memory, so a CUDA graph can capture a call. The caller must
        order runs in different streams. Raises TypeError or ValueError naming the argument, and QueryError for an error
        of the GPU.
        """
        given = [self._given(poses, "poses", "bodies"), self._given(positions, "positions", "joints")]
        if out is None:
            rows, addresses = self._own_rows()
        else:
            addresses = self._addresses_of(out)
            rows = DeviceRows(out)
        self._plan.run(*given, addresses, address_of_stream(stream))
        return rows

    def _given(self, array: Any, what: str, moved: str) -> int:
        shape = self._given_shapes[what]
        if shape is not None:
            return self._address(array, what, np.dtype("<f8"), shape)
        if array is not None:
            raise ValueError(f"{what}: the plan has no {moved} that they move")
        return 0

    def _own_rows(self) -> tuple[DeviceRows, list[int]]:
        if self._own is None:
            self._own_addresses = addresses = self._plan.own_columns()
            self._own = DeviceRows(
                {
                    name: DeviceArray(addresses[c.bit], self._shape_of(name, c), c.dtype, self._plan)
                    for name, c in self._columns.items()
                }
            )
        return self._own, self._own_addresses

    def _addresses_of(self, out: Mapping[str, Any]) -> list[int]:
        return _addresses({self._columns[name].bit: at for name, at in self._addresses_by_name(out).items()})

    def _addresses_by_name(self, out: Mapping[str, Any]) -> dict[str, int]:
        if not isinstance(out, Mapping):
            raise TypeError(f"out: expected a dict of arrays, got {type(out).__name__}")
        at = {}
        for name, array in out.items():
            column = self._columns.get(name)
            if column is None:
                raise ValueError(f"out: the plan has no column {name!r}{did_you_mean(name, list(self._columns))}")
            at[name] = self._address(array, f"out[{name!r}]", column.dtype, self._shape_of(name, column))
        return at

    def _shape_of(self, name: str, column: Column) -> tuple[int, ...]:
        return self.shape + row_shape(name, 0 if self.joints is None else len(self.joints))

    def _address(self, array: Any, what: str, dtype: np.dtype, shape: tuple[int, ...]) -> int:
        address, got_shape, got_dtype = self._memory_of(array, what)
        if got_dtype != dtype:
            raise TypeError(f"{what}: expected {dtype}, got {got_dtype}")
        if got_shape != shape:
            raise ValueError(f"{what}: expected shape {shape}, got {got_shape}")
        return address

    def _memory_of(self, array: Any, what: str) -> tuple[int, tuple[int, ...], np.dtype]:
        """Returns address, shape and type of an array in C order in this GPU's memory."""
        try:
            interface = array.__cuda_array_interface__
        except AttributeError:
            interface = None
        if interface is not None:
            shape, dtype = tuple(interface["shape"]), np.dtype(interface["typestr"])
            strides = interface.get("strides")
            if strides is not None and tuple(strides) != _strides_in_c_order(shape, dtype.itemsize):
                raise ValueError(f"{what}: expected C order, got strides {tuple(strides)}")
            return int(interface["data"][0]), shape, dtype
        if not hasattr(array, "__dlpack__"):
            raise TypeError(
                f"{what}: expected an array in a GPU's memory (__cuda_array_interface__ or __dlpack__), "
                f"got {type(array).__name__}"
            )
        address, shape, code, bits, kind, number = self._module.exported_array(array)
        if kind != _DLPACK_CUDA or number != self.device:
            raise ValueError(f"{what}: expected memory of CUDA device {self.device}")
        return address, shape, np.dtype(f"<{_DLPACK_KINDS.get(code, 'V')}{bits // 8}")


def _addresses(by_bit: Mapping[int, int]) -> list[int]:
    return [by_bit.get(bit, 0) for bit in range(1 + max(column.bit for column in COLUMNS.values()))]


def _strides_in_c_order(shape: tuple[int, ...], itemsize: int) -> tuple[int, ...]:
    strides = []
    for size in reversed(shape):
        strides.append(itemsize)
        itemsize *= size
    return tuple(reversed(strides))


def address_of_stream(stream: Any) -> int:
    """Returns the address of a cudaStream_t, or 0 for the default stream."""
    if stream is None:
        return 0
    for name in ("cuda_stream", "ptr", "handle"):
        stream = getattr(stream, name, stream)
    if isinstance(stream, bool) or not isinstance(stream, int):
        raise TypeError(f"stream: expected the address of a CUDA stream or a stream's object, got {stream!r}")
    return stream
