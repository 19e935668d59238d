#!/usr/bin/env bash
# Installs the requirements of the build, the tests and the demo: Debian packages through apt, Python packages into .venv.
# Only missing ones are installed; a second run changes nothing, and needs neither root nor a network.
#
#   tools/setup.sh LIST...              the Debian packages of other lists, too
#   PYTHON=python3.12 tools/setup.sh    another Python than python3
#   CLEARANCE_APT=0 tools/setup.sh      leave apt alone (the packages come from elsewhere)
set -euo pipefail
. "$(dirname "$0")/step.sh"
lists=(tools/packages/build.txt "$@")

python=${PYTHON:-python3}
command -v "$python" >/dev/null || die "no $python on this machine; install it (apt-get install python3) or set PYTHON"
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 9))' ||
  die "$("$python" --version) is too old: Python 3.9 or newer is needed; set PYTHON=/path/to/python3"

python_has_venv() { "$python" -c 'import ensurepip, venv' 2>/dev/null; }
python_has_headers() {
  "$python" -c 'import os, sys, sysconfig
sys.exit(not os.path.exists(os.path.join(sysconfig.get_paths()["include"], "Python.h")))'
}
# pythonX.Y if it is the system's own, so that its venv and headers are Debian packages.
system_python() { "$python" -c 'import sys; print("python%d.%d" % sys.version_info[:2] if sys.base_prefix == "/usr" else "")'; }

# Tests whether apt's lists contain a package. (A fresh image has no lists, and then none contains even g++.)
known() { apt-cache show "$1" >/dev/null 2>&1; }

missing_packages() {
  local name
  sed 's/#.*//' "${lists[@]}" | while read -r name; do
    [ -n "$name" ] || continue
    if [[ $name = *\? ]]; then  # not every distribution has it
      name=${name%\?}
      ! known "$name" && known g++ && continue
    fi
    [ "$(dpkg-query -W -f '${db:Status-Status}' "$name" 2>/dev/null)" = installed ] || echo "$name"
  done
  name=$(system_python)
  if [ -n "$name" ]; then
    # The versioned names also work for a Python that is not the distribution's default.
    python_has_venv || echo "$name-venv"
    python_has_headers || echo "$name-dev"
  fi
}

install_packages() {
  local apt=("$@")
  apt+=(-o DPkg::Lock::Timeout=300)
  # The lists may be absent (a fresh image) or old (files that the mirror no longer has).
  if ! apt-get --simulate install --no-install-recommends "${missing[@]}" >/dev/null 2>&1; then
    "${apt[@]}" update
    mapfile -t missing < <(missing_packages)
  fi
  "${apt[@]}" install -y --no-install-recommends "${missing[@]}" && return
  "${apt[@]}" update
  "${apt[@]}" install -y --no-install-recommends "${missing[@]}"
}

if [ "${CLEARANCE_APT:-1}" != 0 ]; then
  command -v dpkg-query >/dev/null ||
    die "this is not a Debian or Ubuntu machine: install what tools/packages/build.txt lists by other means, then run with CLEARANCE_APT=0"
  mapfile -t missing < <(missing_packages)
  if ((${#missing[@]})); then
    apt=(env DEBIAN_FRONTEND=noninteractive apt-get)
    if [ "$(id -u)" != 0 ]; then
      if ! command -v sudo >/dev/null || ! { sudo -n true 2>/dev/null || { [ -t 0 ] && sudo -v; }; }; then
        say "Packages are missing, and this user cannot install them. As root, run"
        say ""
        say "    apt-get update && apt-get install -y --no-install-recommends ${missing[*]}"
        say ""
        say "and then the same make command again."
        exit 1
      fi
      apt=(sudo "${apt[@]}")
    fi
    say "Missing Debian packages: ${missing[*]}"
    step apt "Install ${#missing[@]} Debian packages" install_packages "${apt[@]}"
  fi
fi
python_has_venv || die "$python has no venv module (python3-venv); install it or set PYTHON to another Python"
python_has_headers || die "$python has no headers (python3-dev); install them or set PYTHON to another Python"

# .venv is recreated if its Python is gone or it was moved (its scripts name their interpreter by absolute path), and
# refilled if the requirements changed.
venv=$(realpath -m .venv)
stamp=$venv/clearance-setup
want=$({ echo "$venv"; cat requirements.txt; } | sha256sum | cut -d' ' -f1)
if ! "$venv/bin/python" -c 'import pip' 2>/dev/null || { [ -f "$stamp" ] && [ "$(sed -n 2p "$stamp")" != "$venv" ]; }; then
  step venv "Make .venv ($("$python" --version))" "$python" -m venv --clear "$venv"
fi
if [ "$(sed -n 1p "$stamp" 2>/dev/null)" != "$want" ]; then
  step pip "Install Python packages into .venv" \
    "$venv/bin/python" -m pip install --disable-pip-version-check --progress-bar off -r requirements.txt
  printf '%s\n%s\n' "$want" "$venv" >"$stamp"
fi
