# Private: see _front/engine.py and _scene/scene.py.
from typing import Any

Query: Any
Engine: Any
Scene: Any
