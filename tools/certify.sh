#!/usr/bin/env bash
# Runs the oracle (docs/trust/accuracy.md) and rewrites docs/results/*accuracy.csv: make certify.
# It needs this folder with build/bin/clearance-{certify,certificates,mesh-loader} alone, so that it can be carried to a
# larger machine. THREADS=n sets the threads; results do not depend on them. Of one core, the decisions about states and
# edges take up to an hour for six robots, the meshes an hour and a half, ten million stops five hours.
set -euo pipefail
cd "$(dirname "$0")/.."
threads=${THREADS:-$(nproc)}
export OMP_NUM_THREADS=1  # the oracle has threads of its own
python=$([ -x .venv/bin/python ] && echo .venv/bin/python || echo python3)
certify="build/bin/clearance-certify --seed 1 --threads $threads"

robots=(scenes/cell/arm.urdf)  # and MotionBenchMaker's, where a benchmark has fetched them
for robot in panda ur5 fetch baxter; do
  urdf=build/robots/resources/$robot/$robot.urdf
  if [ -f "$urdf" ]; then robots+=("$urdf"); else echo "not fetched: $urdf" >&2; fi
done

rm -rf out/certificates
mkdir -p out
build/bin/clearance-certificates --cases 30000 --meshes 3000 --python 1000 --motions 400 --python-motions 40 --threads "$threads" --out out/certificates
"$python" tools/check_certificate.py out/certificates/*.json
$certify --pairs 1000000 --slack 2000 --csv docs/results/accuracy.csv --failures out/certify_failures.txt
$certify --motions 270000 --csv docs/results/motion_accuracy.csv
$certify --trajectories 100000 --csv docs/results/trajectory_accuracy.csv
$certify --stops 10000000 --csv docs/results/stop_accuracy.csv
$certify --meshes --pairs 1000000 --csv docs/results/mesh_accuracy.csv --failures out/certify_mesh_failures.txt
$certify --states 1000000 --edges 100000 --robots "${robots[@]}" --csv docs/results/decision_accuracy.csv
$certify --distances 18432 --robots scenes/cell/arm.urdf --csv docs/results/distance_accuracy.csv
