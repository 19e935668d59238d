# Private: see _client_front.py.
from typing import Any

Query: Any
Client: Any

def wire_layout() -> dict[str, tuple[int, dict[str, tuple[int, int]]]]: ...
