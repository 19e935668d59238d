"""Files that are there whole or not at all: parts as Parquet, and whatever else a run writes once."""

from __future__ import annotations

import hashlib
import os
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Callable

import numpy as np

from ._errors import SweepError

TEMPORARY = ".tmp"  #: how names end while their files are written
_BLOCK = 1 << 20


def write_whole(path: Path, write: Callable[[Any], None]) -> None:
    """Writes a file under another name, has it stored, and renames it: a kill leaves it whole, or not there."""
    other = path.with_name(f".{path.name}.{os.getpid()}-{secrets.token_hex(4)}{TEMPORARY}")
    try:
        with open(other, "wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        os.replace(other, path)
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    except OSError as error:
        if other.exists():
            other.unlink()
        raise SweepError(f"{path}: cannot be written: {error.strerror or error}") from None


def remove_temporary(folder: Path) -> None:
    """Removes what a killed run has left half written."""
    for path in folder.glob(f".*{TEMPORARY}"):
        path.unlink()


def digest_of_file(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        while block := file.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()


def part_name(part: int) -> str:
    return f"part-{part:08d}.parquet"


def encoded(columns: Mapping[str, np.ndarray]) -> bytes:
    """Columns as the bytes of a Parquet file: the same columns give the same bytes, by the same version of pyarrow."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.table({name: pa.array(column) for name, column in columns.items()})
    floats = [name for name, column in columns.items() if column.dtype.kind == "f"]
    # Floats keep their bits (a dictionary might take one NaN for another); numbers of rows shrink to nothing.
    encodings = {**dict.fromkeys(floats, "BYTE_STREAM_SPLIT"), "row": "DELTA_BINARY_PACKED"}
    words = [name for name in columns if name not in encodings]
    sink = pa.BufferOutputStream()
    pq.write_table(
        table, sink, compression="zstd", use_dictionary=words, column_encoding=encodings, row_group_size=len(table)
    )
    return sink.getvalue().to_pybytes()


def write_part(folder: Path, part: int, columns: Mapping[str, np.ndarray]) -> tuple[int, str]:
    """Writes a part; its size in bytes and its SHA-256."""
    data = encoded(columns)
    write_whole(folder / part_name(part), lambda file: file.write(data))
    return len(data), hashlib.sha256(data).hexdigest()


def read_part(folder: Path, part: int, digest: str) -> dict[str, np.ndarray]:
    """The columns of a part. Raises SweepError if its bytes are not those that were written."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = folder / part_name(part)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SweepError(f"{path}: a part that was written cannot be read: {error.strerror}") from None
    if hashlib.sha256(data).hexdigest() != digest:
        raise SweepError(f"{path}: its bytes are not those that were written")
    table = pq.read_table(pa.BufferReader(data))
    return {name: table.column(name).to_numpy() for name in table.column_names}
