# Private: see _engine_front.py and _scene/scene.py.
from typing import Any

Query: Any
Engine: Any
Scene: Any
