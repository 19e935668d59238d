#!/usr/bin/env bash
# Configures (once) and builds a preset: tools/build.sh [PRESET=release] [TARGET...]
#
# Jobs: one per core, limited to 1.5 GB of free memory each (the engine's and CGAL's largest files); JOBS=n overrides
# that.
set -euo pipefail
. "$(dirname "$0")/step.sh"

preset=${1:-release}
shift || true
case $preset in
  release) dir=build ;;
  *) dir=build-$preset ;;
esac
if [ -z "${JOBS:-}" ]; then
  by_memory=$(awk '/MemAvailable/ {print int($2 / 1.5e6)}' /proc/meminfo)
  JOBS=$(nproc)
  ((by_memory >= JOBS)) || JOBS=$by_memory
  ((JOBS >= 1)) || JOBS=1
fi

# Ninja reconfigures by itself when a CMakeLists.txt changes; after a move the cache has another path.
if [ ! -f "$dir/build.ninja" ] || ! grep -qx "CMAKE_HOME_DIRECTORY:INTERNAL=$PWD" "$dir/CMakeCache.txt"; then
  [ ! -f "$dir/CMakeCache.txt" ] || rm -f "$dir/CMakeCache.txt"
  step "configure-$preset" "Configure ($preset)" cmake --preset "$preset"
fi
targets=()
for target in "$@"; do targets+=(--target "$target"); done
step "build-$preset" "Build ($preset, $JOBS jobs)" cmake --build "$dir" -j "$JOBS" "${targets[@]}"
