#!/usr/bin/env bash
# gpu.sh TASK [folder of binaries]: tests and benchmarks that need a GPU. make gpu-test runs test, certify and sanitize; make
# gpu-bench runs bench, several and report; daemon is a part of bench. Binaries may have been built elsewhere. It also needs
# its source tree for the tests' data, and the programs that tests start (memory_client, clearanced and its helpers).
# gpu.sh programs TASK: prints the targets to build for a task.
set -uo pipefail
tasks="test, certify, sanitize, bench, daemon, several or report"
what=${1:?gpu.sh $tasks}

tests=(test_cuda_backend test_cuda_slack test_cuda_elements test_cuda_decisions test_cuda_reductions
  test_cuda_motions test_cuda_loss test_device test_cuda_classes test_device_plan test_shared_memory
  test_daemon_plans test_engine_on_device test_cuda_containment test_segment_pinner test_robots
  "test_engine --gtest_filter=*cuda*" "test_narrow_baselines --gtest_filter=*uda*:-Worlds*")
# Tests of moderate size, since each of the sanitizer's tools slows them down a hundredfold.
sanitized=("test_cuda_backend --gtest_filter=*OwnShape:*Explicit*:*Poses*:*LeavesToFloat64*"
  "test_cuda_reductions --gtest_filter=*BreakTies*:*SayWhich*:*WriteStraight*"
  "test_cuda_elements --gtest_filter=*Repeat*:*Follow*" "test_cuda_motions --gtest_filter=*FlagEnds*")
if [ "$what" = programs ]; then
  case ${2:-} in
    test) printf '%s\n' "${tests[@]%% *}" clearance-gpu-bench clearance_cuda ;;
    sanitize) printf '%s\n' "${sanitized[@]%% *}" clearance_cuda ;;
    certify) echo clearance-certify clearance-gpu-bench clearance_cuda ;;
    bench | daemon) echo product clearance-gpu-bench clearance-gpu-plans clearance-gpu-floor clearance-gpu-daemon clearance-gpu-motions ;;
    several) echo clearance-gpu-bench clearance_cuda ;;
    report) echo clearance-report clearance-gpu-bench clearance_cuda ;;
    *) echo "gpu.sh: expected $tasks, got '${2:-}'" >&2; exit 2 ;;
  esac
  exit
fi

bin=${2:-build/bin}
# Binaries contain the path of their source tree, which may not exist on this machine.
CLEARANCE_SOURCE_DIR=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd) && export CLEARANCE_SOURCE_DIR
out=${OUT:-out}
mkdir -p "$out"

# Prints docs/results/PREFIX_DEVICE.csv, or the same name in $out if that folder is missing.
results_file() {
  local device folder=docs/results
  device=$("$bin/clearance-gpu-bench" --device) || return 1
  [ -d "$folder" ] || folder=$out
  echo "$folder/$1_$(echo "$device" | tr 'A-Z' 'a-z' | tr -cs 'a-z0-9' '_' | sed 's/_*$//').csv"
}

# start_csv FILE COLUMNS: creates a results file with its header.
start_csv() { printf '# device: %s\n# command: make gpu-bench\n%s\n' "$("$bin/clearance-gpu-bench" --device)" "$2" >"$1"; }

# Compares rows in device memory, which the client maps, with the same rows in host memory. The processes use the device in
# turn and, if MPS can be started, share it.
bench_daemon_plans() {
  local file folder daemon mps=""
  file=$(results_file gpu_daemon) && folder=$(mktemp -d) || return 1
  start_csv "$file" columns,poses,how,pairs,echo_us,rows_there_us,rows_there_p90_us,daemon_us,rows_read_us,reading_us,host_us,host_p90_us
  for way in alone mps; do
    if [ $way = mps ]; then
      export CUDA_MPS_PIPE_DIRECTORY=$folder/mps CUDA_MPS_LOG_DIRECTORY=$folder/mps && mkdir "$folder/mps"
      command -v nvidia-cuda-mps-control >/dev/null && nvidia-cuda-mps-control -d >"$folder/mps.log" 2>&1 && mps=started
      [ "$mps" ] || { echo "mps: cannot be started here"; break; }
    fi
    "$bin/clearanced" --scene scenes/random_1000/scene.yaml --backend cuda --shm "$folder/$way.sock" --log-level warn &
    daemon=$!
    until [ -S "$folder/$way.sock" ] || ! kill -0 $daemon 2>/dev/null; do sleep 0.1; done
    timeout 60 "$bin/clearance-gpu-daemon" "shm://$folder/$way.sock" "$file" $way
    kill $daemon && wait $daemon
  done
  [ "$mps" ] && echo quit | timeout 20 nvidia-cuda-mps-control >/dev/null 2>&1
  unset CUDA_MPS_PIPE_DIRECTORY CUDA_MPS_LOG_DIRECTORY
  rm -rf "$folder"
  echo "$file"
}

# All pairs of a thousand bodies through the daemon: copied, then written by the device directly into client memory.
bench_service() {
  local file folder daemon pinned
  file=$(results_file gpu_service) && folder=$(mktemp -d) && rm -f "$file"
  for way in copied pinned; do
    [ $way = pinned ] && pinned=1024 || pinned=0
    "$bin/clearanced" --scene scenes/random_1000/scene.yaml --backend cuda --shm "$folder/$way" --limit pinned-mib=$pinned \
      --log-level warn &
    daemon=$!
    until [ -S "$folder/$way" ] || ! kill -0 $daemon 2>/dev/null; do sleep 0.1; done
    echo "$way:"
    "$bin/clearance" bench --connect "shm://$folder/$way" --seconds 3 --timeout 30 --csv "$file" | grep -E "^latency|engine  "
    kill $daemon && wait $daemon
  done
  rm -r "$folder"
  echo "$file"
}

case $what in
  test)
    [ -x "$bin/test_cuda_backend" ] || { echo "gpu.sh: $bin/test_cuda_backend is not there: was nvcc found?" >&2; exit 1; }
    "$bin/clearance-gpu-bench" --device || exit 1
    failed=0
    for run in "${tests[@]}"; do
      # shellcheck disable=SC2086
      timeout 1800 "$bin"/$run >"$out/gpu_test.log" 2>&1 || { failed=1; grep -E "Failure|FAILED|error" "$out/gpu_test.log" | head -20; }
      printf '%-45s %s\n' "$run" "$(grep -E '^\[  (PASSED|FAILED)  \] [0-9]+ test' "$out/gpu_test.log" | tr -d '\n')"
    done
    exit $failed
    ;;
  certify)
    file=$(results_file accuracy) || exit 1
    "$bin/clearance-certify" --backend cuda --pairs 1000000 --seed 1 --csv "$file" --failures "$out/certify_failures.txt" && echo "$file" || exit 1
    file=$(results_file motion_accuracy) || exit 1
    "$bin/clearance-certify" --backend cuda --motions 100000 --seed 1 --csv "$file" && echo "$file"
    ;;
  sanitize)
    # Accesses out of bounds, barriers that some threads miss, races in shared memory; for reductions also reads of
    # uninitialized memory (dense queries copy rows that the CPU writes later).
    sanitizer=$(command -v compute-sanitizer || echo /usr/local/cuda/bin/compute-sanitizer)
    [ -x "$sanitizer" ] || { echo "gpu.sh: compute-sanitizer is not there: it comes with the CUDA toolkit" >&2; exit 1; }
    failed=0
    for tool in memcheck synccheck racecheck initcheck; do
      for run in "${sanitized[@]}"; do
        case "$tool ${run%% *}" in "initcheck test_cuda_backend" | "initcheck test_cuda_elements" | "initcheck test_cuda_motions") continue ;; esac
        # shellcheck disable=SC2086
        "$sanitizer" --tool $tool --error-exitcode 9 "$bin"/$run >"$out/gpu_sanitize.log" 2>&1 ||
          { failed=1; grep -E "=========|Failure" "$out/gpu_sanitize.log" | head -20; }
        printf '%-12s %-25s %s\n' "$tool" "${run%% *}" "$(grep -E 'ERROR SUMMARY|RACECHECK SUMMARY' "$out/gpu_sanitize.log" | tail -1)"
      done
    done
    exit $failed
    ;;
  bench)
    file=$(results_file gpu) || exit 1
    "$bin/clearance-gpu-bench" "$file" && echo "$file"
    file=$(results_file gpu_plans) && "$bin/clearance-gpu-plans" "$file" && echo "$file"
    file=$(results_file gpu_floor) && start_csv "$file" work,states,graph_us,million_states_a_second,share_hit &&
      "$bin/clearance-gpu-floor" "$file" && echo "$file"
    if [ -x "$bin/clearanced" ]; then bench_service; fi
    if [ -x "$bin/clearanced" ] && [ -x "$bin/clearance-gpu-daemon" ]; then bench_daemon_plans; fi
    # Calls from Python, by an interpreter that has the package (PYTHON=...).
    python=${PYTHON:-.venv/bin/python}
    # MotionBenchMaker's edges: problems written by write_motion_scenes.py (MOTION_SCENES=... is their folder).
    scenes=${MOTION_SCENES:-build/motion_scenes}
    [ -d "$scenes" ] || "$python" bench/environment.py bench/robots bench/gpu/write_motion_scenes.py "$scenes"
    if [ -d "$scenes" ] && [ -x "$bin/clearance-gpu-motions" ]; then
      file=$(results_file gpu_motions) && "$bin/clearance-gpu-motions" "$scenes"/* --csv "$file" && echo "$file"
    fi
    if "$python" -c "import clearance" 2>/dev/null; then
      edges=()
      [ ! -d "$scenes/bookshelf_tall_1" ] || edges=(--edges "$scenes/bookshelf_tall_1")
      file=$(results_file gpu_python) && start_csv "$file" way,python_us,engine_us,kernel_us &&
        "$python" bench/gpu/bench_engine.py cuda --csv "$file" "${edges[@]}" && echo "$file"
      # MuJoCo Warp on the same pairs, if that interpreter has it (pip install mujoco-warp).
      if "$python" -c "import mujoco_warp" 2>/dev/null; then
        file=$(results_file gpu_mujoco_warp) && start_csv "$file" what,pairs,least_us,median_us,wrong_by_1e-6_m,wrong_by_1e-5_m,wrong_by_1e-4_m &&
          PYTHONPATH="$PWD/build/python:${PYTHONPATH:-}" "$python" bench/gpu/bench_mujoco_warp.py --csv "$file" && echo "$file"
      fi
      # csdecomp on MotionBenchMaker's Panda, if that interpreter has it (pip install csdecomp).
      robots=build/robots/resources
      if [ -d "$robots/panda" ] && "$python" -c "import csdecomp" 2>/dev/null; then
        file=$(results_file gpu_csdecomp) && start_csv "$file" what,states,us,million_states_a_second,free,free_in_contact,hit_but_apart &&
          PYTHONPATH="$PWD/build/python:${PYTHONPATH:-}" "$python" bench/gpu/bench_csdecomp.py "$robots" --csv "$file" && echo "$file"
      fi
    fi
    ;;
  daemon)
    bench_daemon_plans
    ;;
  several)
    file=$(results_file gpus) || exit 1
    "$bin/clearance-gpu-bench" --several "$file" && echo "$file"
    ;;
  report)
    file=$(results_file report) || exit 1
    coal=()
    for program in "$bin/coal_peer" build/peers/coal/peer; do
      [ -x "$program" ] && coal=(--coal "$program") && break
    done
    "$bin/clearance-report" --csv "$file" --remark "make gpu-bench TASK=report" --scratch "$out" "${coal[@]}" && echo "$file" || exit 1
    if [ "${file%/*}" = docs/results ]; then "${PYTHON:-.venv/bin/python}" bench/write_pages.py --draw report; fi
    ;;
  *) echo "gpu.sh: expected $tasks, got '$what'" >&2; exit 2 ;;
esac
