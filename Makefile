# The everyday commands. The work is done by CMake (CMakePresets.json), ctest, pytest and the scripts in tools/.

PYTHON_VENV := .venv/bin/python
CORES := $(shell nproc)

.DEFAULT_GOAL := help
.PHONY: help build test test-extras lint fuzz soak demo bench tradeoff certify prove gpu-test gpu-bench clean

help:  ## this list
	@echo "make TARGET, one of"
	@sed -nE 's/^([a-z-]+):.*##  ?(.*)/  \1\t\2/p' $(MAKEFILE_LIST) | expand -t 12

build:  ## build daemon and command line in build/bin, Python package in .venv
	@tools/setup.sh
	@tools/build.sh release product

test:  ## run every test: ctest, which runs pytest beside its own
	@tools/setup.sh
	@tools/build.sh release
	@ctest --test-dir build -j $(CORES) --output-on-failure

test-extras:  ## tests that take more packages or minutes: installing (wheels, deb), 64-bit ARM, examples, the site, fuzzing, robots, races, kernels, the proof; EXTRAS="fuzz races"
	@tools/setup.sh
	@tools/extras.sh $(EXTRAS)

lint:  ## check the format of C++ (clang-format), format, lint and types of Python (ruff, mypy), and vocabulary; installs the tools into .venv
	@tools/setup.sh
	@tools/lint.sh

SECONDS ?= 600
fuzz:  ## run libFuzzer on every parser of untrusted bytes, SECONDS=600 for each target; installs clang; rewrites docs/results/fuzz.csv
	@tools/setup.sh tools/packages/fuzz.txt
	@tools/build.sh fuzz fuzzers
	@$(PYTHON_VENV) tools/fuzz.py --seconds $(SECONDS) --csv docs/results/fuzz.csv

MINUTES ?= 60
SEED ?= 1
soak:  ## inject faults (docs/service/safety.md): 1000 clients killed, 80 daemons, 30,000 bad inputs, then MINUTES=60 of all at random, SEED=1; rewrites docs/results/soak.csv
	@tools/setup.sh
	@tools/build.sh release test_client_faults test_daemon_faults test_limit_faults test_input_faults clearance-soak
	@for test in client daemon limit input; do CLEARANCE_FAULT_ROUNDS=26 build/bin/test_$${test}_faults --gtest_brief=1 || exit 1; done
	@build/bin/clearance-soak --minutes $(MINUTES) --seed $(SEED) --csv docs/results/soak.csv

demo:  ## move an arm by joint messages, query it over all three transports, and draw out/demo.png
	@tools/setup.sh
	@tools/build.sh release demo_programs
	@$(PYTHON_VENV) tools/demo.py

bench:  ## measure latency and throughput; another benchmark by SUITE="robots rrt" OPTIONS="--rounds 5", a small run by QUICK=1; SUITE=list lists them
	@python3 bench/run.py $(if $(QUICK),--quick) $(or $(SUITE),latency) $(OPTIONS)

tradeoff:  ## measure what accuracy costs: time against tolerance, margin and model; rewrites docs/tradeoff.md and its picture
	@python3 bench/run.py $(if $(QUICK),--quick) tradeoff $(OPTIONS)

certify:  ## check a million pairs of every hard class of hulls and meshes, 30,000 motions of each kind, ten million stops, a million states and 100,000 edges of each robot and 30,000 certificates of each class against exact arithmetic, on THREADS=all cores; rewrites docs/results/*accuracy.csv
	@tools/setup.sh
	@tools/build.sh release clearance-certify clearance-certificates
	@tools/certify.sh

prove:  ## have Coq check the proof of the float64 bounds against the source (docs/trust/proof.md), and 36 random changes of it; installs Coq
	@tools/setup.sh
	@tools/extras.sh prove

gpu-test:  ## compare the cuda backend with the CPU and exact arithmetic, on this machine's GPU; TASK=certify: a million pairs, TASK=sanitize: under compute-sanitizer
	@tools/setup.sh
	@targets=$$(tools/gpu.sh programs $(or $(TASK),test)) && tools/build.sh release $$targets
	@tools/gpu.sh $(or $(TASK),test)

gpu-bench:  ## compare the throughput of the cuda backend and the CPU; TASK=several: all GPUs and one, TASK=report: the 2023 report's systems; writes docs/results/*_DEVICE.csv
	@tools/setup.sh
	@targets=$$(tools/gpu.sh programs $(or $(TASK),bench)) && tools/build.sh release $$targets
	@tools/gpu.sh $(or $(TASK),bench)

clean:  ## remove build folders and out/ (.venv stays)
	@rm -rf build build-* out
