"""generate.py SOURCES OUT: headers that builds of ROS packages generate, OUT/include/NAME/..., without a workspace.

Runs in an environment with ROS's generators (tests/install/try_moveit.sh).
SOURCES: folder of the repositories.
"""

import os
import pathlib
import re
import shutil
import sys

import em
from rosidl_generator_cpp.cli import GenerateCpp

os.environ["AMENT_PREFIX_PATH"] = sys.prefix
sources, out = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])


def write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def messages(folder):
    """Headers of a package of messages, after those that it needs, apart from those of the environment."""
    files = [
        f"{folder}:{file.relative_to(folder)}" for kind in ("msg", "srv") for file in folder.glob(f"{kind}/*.{kind}")
    ]
    target, shared = out / "include" / folder.name / folder.name, out / "share" / folder.name
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    shutil.copytree(folder / "msg", shared / "msg", dirs_exist_ok=True)
    GenerateCpp("cpp").generate(folder.name, files, [pathlib.Path(sys.prefix) / "share", out / "share"], target)
    for made in (*target.glob("tmp/**/*.idl"), *target.glob("**/*.json")):
        place = shared / made.parent.name / made.name
        place.parent.mkdir(exist_ok=True)
        shutil.copy(made, place)


def templates_of_rclcpp():
    package, made = sources / "rclcpp/rclcpp", out / "include/rclcpp/rclcpp"

    def expand(template, name, *options):
        (made / name).parent.mkdir(parents=True, exist_ok=True)
        em.invoke([*options, "-o", str(made / name), str(package / "resource" / template)])

    expand("logging.hpp.em", "logging.hpp")
    for header in (package / "include/rclcpp/node_interfaces").glob("node_*_interface.hpp"):
        option = ("-D", f"interface_name = '{header.stem}'")
        expand("interface_traits.hpp.em", f"node_interfaces/{header.stem}_traits.hpp", *option)
        expand("get_interface.hpp.em", f"node_interfaces/get_{header.stem}.hpp", *option)


def export_macros():
    """Headers of CMake's generate_export_header, with empty macros."""
    headers = list(sources.glob("moveit2/moveit_core/**/*.hpp"))
    for name in {name for path in headers for name in re.findall(r"\w+_export\.h", path.read_text())}:
        macro = name.removesuffix("_export.h").upper()
        text = "".join(f"#define {macro}_{word}\n" for word in ("EXPORT", "NO_EXPORT", "DEPRECATED"))
        write(out / "include/export" / name, text)


def compatibility_of_urdf(major=1, minor=0, revision=5):
    """The version of Debian's urdfdom headers."""
    text = (sources / "urdf/urdf/urdfdom_compatibility.h.in").read_text()
    for word, value in {"MAJOR": major, "MINOR": minor, "REVISION": revision}.items():
        text = text.replace(f"@URDFDOM_HEADERS_{word}_VERSION@", str(value))
    write(out / "include/urdf/urdf/urdfdom_compatibility.h", text)


for package in (
    "rcl_interfaces/statistics_msgs",
    "geometry2/tf2_msgs",
    "octomap_msgs",
    "object_recognition_msgs",
    "moveit_msgs",
):
    messages(sources / package)
templates_of_rclcpp()
export_macros()
compatibility_of_urdf()
