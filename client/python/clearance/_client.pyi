# Private: see _front/client.py.
from typing import Any

Query: Any
Client: Any

OPTIONS: dict[str, tuple[int, str, Any, str, str, str, int, float, float, str]]

def poses_of_matrices(matrices: Any, tolerance: float, poses: Any) -> int: ...
def wire_structs() -> dict[str, list[tuple[str, str]]]: ...
