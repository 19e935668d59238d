"""Edges of a roadmap: each node and its nearest ones, computed once by the driver and read by all workers."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Optional

import numpy as np

from ._errors import JobError, SweepError
from ._generators import Rows
from ._parts import digest_of_file, write_whole

_AT_ONCE = 65536  # nodes per search for neighbours


@dataclass
class Edges:
    """Motions between nodes, from an (E, 2) uint32 file in the output folder, lower node first."""

    nodes: Rows
    path: Path
    motions = True
    _pairs: Optional[np.ndarray] = field(default=None, repr=False)

    def __post_init__(self) -> None:
        try:
            self._pairs = np.load(self.path, mmap_mode="r", allow_pickle=False)
        except (OSError, ValueError) as error:
            raise SweepError(f"{self.path}: the edges cannot be read: {error}") from None

    @property
    def width(self) -> int:
        return self.nodes.width

    @property
    def count(self) -> int:
        return 0 if self._pairs is None else len(self._pairs)

    def at(self, index: np.ndarray) -> np.ndarray:
        assert self._pairs is not None
        pairs = self._pairs[index].astype(np.int64)
        return self.nodes.at(pairs.ravel()).reshape(-1, 2, self.width)

    def identity(self) -> dict[str, Any]:
        return {"nodes": self.nodes.identity(), "edges": digest_of_file(self.path)}

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_pairs": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.__post_init__()


def write_edges(nodes: Rows, nearest: int, radius: float, path: Path, what: str) -> None:
    """Writes the pairs of each node with its `nearest` others within `radius`, each pair once.

    Distances are Euclidean in radians and metres. Keeps all nodes and a tree in memory.
    """
    if path.exists():
        return
    try:
        from scipy.spatial import cKDTree
    except ImportError:
        raise JobError(
            f"{what}: needs the package scipy (pip install 'WHEEL[ray]', where WHEEL is the file clearance-*.whl)"
        ) from None
    if nodes.count >= 1 << 32:
        raise JobError(f"{what}.of: expected fewer than 2**32 nodes, got {nodes.count}")
    if nodes.count <= nearest:
        raise JobError(f"{what}.nearest: expected fewer than there are nodes ({nodes.count}), got {nearest}")
    starts = range(0, nodes.count, _AT_ONCE)
    all_nodes = np.concatenate([nodes.at(np.arange(i, min(i + _AT_ONCE, nodes.count))) for i in starts])
    tree = cKDTree(all_nodes)
    found: list[np.ndarray] = []
    for first in starts:
        some = all_nodes[first : first + _AT_ONCE]
        far, near = tree.query(some, k=nearest + 1, workers=-1)
        own = np.arange(first, first + len(some), dtype=np.int64)[:, None]
        use = (near != own) & (far <= radius)  # the nearest is the node itself, or one at the same position
        low, high = np.minimum(near, own), np.maximum(near, own)
        found.append((low << 32 | high)[use])
    pairs = np.unique(np.concatenate(found))
    if not len(pairs):
        raise JobError(f"{what}.radius: no two nodes are as near as {radius}; expected a larger one")
    array = np.stack([pairs >> 32, pairs & 0xFFFFFFFF], axis=1).astype(np.uint32)
    os.makedirs(path.parent, exist_ok=True)
    write_whole(path, lambda file: np.save(file, array))
