"""Plans of a daemon: queries on its GPU, in memory that this process maps."""

from __future__ import annotations

import weakref
from collections.abc import Mapping
from typing import Any, Optional

import numpy as np

from .cuda_driver import Driver, driver_for
from .plan import DeviceArray, DevicePlan, DeviceRows, address_of_stream

_F64 = np.dtype("<f8")


class RemotePlan(DevicePlan):
    """A callable query that runs on the daemon's GPU, with input and columns in the daemon's GPU memory.

    Created by Prepared.on_device() of a client. The CUDA driver maps the memory into this process: `poses`,
    `positions` and the columns have __cuda_array_interface__ (PyTorch, CuPy, JAX, Numba, Warp). Rows have the bits of
    a DevicePlan. A call returns when its rows are complete. Also a context manager that closes the plan.
    """

    #: (K, M, 7) float64, the poses of the next call, or None if it moves no bodies. Writing here saves a copy.
    poses: Optional[DeviceArray]
    #: (K, J) float64, the joint positions of the next call, or None if it moves no joints.
    positions: Optional[DeviceArray]
    scene_revision: int  #: of the scene that it keeps
    snapshot_revision: int  #: of the poses of the bodies that it does not move

    def __init__(
        self,
        plan: Any,
        bodies: Optional[np.ndarray],
        pairs: np.ndarray,
        joints: Optional[np.ndarray],
        reduced: bool,
        driver: Any = driver_for,
    ):
        handle, uuid, _, poses_at, positions_at, configurations, count, columns, scene, snapshot = plan.info
        self._setup(configurations, count, sum(field for field, _, _ in columns), bodies, pairs, joints, reduced)
        self.scene_revision, self.snapshot_revision = scene, snapshot
        self._driver: Driver = driver(uuid)
        address = self._driver.open(handle)
        # Every view of the memory keeps it mapped, and the daemon's plan open.
        self._mapping = _Mapping(self._driver, address, plan)
        offsets = {field: offset for field, _, offset in columns}

        def array(offset: int, shape: Optional[tuple[int, ...]], dtype: Any = _F64) -> Optional[DeviceArray]:
            return None if shape is None else DeviceArray(address + offset, shape, dtype, self._mapping)

        self.poses = array(poses_at, self._given_shapes["poses"])
        self.positions = array(positions_at, self._given_shapes["positions"])
        self._rows: dict[str, Any] = {
            name: array(offsets[1 << column.bit], self._shape_of(name, column), column.dtype)
            for name, column in self._columns.items()
        }

    @property
    def device(self) -> int:
        """The GPU's number in this process."""
        return self._driver.number

    def run_at(self, poses: int, positions: int, columns: Mapping[int, int], stream: int) -> None:
        raise TypeError("a daemon's plan answers in its own memory: call it")

    def __call__(
        self,
        poses: Any = None,
        out: Optional[Mapping[str, Any]] = None,
        stream: Any = None,
        *,
        positions: Any = None,
        timeout_s: Optional[float] = None,
        check_scene: bool = True,
    ) -> DeviceRows:
        """Runs the query in the daemon, and returns when the rows are complete.

        poses: (K, M, 7) float64 in C order: [x, y, z, qw, qx, qy, qz] of each body, a numpy array or in GPU memory with
            __cuda_array_interface__. Copied to the plan's `poses` unless it is that array. Default: the current values
            of `poses`.
        positions: (K, J) float64 likewise: radians and metres of the plan's joints.
        out: {name: array} for some of the plan's columns; rows are copied there within the GPU. Default: the plan's
            memory, which its next run overwrites.
        stream: the stream that writes poses and positions, as in DevicePlan; the call waits for it. Default: the call
            waits for all work of this process on the GPU.
        timeout_s: seconds. Default: the client's timeout. After a timeout the run continues, and calls raise
            RequestError (BUSY) until it ends.
        check_scene: whether to raise QueryError (WRONG_SCENE) if the daemon's scene differs from the plan's.

        Raises TypeError or ValueError naming the argument, and as distances().
        """
        mapping = self._mapping.use()
        # Every check precedes the first copy.
        given = [self._source(poses, "poses", "bodies"), self._source(positions, "positions", "joints")]
        wanted = None if out is None else self._addresses_by_name(out)
        address = address_of_stream(stream)
        self._driver.wait(None if stream is None else address)
        for source, to in zip(given, (self.poses, self.positions)):
            if source is not None and to is not None:
                at, from_host, _ = source
                size = int(np.prod(to.shape)) * to.dtype.itemsize
                if at != to.address:
                    self._driver.copy(to.address, at, size, from_host)
        mapping.run(timeout_s, check_scene)
        if wanted is None:
            return DeviceRows(self._rows)
        for name, at in wanted.items():
            row: DeviceArray = self._rows[name]
            self._driver.copy(at, row.address, int(np.prod(row.shape)) * row.dtype.itemsize)
        return DeviceRows(out or {})

    def close(self) -> None:
        """Releases the memory. Arrays that view it become invalid."""
        self._mapping.close()

    def __enter__(self) -> RemotePlan:
        return self

    def __exit__(self, *exception: Any) -> None:
        self.close()

    def _source(self, array: Any, what: str, moved: str) -> Optional[tuple[int, bool, Any]]:
        """Returns the address, whether it is host memory, and its owner; None to use the plan's current values."""
        shape = self._given_shapes[what]
        if array is None:
            return None
        if shape is None:
            raise ValueError(f"{what}: the plan has no {moved} that they move")
        if isinstance(array, np.ndarray):
            if array.dtype != _F64:
                raise TypeError(f"{what}: expected {_F64}, got {array.dtype}")
            if array.shape != shape:
                raise ValueError(f"{what}: expected shape {shape}, got {array.shape}")
            kept = np.ascontiguousarray(array)
            return kept.ctypes.data, True, kept
        return self._address(array, what, _F64, shape), False, array

    def _memory_of(self, array: Any, what: str) -> tuple[int, tuple[int, ...], np.dtype]:
        if not hasattr(array, "__cuda_array_interface__"):
            raise TypeError(
                f"{what}: expected an array in a GPU's memory (__cuda_array_interface__), got {type(array).__name__}"
            )
        return super()._memory_of(array, what)


class _Mapping:
    """The mapping of the daemon's memory, released by close() or with its last reference."""

    def __init__(self, driver: Driver, address: int, plan: Any):
        self._plan: Any = plan
        # Unmaps before the plan closes: CUDA does not define a mapping whose memory is freed first.
        self._unmap = weakref.finalize(self, driver.close, address)
        self._unmap.atexit = False  # the process's end does it

    def use(self) -> Any:
        if not self._unmap.alive:
            raise ValueError("this plan is closed")
        return self._plan

    def close(self) -> None:
        if self._unmap.alive:
            self._unmap()
            self._plan.close()
