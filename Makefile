# The everyday commands. The work is done by CMake (CMakePresets.json), ctest, pytest and the scripts in tools/.

PYTHON_VENV := .venv/bin/python
CORES := $(shell nproc)

.DEFAULT_GOAL := help
.PHONY: help setup build test test-extras lint fuzz soak demo bench bench-peers bench-broad bench-sections bench-classes bench-view bench-robots bench-motions bench-ompl bench-surfaces bench-clouds bench-sweep bench-load certify tradeoff report report-gpu gpu-compile gpu-test gpu-certify gpu-sanitize gpu-bench gpu-several clean

help:  ## this list
	@echo "make TARGET, one of"
	@sed -nE 's/^([a-z-]+):.*##  ?(.*)/  \1\t\2/p' $(MAKEFILE_LIST) | expand -t 12

setup:  ## install what is missing: Debian packages (apt), Python packages (.venv)
	@tools/setup.sh

build: setup  ## daemon and command line in build/bin, Python package in .venv
	@tools/build.sh release product

test: setup  ## every test: ctest, then pytest
	@tools/build.sh release
	@ctest --test-dir build -j $(CORES) --output-on-failure
	@$(PYTHON_VENV) -m pytest -q tests/python

test-extras: setup  ## what takes more packages or minutes than test: installing (wheels, deb), 64-bit ARM, examples, the site, fuzzing, robots, races, kernels; EXTRAS="fuzz races"
	@tools/extras.sh $(EXTRAS)

lint: setup  ## layout of C++ (clang-format), lint, layout and types of Python (ruff, mypy); installs them into .venv
	@tools/lint.sh

SECONDS ?= 600
fuzz:  ## libFuzzer on all that reads others' bytes, SECONDS=600 for each target; installs clang; rewrites docs/results/fuzz.csv
	@tools/setup.sh tools/fuzz_packages.txt
	@tools/build.sh fuzz fuzzers
	@$(PYTHON_VENV) tools/fuzz.py --seconds $(SECONDS) --csv docs/results/fuzz.csv

MINUTES ?= 60
SEED ?= 1
soak: setup  ## faults (docs/faults.md): 1000 clients killed, 80 daemons, 30,000 bad inputs, then MINUTES=60 of all at random, SEED=1; rewrites docs/results/soak.csv
	@tools/build.sh release test_fire_clients test_fire_daemon test_fire_limits test_fire_inputs clearance-soak
	@for test in clients daemon limits inputs; do CLEARANCE_FIRE_ROUNDS=26 build/bin/test_fire_$$test --gtest_brief=1 || exit 1; done
	@build/bin/clearance-soak --minutes $(MINUTES) --seed $(SEED) --csv docs/results/soak.csv

demo: setup  ## an arm that moves by joint messages, asked about through all three transports; out/demo.png
	@tools/build.sh release demo_programs
	@$(PYTHON_VENV) tools/demo.py

bench: build  ## latency and throughput of every transport, beside their floors and bars: out/latency*.csv
	@$(PYTHON_VENV) bench/latency/bench.py

bench-peers:  ## ours beside Coal, FCL and Bullet, which it installs: times and errors; rewrites docs/performance.*
	@tools/setup.sh tools/peers_packages.txt
	@tools/build.sh release clearance-peers-export clearance-peers-ours
	@$(PYTHON_VENV) bench/peers/bench_peers.py

bench-broad: setup  ## the ways to find near pairs, alone and within queries; rewrites docs/results/broad.csv and docs/performance.md
	@tools/build.sh release clearance-broad
	@build/bin/clearance-broad --csv docs/results/broad.csv
	@$(PYTHON_VENV) bench/broad/broad.py

bench-sections: build  ## the longest that the loop is away from its transports, by kind of request; rewrites docs/results/sections.csv
	@$(PYTHON_VENV) bench/latency/bench_sections.py

bench-classes: build  ## what a client of the class control waits beside the worst of the others; rewrites docs/results/classes.csv
	@$(PYTHON_VENV) bench/latency/bench_classes.py

bench-view: build  ## what a control loop waits while a viewer looks at its daemon; rewrites docs/results/view.csv
	@$(PYTHON_VENV) bench/latency/bench_view.py

bench-robots: build  ## MotionBenchMaker's problems: is a state valid, how near is it to contact, beside Pinocchio and Coal, which it installs; RRT-Connect end to end; rewrites docs/results/robots.csv and rrt.csv, the tables and the picture of docs/robots.md
	@$(PYTHON_VENV) bench/robots/bench_robots.py --csv docs/results/robots.csv
	@$(PYTHON_VENV) bench/robots/bench_rrt.py --csv docs/results/rrt.csv
	@$(PYTHON_VENV) tools/readme_tables.py
	@$(PYTHON_VENV) bench/robots/draw.py

bench-motions: build  ## edges of the same problems, proved free all along, beside sampling them; free bodies beside FCL; rewrites docs/results/motions.csv and free_bodies.csv
	@$(PYTHON_VENV) bench/robots/bench_motions.py --csv docs/results/motions.csv
	@$(PYTHON_VENV) bench/robots/bench_free_bodies.py --csv docs/results/free_bodies.csv

bench-ompl: build  ## the same problems planned by OMPL, with edges that are sampled and with edges that are proved; rewrites docs/results/ompl.csv
	@$(PYTHON_VENV) bench/robots/bench_ompl.py --csv docs/results/ompl.csv

bench-surfaces: build  ## meshes that are not convex, beside Coal, which it installs; rewrites docs/results/surfaces.csv, pieces.csv and link_meshes.csv
	@$(PYTHON_VENV) bench/surfaces/bench_surfaces.py --csv docs/results/surfaces.csv
	@$(PYTHON_VENV) bench/surfaces/bench_pieces.py --csv docs/results/pieces.csv
	@$(PYTHON_VENV) bench/robots/bench_link_meshes.py --csv docs/results/link_meshes.csv

bench-clouds: build  ## points against a robot, beside Coal's octree, which it installs; rewrites docs/results/clouds.csv
	@$(PYTHON_VENV) bench/surfaces/bench_clouds.py --csv docs/results/clouds.csv

bench-sweep: build  ## a sweep on Ray, which it installs, beside the engine alone; rewrites docs/results/sweep.csv
	@$(PYTHON_VENV) bench/sweep/bench_sweep.py --csv docs/results/sweep.csv

bench-load: build  ## how long 1000 meshes take to load, with an empty cache and with a full one; rewrites docs/results/load.csv
	@$(PYTHON_VENV) bench/load/bench_load.py --csv docs/results/load.csv

certify: setup  ## a million pairs of every hard class of hulls and of meshes against exact arithmetic, 100,000 motions, and 30,000 certificates of each class before a judge of their own; rewrites docs/results/*accuracy.csv
	@tools/build.sh release clearance-certify clearance-certificates
	@rm -rf out/certificates && mkdir -p out
	@build/bin/clearance-certificates --cases 30000 --meshes 3000 --python 1000 --motions 400 --python-motions 40 --out out/certificates
	@$(PYTHON_VENV) tools/check_certificate.py out/certificates/*.json
	@build/bin/clearance-certify --pairs 1000000 --seed 1 --slack 2000 --csv docs/results/accuracy.csv --failures out/certify_failures.txt
	@build/bin/clearance-certify --motions 100000 --seed 1 --csv docs/results/motion_accuracy.csv
	@build/bin/clearance-certify --meshes --pairs 1000000 --seed 1 --csv docs/results/mesh_accuracy.csv --failures out/certify_mesh_failures.txt

tradeoff: setup  ## time against accuracy for every setting of a query; what robots' meshes are taken for; proved edges beside sampled ones; rewrites docs/results/tradeoff.csv, shapes.csv, edges.csv and docs/tradeoff.*
	@tools/build.sh release product clearance-tradeoff
	@build/bin/clearance-tradeoff --csv docs/results/tradeoff.csv
	@$(PYTHON_VENV) bench/robots/bench_shapes.py --csv docs/results/shapes.csv
	@$(PYTHON_VENV) bench/tradeoff/edges.py --csv docs/results/edges.csv
	@$(PYTHON_VENV) bench/tradeoff/tradeoff.py

report: setup  ## the experiments of the 2023 report with its systems, ours and Coal; rewrites docs/report.* and docs/results/report.csv
	@tools/build.sh release clearance-report
	@$(PYTHON_VENV) bench/report/report.py --measure

report-gpu: setup  ## the same with the systems on this machine's GPU; writes docs/results/report_*.csv
	@tools/build.sh release clearance-report clearance-gpu-bench clearance_cuda
	@tools/gpu.sh report
	@$(PYTHON_VENV) bench/report/report.py

gpu-compile: setup  ## the kernels for every GPU architecture from 7.5 to 12.0; needs nvcc, but no GPU
	@tools/build.sh gpus kernels

gpu-test: setup  ## the cuda backend against the CPU and the exact judge, on this machine's GPU
	@tools/build.sh release $$(tools/gpu.sh programs test) clearance-gpu-bench clearance_cuda
	@tools/gpu.sh test

gpu-certify: setup  ## a million pairs of every hard class on this machine's GPU against exact arithmetic, and 100,000 motions; writes docs/results/*accuracy_*.csv
	@tools/build.sh release clearance-certify clearance-gpu-bench clearance_cuda
	@tools/gpu.sh certify

gpu-sanitize: setup  ## the cuda backend's tests under compute-sanitizer: memory, barriers, races
	@tools/build.sh release $$(tools/gpu.sh programs sanitize) clearance_cuda
	@tools/gpu.sh sanitize

gpu-bench: setup  ## throughput of the cuda backend beside the CPU's, on this machine; writes docs/results/gpu_*.csv
	@tools/build.sh release product clearance-gpu-bench clearance-gpu-plans clearance-gpu-daemon clearance-gpu-motions
	@tools/gpu.sh bench

gpu-several: setup  ## all GPUs of this machine together beside one of them; writes docs/results/gpus_*.csv
	@tools/build.sh release clearance-gpu-bench clearance_cuda
	@tools/gpu.sh several

clean:  ## remove build folders and out/ (.venv stays)
	@rm -rf build build-* out
