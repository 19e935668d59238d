#!/usr/bin/env bash
# Builds the wheels, into dist/: tools/wheel.sh [native] [py310] [abi3] [client]; without a name all. No package index has
# them.
#
#   native   package, daemon, command line and mesh loader for .venv's Python, with every library that they need but glibc's and
#            the compiler's
#   py310    the same for Python 3.10: built with Ubuntu 22.04's Python, and with this machine's compiler and libraries
#   abi3     the same for every Python from 3.12 on: built with Debian 13's Python
#   client   the client alone, of Python alone: Python 3.9 and later, shared memory and ZeroMQ
#
# All are built in build-wheel, where only the extension modules are compiled for each Python: compiler, CMake, ninja and LCM
# are those of this machine and .venv, so that the commands for other objects stay the same.
#
# A wheel asks for glibc 2.35 at most (Ubuntu 22.04), and takes at most 60 MB; anything else is an error here. The kernels
# come with it, in a library that is opened where a GPU is asked for; CLEARANCE_CUDA=OFF leaves them out.
set -euo pipefail
. "$(dirname "$0")/step.sh"

platform=manylinux_2_35_$(uname -m)
most_bytes=60000000
kinds=("$@")
((${#kinds[@]})) || kinds=(native py310 abi3 client)

tools_in_venv() {
  cmp -s tools/packages/wheel_requirements.txt .venv/clearance-wheel && return
  step wheel-setup "Install what makes wheels into .venv" \
    .venv/bin/python -m pip install --disable-pip-version-check --progress-bar off -r tools/packages/wheel_requirements.txt
  cp tools/packages/wheel_requirements.txt .venv/clearance-wheel
}

build_native() { build .venv/bin/python; }

build_py310() { build_elsewhere jammy 3.10; }
build_abi3() { build_elsewhere trixie 3.13 -C wheel.py-api=cp312; }

# build_elsewhere SUITE VERSION OPTION...: with the Python of another system. It runs under its own loader and with its own
# glibc, which the wheel must not need; everything else is from here.
build_elsewhere() {
  local suite=$1 version=$2 root packages=$PWD/out/wheel-$1/packages python=$PWD/out/wheel-$1/python$2 triplet
  shift 2
  triplet=$(uname -m)-linux-gnu
  root=$(tools/root.sh "$suite-build" python3 python3-dev)
  mkdir -p "$packages"
  # Debian's Python.h includes processor-dependent parts as <TRIPLET/python3.N/pyconfig.h>, below /usr/include. That
  # folder also has a C library's headers, which must not be found, so a link from the folder of Python.h leads there.
  mkdir -p "$root/usr/include/python$version/$triplet"
  ln -sfnr "$root/usr/include/$triplet/python$version" "$root/usr/include/python$version/$triplet/python$version"
  # pip adds the dependencies of its own Python; those of Python 3.10 alone are named (exceptiongroup, tomli).
  [ -d "$packages/nanobind" ] || step "wheel-$suite" "Install what builds for Python $version" .venv/bin/python -m pip install \
    --disable-pip-version-check --progress-bar off --target "$packages" --python-version "$version" --implementation cp \
    --only-binary=:all: --platform "$platform" --platform "manylinux_2_28_$(uname -m)" --platform "manylinux_2_17_$(uname -m)" \
    --platform "manylinux2014_$(uname -m)" --platform "manylinux_2_12_$(uname -m)" \
    pip scikit-build-core exceptiongroup tomli nanobind==2.9.2
  cat >"$python" <<SCRIPT
#!/bin/sh
exec env PYTHONHOME=$root/usr PYTHONPATH=$packages $(echo "$root/usr/lib/$triplet"/ld-linux-*.so.2) --argv0 "\$0" \\
  --library-path $root/usr/lib/$triplet $root/usr/bin/python$version "\$@"
SCRIPT
  chmod +x "$python"
  build "$python" "$@"
}

# build PYTHON OPTION...: a wheel with its libraries.
build() {
  local python=$1 raw=out/wheel/raw packages
  shift
  tools_in_venv
  packages=$(.venv/bin/python -c 'import sysconfig; print(sysconfig.get_path("platlib"))')
  "$python" -c 'import nanobind, scikit_build_core' || die "$python lacks what the build needs (requirements.txt)"
  rm -rf "$raw"
  step wheel-build "Build the wheel for $("$python" --version)" \
    env CC="${CC:-cc}" CXX="${CXX:-c++}" CMAKE_EXECUTABLE="$packages/cmake/data/bin/cmake" \
    "$python" -m pip wheel --disable-pip-version-check --no-deps --no-build-isolation -v -C build-dir=build-wheel \
    -C cmake.define.lcm_DIR="$packages/lib/lcm/cmake" -C cmake.define.CLEARANCE_STATIC_GLIB=ON \
    -C cmake.define.CLEARANCE_CUDA="${CLEARANCE_CUDA:-ON}" "$@" -w "$raw" .
  step wheel-repair "Put the libraries into it" env PATH="$PWD/.venv/bin:$PATH" \
    .venv/bin/python -m auditwheel repair --plat "$platform" --only-plat -w out/wheel "$raw"/*.whl
  keep out/wheel/clearance-*.whl
}

build_client() {
  local folder=out/wheel/client
  tools/build.sh release python_pure_client
  rm -rf "$folder"  # files that have moved
  mkdir -p "$folder"
  cp -rL build/python/clearance_client LICENSE client/python/pure/pyproject.toml "$folder"
  find "$folder" -name __pycache__ -prune -exec rm -rf {} +
  step wheel-client "Build the client's wheel" .venv/bin/python -m pip wheel --disable-pip-version-check --no-deps \
    --no-build-isolation -w out/wheel "$folder"
  keep out/wheel/clearance_client-*.whl
}

# Moves a finished wheel to dist/, unless it is too large.
keep() {
  local wheel=$1 bytes
  (($# == 1)) || die "expected one wheel, got $*"
  bytes=$(stat -c %s "$wheel")
  ((bytes <= most_bytes)) || die "$wheel has $bytes bytes, and may have $most_bytes"
  mkdir -p dist
  mv "$wheel" dist/
  say "dist/$(basename "$wheel"): $((bytes / 1000)) kB"
}

rm -rf out/wheel
for kind in "${kinds[@]}"; do
  case $kind in
    native | py310 | abi3 | client) "build_$kind" ;;
    *) die "there is no wheel '$kind'; expected native, py310, abi3 or client" ;;
  esac
done
