"""The key `rows` of a job: the generator of the rows and its arguments."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Optional, Union

import numpy as np

from .._arguments import to_bool, to_count, to_list, to_number_from_0, to_path
from ._edges import Edges, write_edges
from ._errors import JobError
from ._generators import _PRIMES, ArrayFile, Box, Grid, Halton, ParquetFile, Rows, Uniform
from ._keys import Keys, to_names, to_positive

KINDS = ("uniform", "halton", "grid", "file", "edges")
_MOST_ROWS = 1 << 53


@dataclass(frozen=True)
class Space:
    """The moving joints of a job with their limits, or its moving bodies."""

    names: tuple[str, ...]
    width: int  #: numbers per configuration: J, or 7 per body
    lower: Optional[np.ndarray]  #: (J,), or None for bodies
    upper: Optional[np.ndarray]

    def box(self, what: str) -> Box:
        """Raises JobError for a joint without limits."""
        assert self.lower is not None and self.upper is not None
        for name, lower, upper in zip(self.names, self.lower, self.upper):
            if not (math.isfinite(lower) and math.isfinite(upper)):
                raise JobError(f"{what}: joint {name!r} has no limits; expected limits: {{{name}: [lower, upper]}}")
        return Box(self.lower, self.upper)


@dataclass(frozen=True)
class Source:
    """One kind of rows of a job."""

    kind: str
    what: str  #: its name in errors
    options: Mapping[str, Any]
    motions: bool
    nodes: Optional[Source] = None  #: nodes of edges

    def rows(self, space: Space, folder: Path) -> Rows:
        """Creates the generator. Edges are first computed and written into `folder`."""
        o = self.options
        if self.kind == "file":
            kind = ParquetFile if o["path"].suffix == ".parquet" else ArrayFile
            more = {"columns": o["columns"]} if kind is ParquetFile else {}
            return kind(o["path"], space.width, self.motions, self.what, **more)
        if self.kind == "edges":
            return self._edges(space, folder)
        box = space.box(self.what)
        if self.kind == "uniform":
            return Uniform(box, o["count"], o["seed"])
        if self.kind == "halton":
            if space.width > len(_PRIMES):
                raise JobError(f"{self.what}: expected at most {len(_PRIMES)} joints, got {space.width}")
            return Halton(box, o["count"], o["first"])
        return self._grid(box, space)

    def _grid(self, box: Box, space: Space) -> Grid:
        counts = self.options["counts"]
        if isinstance(counts, int):
            counts = [counts] * space.width
        if len(counts) != space.width:
            raise JobError(f"{self.what}.counts: expected one for each of {space.width} joints, got {len(counts)}")
        grid = Grid(box, tuple(counts))
        if grid.count >= _MOST_ROWS:
            raise JobError(f"{self.what}.counts: expected fewer than 2**53 rows, got {grid.count}")
        return grid

    def _edges(self, space: Space, folder: Path) -> Edges:
        assert self.nodes is not None
        nodes = self.nodes.rows(space, folder)
        made = {key: value for key, value in self.nodes.options.items() if key != "path"}
        named = json.dumps([self.nodes.kind, made, nodes.identity(), dict(self.options)], sort_keys=True)
        name = hashlib.sha256(named.encode()).hexdigest()[:16]
        path = folder / f"edges-{name}.npy"
        write_edges(nodes, self.options["nearest"], self.options["radius"], path, self.what)
        return Edges(nodes, path)


def read_rows(keys: Keys, folder: Path, bodies: bool, nodes: bool = False) -> Source:
    """Reads the key `rows` or, for edges, the key `of`."""
    kinds = tuple(kind for kind in KINDS if not (nodes and kind == "edges"))
    kind = keys.one_of(*kinds, only=True)
    what = keys.at(kind)
    if bodies and kind in ("uniform", "halton", "grid"):
        raise JobError(f"{what}: draws positions of joints; of bodies expected file, or edges of one")
    own = keys.map(kind)
    options: dict[str, Any] = {}
    motions, inner = kind == "edges", None
    if kind == "uniform":
        options = {"count": own.take("count", _rows), "seed": own.take("seed", to_count, 0)}
    elif kind == "halton":
        options = {"count": own.take("count", _rows), "first": own.take("first", to_count, 0)}
    elif kind == "grid":
        options = {"counts": own.take("counts", _counts)}
    elif kind == "file":
        options, motions = _file(own, folder, nodes)
    else:
        inner = read_rows(own.map("of"), folder, bodies, nodes=True)
        options = {
            "nearest": own.take("nearest", to_positive),
            "radius": own.take("radius", to_number_from_0, math.inf),
        }
    own.finish()
    return Source(kind, what, options, motions, inner)


def _file(own: Keys, folder: Path, nodes: bool) -> tuple[dict[str, Any], bool]:
    path = own.take("path", lambda value, what: folder / to_path(value, what))
    if path.suffix not in (".npy", ".parquet"):
        raise JobError(f"{own.at('path')}: expected a file that ends in .npy or .parquet, got {path.name!r}")
    if not path.is_file():
        raise JobError(f"{own.at('path')}: there is no file {path}")
    columns = own.take("columns", to_names, None)
    if columns is not None and path.suffix == ".npy":
        raise JobError(f"{own.at('columns')}: are of Parquet, and {path.name} is an array")
    motions = False if nodes else own.take("motions", to_bool, False)
    return {"path": path, "columns": columns}, motions


def _rows(value: Any, what: str) -> int:
    count = to_positive(value, what)
    if count >= _MOST_ROWS:
        raise ValueError(f"{what}: expected fewer than 2**53 rows, got {count}")
    return count


def _counts(value: Any, what: str) -> Union[int, list[int]]:
    if isinstance(value, (list, tuple)):
        return [to_positive(item, f"{what}[{i}]") for i, item in enumerate(to_list(value, what, "integers"))]
    return to_positive(value, what)
