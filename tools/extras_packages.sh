# Sourced by extras.sh: tests of what is installed, as packages and from the source.

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
