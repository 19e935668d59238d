#!/usr/bin/env bash
# Tests that need packages, compilers or minutes which `make test` does without: all of them, or with --changed those alone
# whose folders differ from the branch that this one left (origin/main or main; on main itself: from the commit before).
# Where there is no such commit (a shallow clone, no git) all are run, and it says so.
#
#   tools/extras.sh [--changed] [NAME...]     a name alone is run whatever has changed
set -euo pipefail
. "$(dirname "$0")/step.sh"

# Name, and the paths that it depends on.
extras=(
  "client_install  pyproject.toml CMakeLists.txt cmake client wire cli lcmtypes"
  "fuzz            wire server client/*.cpp client/*.h engine/mesh engine/robot engine/scene engine/cache tests/fuzz"
  "robots          engine/robot engine/base engine/pose cli/robot_main.cpp tests/robot"
  "races           wire server client/*.cpp client/*.h tests/server tests/lcm tests/client"
  "kernels         engine/cuda engine/device engine/narrow engine/base engine/hull engine/pose bench/report CMakeLists.txt cmake"
)

# A client-only install from the source, as `pip install` makes it for those who have no engine, in an environment of its own.
run_client_install() {
  local venv=out/extras/venv
  step extras-venv "Make out/extras/venv" .venv/bin/python -m venv --clear "$venv"
  step extras-install "Install the client alone with pip" env CLEARANCE_CLIENT_ONLY=1 "$venv/bin/python" -m pip install \
    --disable-pip-version-check --progress-bar off .
  "$venv/bin/python" -I - <<'PYTHON'
import clearance
try:
    clearance.connect("ipc:///nowhere/at/all", timeout_s=0.2)
except clearance.ConnectionError as error:
    assert "/nowhere/at/all" in str(error), error
else:
    raise SystemExit("connected to nobody")
try:
    clearance.Engine
except ImportError as error:
    assert "client-only" in str(error), error
else:
    raise SystemExit("a client-only install has an engine")
PYTHON
  "$venv/bin/clearance" --help >/dev/null
}

# Half a minute for each target of tests/fuzz, under the address and undefined-behaviour sanitizers.
run_fuzz() {
  tools/setup.sh tools/fuzz_packages.txt
  tools/build.sh fuzz fuzzers
  .venv/bin/python tools/fuzz.py --seconds "${FUZZ_SECONDS:-30}" --jobs 2
}

# The 69 URDFs and 38 SRDFs of a package that other tools are tested with (131 MB), against 60 digits and Pinocchio.
run_robots() {
  local venv=out/extras/robots
  tools/build.sh release clearance_robot
  step extras-robots-venv "Make $venv" .venv/bin/python -m venv "$venv"
  step extras-robots-install "Install robots and their judges" "$venv/bin/python" -m pip install --disable-pip-version-check \
    --progress-bar off example-robot-data==6.0.0 pin==4.1.0 mpmath==1.3.0 numpy
  "$venv/bin/python" tests/robot/check_example_robots.py build
}

# Transports and clients under ThreadSanitizer. It follows no fork of a process with threads: no client that is one.
run_races() {
  local test threaded=(test_shm_transport test_shm_hostile test_lcm_transport test_lcm_freshness test_loop test_client test_zmq
    test_bad_requests test_lcm_client test_lcm_channel)
  tools/build.sh tsan "${threaded[@]}"
  for test in "${threaded[@]}"; do
    OMP_NUM_THREADS=1 TSAN_OPTIONS="halt_on_error=1 suppressions=$PWD/tests/tsan_suppressions.txt" \
      "build-tsan/bin/$test" --gtest_brief=1 --gtest_filter=-ZmqTest.AClientThatDiesMidQueryCostsNothing
  done
}

# The kernels for every GPU architecture: that needs nvcc, and no GPU.
run_kernels() {
  if [ -z "$(PATH=$PATH:/usr/local/cuda/bin command -v nvcc)" ]; then
    say "The kernels are not compiled: there is no nvcc"
    return
  fi
  tools/build.sh gpus kernels
}

# The commit to compare with; empty where there is none.
base() {
  local branch commit
  for branch in origin/main main; do
    commit=$(git merge-base HEAD "$branch" 2>/dev/null) || continue
    if [ "$commit" != "$(git rev-parse HEAD)" ]; then echo "$commit"; return; fi
  done
  git rev-parse --verify --quiet HEAD~1 || true
}

changed_only=
if [ "${1:-}" = --changed ]; then changed_only=1; shift; fi
wanted=("$@")
since=
if [ "$changed_only" ]; then
  since=$(base)
  if [ "$since" ]; then say "Extras whose folders differ from $(git log -1 --format='%h (%s)' "$since")"
  else say "There is no commit to compare with: all extras are run"; fi
fi
known=
for line in "${extras[@]}"; do
  read -r name paths <<<"$line"
  known+=" $name"
  if ((${#wanted[@]})); then
    [[ " ${wanted[*]} " = *" $name "* ]] || continue
  elif [ "$since" ]; then
    read -ra paths <<<"$paths"
    # What is not committed counts, too.
    if git diff --quiet "$since" -- "${paths[@]}" && [ -z "$(git ls-files -o --exclude-standard -- "${paths[@]}")" ]; then
      say "$name: nothing of it has changed"
      continue
    fi
  fi
  say "$name ..."
  "run_$name"
done
for name in "${wanted[@]}"; do
  [[ "$known " = *" $name "* ]] || die "there is no extra '$name'; there are$known"
done
