"""Plans of a daemon: queries that its GPU answers in memory that this process maps."""

from __future__ import annotations

import weakref
from collections.abc import Mapping
from typing import Any, Optional

import numpy as np

from ._cuda_driver import Driver, driver_for
from ._device_plan import DeviceArray, DevicePlan, DeviceRows, address_of_stream

_F64 = np.dtype("<f8")


class RemotePlan(DevicePlan):
    """A query that the daemon's GPU answers from numbers in its memory to columns there, each time it is called.

    Made by Client.plan_on_device(). The memory is the daemon's, mapped here by the CUDA driver: `poses`, `positions`
    and the columns are arrays for whoever takes __cuda_array_interface__ (PyTorch, CuPy, JAX, Numba, Warp). Its rows
    are those of a DevicePlan, bit for bit. A call returns once they are there. Also a context manager that closes it.
    """

    #: (K, M, 7) float64, where the poses go; None: it moves no bodies. Written there, they need no copy.
    poses: Optional[DeviceArray]
    #: (K, J) float64, where the positions of joints go; None: it has none.
    positions: Optional[DeviceArray]
    scene_revision: int  #: of the scene that it keeps
    snapshot_revision: int  #: of the poses of what it does not move

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
        # What views the memory keeps it mapped, and the daemon's plan open.
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
        """Has the daemon answer, and returns once the rows are there.

        poses: (K, M, 7) float64 in C order: [x, y, z, qw, qx, qy, qz] of each body; in the GPU's memory, by
            __cuda_array_interface__, or of numpy. Copied to the plan's `poses`, unless it is that array; None: those
            that are there.
        positions: (K, J) float64 likewise: radians and metres of the plan's joints.
        out: {name: array}, some of the plan's columns, to which rows are copied within the GPU; None: the plan's own
            memory, which its next run writes again.
        stream: whose work writes poses and positions, as DevicePlan has it: the call waits for it; None: for all that
            this process has asked of the GPU.
        timeout_s: None: the client's. If it passes, the run goes on, and the next call raises RequestError (BUSY) until
            it is over.
        check_scene: whether to refuse (QueryError, WRONG_SCENE) where the daemon has another scene than the plan's.

        Raises TypeError or ValueError naming the argument, and as distances().
        """
        mapping = self._mapping.use()
        # All is checked before anything is copied.
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
        """Gives the memory back: arrays that view it must not be used any more."""
        self._mapping.close()

    def __enter__(self) -> RemotePlan:
        return self

    def __exit__(self, *exception: Any) -> None:
        self.close()

    def _source(self, array: Any, what: str, moved: str) -> Optional[tuple[int, bool, Any]]:
        """Address, whether it is the host's, and what keeps it; None: what is there is meant."""
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
    """The daemon's memory here, as long as somebody holds it or until it is closed."""

    def __init__(self, driver: Driver, address: int, plan: Any):
        self._plan: Any = plan
        # Before the plan is let go: CUDA does not say what becomes of a mapping whose memory goes first.
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
