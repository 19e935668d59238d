#!/usr/bin/env bash
# Tests that need packages, compilers or minutes that `make test` does without: all of them, or with --changed only those
# whose folders differ from the last commit that passed CI (.ci/passed), except those that are run before a release.
# If that commit is missing (a shallow clone, no git), all count as changed, and a line reports that.
# With --minutes no extra starts that would end later, by the times below; the last line names those that were left out.
#
#   tools/extras.sh [--changed] [--minutes N] [NAME...]     a name alone is run whatever has changed
set -euo pipefail
. "$(dirname "$0")/step.sh"

# What the adapters to other libraries consist of and import.
adapters="client/python/clearance/_adapters client/python/clearance/_arguments.py client/python/clearance/_front"
adapters+=" client/python/clearance/_poses.py client/python/clearance/_scene client/python/clearance/_words.py client/python/clearance/_coal.py"

# Name, minutes on two cores (after `make build`, without ccache), and the paths that it depends on.
extras=(
  "client_install   3  pyproject.toml CMakeLists.txt cmake client planner wire cli lcmtypes"
  "wheels          25  pyproject.toml CMakeLists.txt cmake client lcmtypes tests/install tools/wheel.sh tools/root.sh"
  "deb             15  CMakeLists.txt cmake cli/CMakeLists.txt cli/man_page.py server/CMakeLists.txt server/app/clearanced.service.in tests/install tools/root.sh"
  "arm             60  CMakeLists.txt CMakePresets.json cmake client cli engine lcmtypes server wire tests/golden tests/oracle tests/install/try_arm.py tests/engine/robot tools/root.sh"
  "coal             2  $adapters client/python/clearance/pinocchio.py client/python/clearance/pink.py client/python/clearance/placo.py tests/install/try_coal.py tests/install/try_pinocchio.py tests/install/try_placo.py"
  "mujoco           2  $adapters client/python/clearance/mink.py tests/install/try_mujoco.py tests/install/try_mink.py tests/install/mujoco"
  "drake            2  $adapters client/python/clearance/drake.py tests/install/try_drake.py"
  "ompl             2  client/python/clearance engine/motion engine/certificate tests/install/try_ompl.py"
  "ros              2  ros client/python/clearance scenes/cell tests/install/try_ros.py tests/python/ros/ros_messages.py"
  "jax              2  client/python/clearance/jax.py client/python/clearance/_device/xla_ffi.py client/python/clearance/_device/plan.py client/python/clearance/_device/pose_gradient.py tests/python/engine/test_jax.py client/python/clearance/_device/host_rows.py tests/python/engine/test_second_order.py"
  "torch           15  client/python/clearance/torch.py client/python/clearance/_device/host_rows.py tests/python/engine/test_second_order.py"
  "viewer           5  client/python/clearance/view client/python/_clearance_programs.py engine/cover engine/python/scene_bindings.cpp tests/install/try_viewer.py"
  "examples         3  client/examples client/python/clearance scenes/cell tools/packages/examples_requirements.txt"
  "site             3  docs mkdocs.yml tools/docs/site_*.* tools/docs/notebook.py client/python/clearance client/*.h engine/api wire/*.h wire/api"
  "ray              6  client/python/clearance client/examples/roadmap.py tests/python/sweep/test_sweep.py tests/python/sweep/test_sweep_jobs.py tests/python/sweep/test_sweep_ray.py tests/python/sweep/sweeps.py"
  "fuzz            12  wire server client/*.cpp client/*.h engine/mesh engine/robot engine/geometry engine/scene engine/scene_io engine/state engine/cache tests/fuzz"
  "robots           3  engine/robot engine/base engine/pose cli/robot.cpp tests/engine/robot"
  "races           15  wire server client/*.cpp client/*.h tests/server tests/lcm tests/client"
  "kernels         20  engine/cuda engine/device engine/narrow engine/base engine/hull engine/pose bench/report CMakeLists.txt cmake"
  "prove            5  proof engine/base/vec.h engine/base/arithmetic.h engine/narrow engine/hull/lanes engine/hull/support.cpp tools/packages/prove.txt"
)

# These rebuild everything in roots of other systems, or fetch gigabytes: --changed lists them and leaves them to a release.
before_a_release=(wheels deb arm torch)

# A client-only install from the source, like `pip install` without an engine, in a separate environment.
run_client_install() {
  local venv=out/extras/venv
  step extras-venv "Make out/extras/venv" .venv/bin/python -m venv --clear "$venv"
  step extras-install "Install the client alone with pip" env CLEARANCE_CLIENT_ONLY=1 "$venv/bin/python" -m pip install \
    --disable-pip-version-check --progress-bar off .
  "$venv/bin/python" -I - <<'PYTHON'
import clearance
try:
    clearance.connect("ipc:///dev/null/none", timeout_s=0.2)
except clearance.ConnectionError as error:
    assert "/dev/null/none" in str(error), error
else:
    raise SystemExit("connected to nobody")
try:
    clearance.Engine
except ImportError as error:
    assert "client-only" in str(error), error
else:
    raise SystemExit("a client-only install has an engine")
from clearance import *  # takes what there is
assert connect is clearance.connect and "Scene" not in clearance.__all__
PYTHON
  "$venv/bin/clearance" --help >/dev/null
}

# Each wheel in roots with Python alone: Ubuntu 22.04, Debian 13, and for the client alone Debian 11 (Python 3.9).
run_wheels() {
  local native py310 abi3 client root
  tools/setup.sh tools/packages/install.txt
  .venv/bin/python -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' ||
    die "the native wheel is tried with Ubuntu 22.04's Python 3.11, but .venv has $(.venv/bin/python --version): remove .venv and set PYTHON=python3.11"
  CLEARANCE_CUDA=${CLEARANCE_CUDA:-AUTO} tools/wheel.sh
  native=$(newest "dist/clearance-*-cp$(.venv/bin/python -c 'import sys; print("%d%d" % sys.version_info[:2])')-*.whl")
  py310=$(newest 'dist/clearance-*-cp310-cp310-*.whl') abi3=$(newest 'dist/clearance-*-abi3-*.whl')
  client=$(newest 'dist/clearance_client-*.whl')
  root=$(tools/root.sh jammy python3 python3-venv python3.11 python3.11-venv)
  try_wheel "$root" python3.11 3.11 "$native"
  try_wheel "$root" python3 3.10 "$py310"
  try_wheel "$root" python3 3.10 "$client" "$native"
  root=$(tools/root.sh trixie python3 python3-venv)
  try_wheel "$root" python3 3.13 "$abi3"
  try_wheel "$root" python3 3.13 "$client" "$abi3"
  root=$(tools/root.sh bullseye python3 python3-venv)
  try_wheel "$root" python3 3.9 "$client"
}

# The newest of some files.
newest() { compgen -G "$1" | xargs ls -t | head -n 1; }

# try_wheel ROOT PYTHON VERSION WHEEL [WHEEL with a daemon]: with numpy and pyzmq installed, and no network.
try_wheel() {
  local root=$1 python=$2 version=$3 wheel=$4 program=
  rm -rf "$root/tmp/try"
  mkdir -p "$root/tmp/try/wheels"
  step "wheels-$version" "Fetch numpy and pyzmq for Python $version" .venv/bin/python -m pip download --disable-pip-version-check \
    --progress-bar off --only-binary=:all: --python-version "$version" --platform "manylinux_2_28_$(uname -m)" \
    --platform "manylinux_2_27_$(uname -m)" --platform "manylinux_2_26_$(uname -m)" --platform "manylinux2014_$(uname -m)" \
    -d "$root/tmp/try/wheels" numpy pyzmq
  cp "$wheel" "$root/tmp/try/wheels"
  cp -r scenes tests/install "$root/tmp/try"
  if [ "${5:-}" ]; then
    .venv/bin/python -m zipfile -e "$5" "$root/tmp/try/daemon"
    chmod +x "$root"/tmp/try/daemon/clearance/libexec/*
    program=/tmp/try/daemon/clearance/libexec/clearanced
  fi
  tests/install/in_root.sh "$root" "$python" /tmp/try/install/try_wheel.py /tmp/try/wheels /tmp/try/scenes ${program:+"$program"}
}

# The Debian package in a root of the distribution on which it was built.
run_deb() {
  local root deb
  tools/setup.sh tools/packages/install.txt
  # CI builds in the same folder, for one GPU architecture.
  [ ! -f build/CMakeCache.txt ] || cmake -U CLEARANCE_CUDA_ARCHITECTURES build >"$log_dir/deb.log"
  tools/build.sh release product
  (cd build && cpack -G DEB >"../$log_dir/deb.log" 2>&1) || die "cpack failed: $log_dir/deb.log"
  deb=$(newest 'build/package/*.deb')
  root=$(tools/root.sh "$(. /etc/os-release && echo "$VERSION_CODENAME")" python3 python3-venv systemd)
  rm -rf "$root/tmp/try"
  mkdir -p "$root/tmp/try/deb"
  cp -r scenes tests/install "$root/tmp/try"
  cp "$deb" "$root/tmp/try/deb"
  tests/install/in_root.sh "$root" /tmp/try/install/try_deb.sh "/tmp/try/deb/$(basename "$deb")" /tmp/try/scenes
}

# 64-bit ARM: cross-built against Debian 12's libraries, and run in qemu. The golden answers must equal those of x86-64,
# bit for bit; processor-specific code is tested; and a daemon is queried over every transport, in a network namespace.
run_arm() {
  local tests=(test_fp_environment test_lanes test_kinematics) packages root bin=build-arm64/bin
  tools/setup.sh tools/packages/install.txt
  mapfile -t packages < <(sed 's/#.*//; s/?//' tools/packages/build.txt | xargs -n 1)
  root=$(tools/root.sh arm64-bookworm "${packages[@]}")
  lcm_for_arm "$root/opt/lcm"
  tools/build.sh release _client _engine clearance_mesh_loader
  tools/build.sh arm64 clearance-golden clearanced clearance_cli clearance_mesh_loader "${tests[@]}"
  (cd build-arm64 && ctest --output-on-failure -R "^($(IFS='|'; echo "${tests[*]}"))\\.|^golden_answers$")
  unshare --net sh -ec 'ip link set lo up; ip route add 239.255.76.67/32 dev lo; exec "$@"' sh \
    env PYTHONPATH=build/python .venv/bin/python tests/install/try_arm.py "$bin" "$root" scenes/nineteen/scene.yaml
}

# lcm_for_arm FOLDER: extracts LCM's library and headers from its wheel for ARM.
lcm_for_arm() {
  [ -d "$1/lib" ] && return
  rm -rf out/lcm-arm64
  step arm-lcm "Fetch LCM for ARM" .venv/bin/python -m pip download --disable-pip-version-check --progress-bar off --no-deps \
    --only-binary=:all: --python-version 3.11 --platform manylinux_2_28_aarch64 -d out/lcm-arm64 "$(grep '^lcm==' requirements.txt)"
  .venv/bin/python -m zipfile -e out/lcm-arm64/*.whl "$1"
}

# Conversions from Coal and Pinocchio, in an environment with both and pink, and in one with placo.
run_coal() {
  local venv=out/extras/coal
  tools/build.sh release product
  step coal-venv "Make $venv" .venv/bin/python -m venv --clear "$venv"
  step coal-install "Install Coal and Pinocchio" "$venv/bin/python" -m pip install --disable-pip-version-check --progress-bar off \
    coal==3.0.3 pin==4.1.0 pin-pink==4.4.0 daqp==0.11.0 numpy
  PYTHONPATH=build/python "$venv/bin/python" tests/install/try_coal.py
  PYTHONPATH=build/python "$venv/bin/python" tests/install/try_pinocchio.py pink
  step placo-venv "Make $venv-placo" .venv/bin/python -m venv --clear "$venv-placo"
  step placo-install "Install placo" "$venv-placo/bin/python" -m pip install --disable-pip-version-check --progress-bar off \
    placo==0.10.2 numpy
  PYTHONPATH=build/python "$venv-placo/bin/python" tests/install/try_pinocchio.py placo
  PYTHONPATH=build/python "$venv-placo/bin/python" tests/install/try_placo.py
}

# Models of MuJoCo as scenes, and a limit for mink, each in an environment of its own.
run_mujoco() {
  local venv=out/extras/mujoco
  tools/build.sh release product
  step mujoco-venv "Make $venv" .venv/bin/python -m venv --clear "$venv"
  step mujoco-install "Install MuJoCo's core" "$venv/bin/python" -m pip install --disable-pip-version-check --progress-bar off \
    mujoco-core==4.0.1 numpy
  PYTHONPATH=build/python "$venv/bin/python" tests/install/try_mujoco.py
  step mink-venv "Make $venv-mink" .venv/bin/python -m venv --clear "$venv-mink"
  step mink-install "Install mink" "$venv-mink/bin/python" -m pip install --disable-pip-version-check --progress-bar off \
    mink==1.3.0 daqp==0.11.0 numpy
  PYTHONPATH=build/python "$venv-mink/bin/python" tests/install/try_mink.py
}

# Drake's collision checker over Clearance, in an environment with Drake.
run_drake() {
  local venv=out/extras/drake
  tools/build.sh release product
  step drake-venv "Make $venv" .venv/bin/python -m venv --clear "$venv"
  step drake-install "Install Drake" "$venv/bin/python" -m pip install --disable-pip-version-check --progress-bar off \
    drake==1.51.1 numpy
  PYTHONPATH=build/python "$venv/bin/python" tests/install/try_drake.py
}

# Planning with OMPL, whose edges are proved, in an environment with OMPL.
run_ompl() {
  local venv=out/extras/ompl
  tools/build.sh release product
  step ompl-venv "Make $venv" .venv/bin/python -m venv --clear "$venv"
  step ompl-install "Install OMPL" "$venv/bin/python" -m pip install --disable-pip-version-check --progress-bar off ompl==2.0.1 numpy
  PYTHONPATH=build/python "$venv/bin/python" tests/install/try_ompl.py
}

# The ROS 2 node on rclpy, with the messages and the middleware of ROS from PyPI.
run_ros() {
  local venv=out/extras/ros
  tools/build.sh release product
  step ros-venv "Make $venv" .venv/bin/python -m venv --clear "$venv"
  step ros-install "Install rclpy" "$venv/bin/python" -m pip install --disable-pip-version-check --progress-bar off \
    ros-rclpy==9.1.2 ros-rmw-fastrtps-cpp==9.3.3 ros-sensor-msgs==5.5.1 ros-diagnostic-msgs==5.5.1 ros-trajectory-msgs==5.5.1 numpy
  PYTHONPATH=build/python "$venv/bin/python" tests/install/try_ros.py build
}

# Device queries as functions of JAX, which calls a fake in CPU memory: neither a GPU nor JAX's GPU parts are needed.
run_jax() {
  local venv=out/extras/jax
  tools/build.sh release product
  step jax-venv "Make $venv" .venv/bin/python -m venv --clear "$venv"
  step jax-install "Install JAX" "$venv/bin/python" -m pip install --disable-pip-version-check --progress-bar off jax==0.10.2 numpy pytest
  JAX_PLATFORMS=cpu "$venv/bin/python" -m pytest -q tests/python/engine/test_jax.py tests/python/engine/test_second_order.py -k "test_jax or jax-"
}

# Second derivatives in PyTorch, on the host.
run_torch() {
  local venv=out/extras/torch
  tools/build.sh release product
  step torch-venv "Make $venv" .venv/bin/python -m venv --clear "$venv"
  step torch-install "Install PyTorch" "$venv/bin/python" -m pip install --disable-pip-version-check --progress-bar off torch numpy pytest
  "$venv/bin/python" -m pytest -q tests/python/engine/test_second_order.py -k "torch-"
}

# The viewer's page in a headless browser; screenshots are in out/extras/pages.
run_viewer() {
  local venv=out/extras/viewer
  [ "${CHROMIUM:-$(command -v chromium)}" ] || tools/setup.sh tools/packages/viewer.txt
  if [ -z "${CHROMIUM:-$(command -v chromium)}" ]; then
    say "The viewer's page is not tried: there is no chromium, and CHROMIUM names none"
    return
  fi
  tools/build.sh release product
  step viewer-venv "Make $venv" .venv/bin/python -m venv --clear "$venv"
  step viewer-install "Install viser and Playwright" "$venv/bin/python" -m pip install --disable-pip-version-check \
    --progress-bar off viser==1.1.1 playwright==1.65.2 numpy
  PYTHONPATH=build/python "$venv/bin/python" tests/install/try_viewer.py build out/extras/pages
}

# Example programs, each of which checks its results by independent means: an optimiser, a planner, a simulator, and a
# controller for EXAMPLE_SECONDS of real time (600: the run of docs/control.md).
run_examples() {
  local venv=out/extras/examples python=out/extras/examples/bin/python
  tools/build.sh release product
  step examples-venv "Make $venv" .venv/bin/python -m venv --clear "$venv"
  step examples-install "Install what the examples need" "$python" -m pip install --disable-pip-version-check --progress-bar off \
    -r tools/packages/examples_requirements.txt
  "$python" client/examples/trajectory_optimiser.py
  "$python" client/examples/ompl_planner.py
  "$python" client/examples/mujoco_simulator.py
  "$python" client/examples/safe_controller.py --seconds "${EXAMPLE_SECONDS:-10}" --csv out/safe_controller.csv --plot out/safe_controller.png
}

# The documentation as a site, in out/site: every link resolves, and the notebook's outputs are reproduced.
run_site() {
  local venv=out/extras/site
  tools/build.sh release product
  step site-venv "Make $venv" .venv/bin/python -m venv --clear "$venv"
  step site-install "Install what makes the site" "$venv/bin/python" -m pip install --disable-pip-version-check --progress-bar off \
    -r tools/packages/site_requirements.txt
  PYTHONPATH=build/python "$venv/bin/python" tools/docs/notebook.py --check docs/notebook/first_steps.ipynb
  step site "Build out/site" env NO_MKDOCS_2_WARNING=1 PATH="$PWD/$venv/bin:$PATH" mkdocs build --strict
}

# Sweeps on Ray and without it, including kills, and a small roadmap, in an environment with Ray.
run_ray() {
  local venv=out/extras/ray
  tools/build.sh release product
  step ray-venv "Make $venv" .venv/bin/python -m venv --clear "$venv"
  step ray-install "Install Ray and pyarrow" "$venv/bin/python" -m pip install --disable-pip-version-check --progress-bar off \
    ray==2.60.0 pyarrow==26.0.1 scipy==1.17.1 PyYAML==6.0.3 numpy pytest
  "$venv/bin/python" -m pytest -q tests/python/sweep/test_sweep_jobs.py tests/python/sweep/test_sweep.py tests/python/sweep/test_sweep_ray.py
  PYTHONPATH=build/python "$venv/bin/python" client/examples/roadmap.py --nodes 1000 --queries 20 --output out/extras/roadmap
}

# Half a minute for each target of tests/fuzz, under the address and undefined-behaviour sanitizers.
run_fuzz() {
  tools/setup.sh tools/packages/fuzz.txt
  tools/build.sh fuzz fuzzers
  .venv/bin/python tools/fuzz.py --seconds "${FUZZ_SECONDS:-30}" --jobs 2
}

# The 69 URDFs and 38 SRDFs of a package that tests other tools (131 MB), compared with 60 digits and Pinocchio.
run_robots() {
  local venv=out/extras/robots
  tools/build.sh release clearance_cli
  step extras-robots-venv "Make $venv" .venv/bin/python -m venv "$venv"
  step extras-robots-install "Install robots and their judges" "$venv/bin/python" -m pip install --disable-pip-version-check \
    --progress-bar off example-robot-data==6.0.0 pin==4.1.0 mpmath==1.3.0 numpy
  "$venv/bin/python" tests/engine/robot/check_example_robots.py build
}

# Transports and clients under ThreadSanitizer, which follows no fork of a process with threads: clients are threads.
run_races() {
  local test threaded=(test_shm_transport test_shm_hostile test_lcm_transport test_loop test_client test_zmq
    test_bad_requests test_lcm_client test_lcm_channel)
  tools/build.sh tsan "${threaded[@]}"
  for test in "${threaded[@]}"; do
    OMP_NUM_THREADS=1 TSAN_OPTIONS="halt_on_error=1 suppressions=$PWD/tests/tsan_suppressions.txt" \
      limited "build-tsan/bin/$test" --gtest_brief=1 --gtest_filter=-ZmqTest.AClientThatDiesMidQueryCostsNothing
  done
}

# The kernels for every GPU architecture, which needs nvcc, but no GPU.
run_kernels() {
  if [ -z "$(PATH=$PATH:/usr/local/cuda/bin command -v nvcc)" ]; then
    say "The kernels are not compiled: there is no nvcc"
    return
  fi
  tools/build.sh gpus kernels
}

# The proof of the float64 bounds, against the source as it is, and random changes of the source, which must not pass.
run_prove() {
  tools/setup.sh tools/packages/prove.txt
  .venv/bin/python proof/prove.py
  .venv/bin/python proof/mutants.py --count "${PROOF_MUTANTS:-12}" --seed "${SEED:-1}"
}

changed_only= limit=
while [[ ${1:-} = --* ]]; do
  case $1 in
    --changed) changed_only=1 ;;
    --minutes) limit=${2:?--minutes N}; shift ;;
    *) die "there is no option $1" ;;
  esac
  shift
done
wanted=("$@")
since=
if [ "$changed_only" ]; then
  passed=$(cat .ci/passed 2>/dev/null || true)
  if [ -z "$passed" ]; then say "There is no .ci/passed: all extras count as changed"
  elif ! since=$(git rev-parse --verify --quiet "$passed^{commit}"); then
    say "The commit of .ci/passed, $passed, is not in this repository (a shallow clone?): all extras count as changed"
  else
    say "Extras whose folders differ from $(git log -1 --format='%h (%s)' "$since"), the last that passed CI"
    # Compares the trees, which needs no common history.
    git merge-base --is-ancestor "$since" HEAD || say "It is no ancestor of HEAD: was history rewritten?"
  fi
fi
known= left_out=()
for line in "${extras[@]}"; do
  read -r name minutes paths <<<"$line"
  known+=" $name"
  if ((${#wanted[@]})); then
    [[ " ${wanted[*]} " = *" $name "* ]] || continue
  elif [ "$since" ]; then
    read -ra paths <<<"$paths"
    # Uncommitted changes count, too.
    if git diff --quiet "$since" -- "${paths[@]}" && [ -z "$(git ls-files -o --exclude-standard -- "${paths[@]}")" ]; then
      say "$name: nothing of it has changed"
      continue
    fi
  fi
  if [ "$changed_only" ] && [[ " ${before_a_release[*]} " = *" $name "* ]]; then
    say "$name: has changed; run tools/extras.sh $name before a release"
    continue
  fi
  if [ "$limit" ] && ((SECONDS + 60 * minutes > 60 * limit)); then
    left_out+=("$name")
    continue
  fi
  say "$name ..."
  "run_$name"
done
for name in "${wanted[@]}"; do
  [[ "$known " = *" $name "* ]] || die "there is no extra '$name'; there are$known"
done
((${#left_out[@]} == 0)) || say "Left out, for want of time: run make test-extras EXTRAS=\"${left_out[*]}\""
