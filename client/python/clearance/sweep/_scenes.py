"""A scene as one bytes object, sent once to each worker."""

from __future__ import annotations

import hashlib
import io
import tarfile
import tempfile
from dataclasses import dataclass
from pathlib import Path

from .._scene.scene import Scene


@dataclass(frozen=True)
class Packed:
    """A scene with its files, and their SHA-256 as its name."""

    digest: str
    data: bytes


def pack(scene: Scene) -> Packed:
    """Packs the files of Scene.save() by name, without times and owners, so that equal scenes give equal bytes."""
    archive = io.BytesIO()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "scene"
        scene.save(folder)
        with tarfile.open(fileobj=archive, mode="w", format=tarfile.PAX_FORMAT) as tar:
            for path in sorted(path for path in folder.rglob("*") if path.is_file()):
                entry = tarfile.TarInfo(path.relative_to(folder).as_posix())
                entry.size = path.stat().st_size
                with open(path, "rb") as file:
                    tar.addfile(entry, file)
    data = archive.getvalue()
    return Packed(hashlib.sha256(data).hexdigest(), data)


def unpack(packed: Packed) -> Scene:
    """Unpacks a scene, with the ids, pairs and bits of answers of the packed one."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name).resolve()
        with tarfile.open(fileobj=io.BytesIO(packed.data)) as tar:
            for entry in tar:
                path = folder / entry.name
                source = tar.extractfile(entry)
                if source is None or folder not in path.resolve().parents:
                    raise ValueError(f"a packed scene holds {entry.name!r}, which is no file of its own")
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(source.read())
        return Scene.load(folder / "scene.yaml")
