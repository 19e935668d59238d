"""What proves rows of an answer, as a document that a separate program checks."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ._arguments import to_path


class Certificate:
    """Rows of a query with what proves their bounds: a JSON document, which docs/certificates.md describes.

    tools/check_certificate.py checks it in exact arithmetic, and needs nothing of Clearance.
    """

    def __init__(self, text: str):
        self._text = text

    def to_json(self) -> str:
        """The document."""
        return self._text

    def save(self, path: Any) -> None:
        """Writes the document to a file (str or os.PathLike), which check_certificate.py reads."""
        Path(to_path(path, "path")).write_text(self._text, encoding="utf-8")

    @property
    def document(self) -> dict[str, Any]:
        """The document as Python's json reads it, anew each time: "rows" holds status, lower and upper of each."""
        document: dict[str, Any] = json.loads(self._text)
        return document

    def __repr__(self) -> str:
        rows = self.document["rows"]
        return f"<clearance.Certificate: {sum(row['proved'] for row in rows)} of {len(rows)} rows are proved>"
