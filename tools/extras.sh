#!/usr/bin/env bash
# Tests that need packages, compilers or minutes that `make test` does without: all of them, or with --changed only those
# whose folders differ from the last commit that passed CI (.ci/passed), except those that are run before a release.
# If that commit is missing (a shallow clone, no git), all count as changed, and a line reports that.
# With --minutes no extra starts that would end later, by the times below; the last line names those that were left out.
#
#   tools/extras.sh [--changed] [--minutes N] [NAME...]     a name alone is run whatever has changed
set -euo pipefail
. "$(dirname "$0")/step.sh"
. tools/extras_packages.sh

# What the adapters to other libraries consist of and import.
adapters="client/python/clearance/_adapters client/python/clearance/_arguments.py client/python/clearance/_front"
adapters+=" client/python/clearance/_poses.py client/python/clearance/_scene client/python/clearance/_words.py client/python/clearance/_coal.py"

# Name, minutes on two cores (after `make build`, without ccache), and the paths that it depends on.
extras=(
  "client_install   3  pyproject.toml CMakeLists.txt cmake client planner wire cli lcmtypes"
  "wheels          25  pyproject.toml CMakeLists.txt cmake client lcmtypes tests/install tools/wheel.sh tools/root.sh"
  "deb             15  CMakeLists.txt cmake cli/CMakeLists.txt tools/docs/man_page.py server/CMakeLists.txt server/app/clearanced.service.in tests/install tools/root.sh"
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

# fresh_venv FOLDER WHAT PACKAGE...: makes an environment with these packages, which WHAT names in the progress.
fresh_venv() {
  local name=${1##*/}
  step "$name-venv" "Make $1" .venv/bin/python -m venv --clear "$1"
  step "$name-install" "Install $2" "$1/bin/python" -m pip install --disable-pip-version-check --progress-bar off "${@:3}"
}

# Conversions from Coal and Pinocchio, in an environment with both and pink, and in one with placo.
run_coal() {
  local venv=out/extras/coal
  tools/build.sh release product
  fresh_venv "$venv" "Coal and Pinocchio" coal==3.0.3 pin==4.1.0 pin-pink==4.4.0 daqp==0.11.0 numpy
  PYTHONPATH=build/python "$venv/bin/python" tests/install/try_coal.py
  PYTHONPATH=build/python "$venv/bin/python" tests/install/try_pinocchio.py pink
  fresh_venv "$venv-placo" "placo" placo==0.10.2 numpy
  PYTHONPATH=build/python "$venv-placo/bin/python" tests/install/try_pinocchio.py placo
  PYTHONPATH=build/python "$venv-placo/bin/python" tests/install/try_placo.py
}

# Models of MuJoCo as scenes, and a limit for mink, each in an environment of its own.
run_mujoco() {
  local venv=out/extras/mujoco
  tools/build.sh release product
  fresh_venv "$venv" "MuJoCo's core" mujoco-core==4.0.1 numpy
  PYTHONPATH=build/python "$venv/bin/python" tests/install/try_mujoco.py
  fresh_venv "$venv-mink" "mink" mink==1.3.0 daqp==0.11.0 numpy
  PYTHONPATH=build/python "$venv-mink/bin/python" tests/install/try_mink.py
}

# Drake's collision checker over Clearance, in an environment with Drake.
run_drake() {
  local venv=out/extras/drake
  tools/build.sh release product
  fresh_venv "$venv" "Drake" drake==1.51.1 numpy
  PYTHONPATH=build/python "$venv/bin/python" tests/install/try_drake.py
}

# Planning with OMPL, whose edges are proved, in an environment with OMPL.
run_ompl() {
  local venv=out/extras/ompl
  tools/build.sh release product
  fresh_venv "$venv" "OMPL" ompl==2.0.1 numpy
  PYTHONPATH=build/python "$venv/bin/python" tests/install/try_ompl.py
}

# The ROS 2 node on rclpy, with the messages and the middleware of ROS from PyPI.
run_ros() {
  local venv=out/extras/ros
  tools/build.sh release product
  fresh_venv "$venv" "rclpy" \
    ros-rclpy==9.1.2 ros-rmw-fastrtps-cpp==9.3.3 ros-sensor-msgs==5.5.1 ros-diagnostic-msgs==5.5.1 ros-trajectory-msgs==5.5.1 numpy
  PYTHONPATH=build/python "$venv/bin/python" tests/install/try_ros.py build
}

# Device queries as functions of JAX, which calls a fake in CPU memory: neither a GPU nor JAX's GPU parts are needed.
run_jax() {
  local venv=out/extras/jax
  tools/build.sh release product
  fresh_venv "$venv" "JAX" jax==0.10.2 numpy pytest
  JAX_PLATFORMS=cpu "$venv/bin/python" -m pytest -q tests/python/engine/test_jax.py tests/python/engine/test_second_order.py -k "test_jax or jax-"
}

# Second derivatives in PyTorch, on the host.
run_torch() {
  local venv=out/extras/torch
  tools/build.sh release product
  fresh_venv "$venv" "PyTorch" torch numpy pytest
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
  fresh_venv "$venv" "viser and Playwright" viser==1.1.1 playwright==1.65.2 numpy
  PYTHONPATH=build/python "$venv/bin/python" tests/install/try_viewer.py build out/extras/pages
}

# Example programs, each of which checks its results by independent means: an optimiser, a planner, a simulator, and a
# controller for EXAMPLE_SECONDS of real time (600: the run of docs/control.md).
run_examples() {
  local venv=out/extras/examples python=out/extras/examples/bin/python
  tools/build.sh release product
  fresh_venv "$venv" "what the examples need" -r tools/packages/examples_requirements.txt
  "$python" client/examples/trajectory_optimiser.py
  "$python" client/examples/ompl_planner.py
  "$python" client/examples/mujoco_simulator.py
  "$python" client/examples/safe_controller.py --seconds "${EXAMPLE_SECONDS:-10}" --csv out/safe_controller.csv --plot out/safe_controller.png
}

# The documentation as a site, in out/site: every link resolves, and the notebook's outputs are reproduced.
run_site() {
  local venv=out/extras/site
  tools/build.sh release product
  fresh_venv "$venv" "what makes the site" -r tools/packages/site_requirements.txt
  PYTHONPATH=build/python "$venv/bin/python" tools/docs/notebook.py --check docs/notebook/first_steps.ipynb
  step site "Build out/site" env NO_MKDOCS_2_WARNING=1 PATH="$PWD/$venv/bin:$PATH" mkdocs build --strict
}

# Sweeps on Ray and without it, including kills, and a small roadmap, in an environment with Ray.
run_ray() {
  local venv=out/extras/ray
  tools/build.sh release product
  fresh_venv "$venv" "Ray and pyarrow" ray==2.60.0 pyarrow==26.0.1 scipy==1.17.1 PyYAML==6.0.3 numpy pytest
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
