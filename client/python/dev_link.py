"""Lets the Python that runs this import the package from a build folder: dev_link.py BUILD/python."""

import pathlib
import sys
import sysconfig

target = pathlib.Path(sys.argv[1]).resolve()
link = pathlib.Path(sysconfig.get_path("purelib")) / "clearance_dev.pth"
text = f"{target}\n"
if not link.exists() or link.read_text() != text:
    link.write_text(text)
    print(f"{link}: imports come from {target}")
