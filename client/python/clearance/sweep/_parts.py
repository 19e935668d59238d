"""Atomic writing of files: parts as Parquet, and other files that a run writes once."""

from __future__ import annotations

import hashlib
import os
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Callable

import numpy as np

from ._errors import SweepError

TEMPORARY = ".tmp"  #: suffix of the names of incomplete files
_BLOCK = 1 << 20


def write_whole(path: Path, write: Callable[[Any], None]) -> None:
    """Writes a file under another name, syncs and renames it, so that a kill never leaves an incomplete file."""
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
    """Removes the incomplete files of a killed run."""
    for path in folder.glob(f".*{TEMPORARY}"):
        path.unlink()


def digest_of_file(path: Path) -> str:
    """Returns the SHA-256 of a file, in hexadecimal."""
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        while block := file.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()


def part_name(part: int) -> str:
    return f"part-{part:08d}.parquet"


def encoded(columns: Mapping[str, np.ndarray]) -> bytes:
    """Returns columns as the bytes of a Parquet file, which are deterministic for one version of pyarrow."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.table({name: pa.array(column) for name, column in columns.items()})
    floats = [name for name, column in columns.items() if column.dtype.kind == "f"]
    # No dictionary for floats, which could merge NaNs of different bits; row numbers compress to almost nothing.
    encodings = {**dict.fromkeys(floats, "BYTE_STREAM_SPLIT"), "row": "DELTA_BINARY_PACKED"}
    words = [name for name in columns if name not in encodings]
    sink = pa.BufferOutputStream()
    pq.write_table(
        table, sink, compression="zstd", use_dictionary=words, column_encoding=encodings, row_group_size=len(table)
    )
    return sink.getvalue().to_pybytes()


def write_part(folder: Path, part: int, columns: Mapping[str, np.ndarray]) -> tuple[int, str]:
    """Writes a part. Returns its size in bytes and its SHA-256."""
    data = encoded(columns)
    write_whole(folder / part_name(part), lambda file: file.write(data))
    return len(data), hashlib.sha256(data).hexdigest()


def read_part(folder: Path, part: int, digest: str) -> dict[str, np.ndarray]:
    """Reads the columns of a part. Raises SweepError if the file has changed."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = folder / part_name(part)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SweepError(f"{path}: a part that was written cannot be read: {error.strerror}") from None
    if hashlib.sha256(data).hexdigest() != digest:
        raise SweepError(f"{path}: its contents differ from what was written")
    table = pq.read_table(pa.BufferReader(data))
    return {name: table.column(name).to_numpy() for name in table.column_names}
