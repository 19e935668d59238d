"""write_contract.py MODULE FILE: the extension module's structs and options, as JSON for the client in Python alone."""

import importlib.util
import json
import pathlib
import sys

module, file = sys.argv[1:]
spec = importlib.util.spec_from_file_location("_client", module)
assert spec and spec.loader
client = importlib.util.module_from_spec(spec)
spec.loader.exec_module(client)
contract = {"structs": client.wire_structs(), "options": client.OPTIONS}
pathlib.Path(file).write_text(json.dumps(contract, indent=1, allow_nan=True))
