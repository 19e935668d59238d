"""The journal of a run, with a line per event, and the manifest of its result.

The journal contains machines and times, and so differs between runs; parts and manifest do not.
"""

from __future__ import annotations

import fcntl
import json
import os
from dataclasses import asdict
from typing import Any

from ._errors import SweepError
from ._parts import digest_of_file, part_name, remove_temporary, write_whole
from ._plan import Plan
from ._work import Checked, Done


class Journal:
    """The complete parts by number, and the checked ones. Locked by one run at a time."""

    def __init__(self, plan: Plan):
        """Opens or creates the journal, and drops parts whose files have changed.

        Raises SweepError if another run holds the lock, or the journal belongs to another job.
        """
        self._plan = plan
        self._path = plan.output / "journal.jsonl"
        self.done: dict[int, Done] = {}
        self.makers: dict[int, str] = {}  #: the machine that made each part
        self.checked: set[int] = set()
        self._file = open(self._path, "a+b")  # noqa: SIM115  # stays open as the lock
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._file.close()
            raise SweepError(f"{plan.output}: another run is writing there") from None
        try:
            self._read()
        except BaseException:
            self.close()
            raise
        remove_temporary(plan.spec.folder)
        remove_temporary(plan.output)

    def _read(self) -> None:
        self._file.seek(0)
        whole = 0
        for number, line in enumerate(self._file):
            try:
                entry = json.loads(line) if line.endswith(b"\n") else None
            except ValueError:
                entry = None
            if not isinstance(entry, dict):
                break  # a line that was truncated by a kill is the last one
            whole += len(line)
            if number == 0:
                self._compare(entry)
            else:
                self._take(entry)
        self._file.truncate(whole)
        if not whole:
            self._write({"header": self._plan.header})
        for part in [part for part, done in self.done.items() if not self._is_whole(done)]:
            self._forget(part)

    def _compare(self, entry: dict[str, Any]) -> None:
        header, ours = entry.get("header"), json.loads(json.dumps(self._plan.header))
        if header == ours:
            return
        differs = [key for key in ours if not isinstance(header, dict) or header.get(key) != ours[key]]
        raise SweepError(
            f"{self._plan.output}: holds the result of another job ({', '.join(differs)} differ); "
            "expected a new folder, or the same job, scene and versions"
        )

    def _take(self, entry: dict[str, Any]) -> None:
        if "done" in entry:
            done = Done(**entry["done"])
            self.done[done.part], self.makers[done.part] = done, entry["by"]
        elif "checked" in entry:
            self.checked.add(entry["checked"])
        elif "dropped" in entry:
            self._forget(entry["dropped"])

    def _is_whole(self, done: Done) -> bool:
        path = self._plan.spec.folder / part_name(done.part)
        return path.is_file() and path.stat().st_size == done.size and digest_of_file(path) == done.digest

    def _forget(self, part: int) -> None:
        self.done.pop(part, None)
        self.checked.discard(part)

    def add(self, done: Done, machine: str) -> None:
        """Records a complete part."""
        self.done[done.part], self.makers[done.part] = done, machine
        self._write({"done": asdict(done), "by": machine})

    def add_check(self, checked: Checked, machine: str) -> None:
        """Records that the check of a part found equal rows."""
        self.checked.add(checked.part)
        self._write({"checked": checked.part, "rows": checked.rows, "by": machine})

    def drop(self, part: int) -> None:
        """Records that a part is invalid."""
        self._forget(part)
        self._write({"dropped": part})

    def _write(self, entry: dict[str, Any]) -> None:
        self._file.write(json.dumps(entry).encode() + b"\n")
        self._file.flush()
        os.fsync(self._file.fileno())

    def write_manifest(self) -> None:
        """Writes the manifest: the header and all parts in order, equal for every run of the job."""
        remove_temporary(self._plan.spec.folder)  # left by lost workers of this run
        spec = self._plan.spec
        entries = [self.done[part] for part in sorted(self.done)]
        manifest = {
            **self._plan.header,
            **self._plan.names,
            "part_rows": spec.part_rows,
            "checked_rows": sum(len(spec.checked(done.part)) for done in entries) if spec.check else 0,
            "parts": [
                {"file": f"parts/{part_name(d.part)}", "rows": d.rows, "bytes": d.size, "sha256": d.digest}
                for d in entries
            ],
        }
        text = json.dumps(manifest, indent=1, default=str) + "\n"
        write_whole(self._plan.output / "manifest.json", lambda file: file.write(text.encode()))

    def close(self) -> None:
        self._file.close()
