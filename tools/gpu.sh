#!/usr/bin/env bash
# gpu.sh test|bench [folder of binaries]: the tests and benchmarks that need a GPU. Run by make gpu-test and make gpu-bench;
# with a folder of binaries that were built elsewhere it needs nothing but them.
set -uo pipefail
what=${1:?gpu.sh test or bench}
bin=${2:-build/bin}
out=${OUT:-out}
mkdir -p "$out"
case $what in
  test)
    [ -x "$bin/test_cuda_backend" ] || { echo "gpu.sh: $bin/test_cuda_backend is not there: was nvcc found?" >&2; exit 1; }
    "$bin/clearance-gpu-bench" --device || exit 1
    failed=0
    for run in "test_cuda_backend" "test_cuda_reductions" "test_cuda_classes" "test_engine --gtest_filter=*cuda*"; do
      # shellcheck disable=SC2086
      "$bin"/$run >"$out/gpu_test.log" 2>&1 || { failed=1; grep -E "Failure|FAILED|error" "$out/gpu_test.log" | head -20; }
      printf '%-45s %s\n' "$run" "$(grep -E '^\[  (PASSED|FAILED)  \] [0-9]+ test' "$out/gpu_test.log" | tr -d '\n')"
    done
    exit $failed
    ;;
  bench)
    device=$("$bin/clearance-gpu-bench" --device) || exit 1
    name=gpu_$(echo "$device" | tr 'A-Z' 'a-z' | tr -cs 'a-z0-9' '_' | sed 's/_*$//').csv
    results=docs/results
    [ -d "$results" ] || results=$out
    "$bin/clearance-gpu-bench" "$results/$name" && echo "$results/$name"
    ;;
  *) echo "gpu.sh: expected test or bench, got '$what'" >&2; exit 2 ;;
esac
