#!/usr/bin/env bash
# Creates the root of another system, once, for tests that need a separate machine: tools/root.sh SUITE PACKAGE...
# Prints the folder, out/roots/SUITE. Needs root on Debian; another call may add packages.
#
#   bullseye bookworm trixie    Debian 11, 12, 13
#   jammy noble                 Ubuntu 22.04, 24.04
#   jammy-build trixie-build    others of the kind, with the packages of a build in addition to those of a run
#   arm64-bookworm              Debian 12 for 64-bit ARM: its packages unpacked and not set up, for a cross-compiler and qemu
set -euo pipefail
. "$(dirname "$0")/step.sh" >&2

suite=$1
shift
packages=("$@")
root=$PWD/out/roots/$suite
options=(--variant=minbase)
mirror=http://deb.debian.org/debian
[ "$(id -u)" = 0 ] || die "tools/root.sh makes roots by debootstrap, and needs to be root"
command -v debootstrap >/dev/null || die "there is no debootstrap: tools/setup.sh tools/packages/install.txt"

# Ubuntu's keys are not in a Debian package: the deb that contains them is verified by its digest.
ubuntu_keys() {
  local deb=out/roots/ubuntu-keyring.deb
  [ -f "$deb" ] || curl -sSfo "$deb" http://archive.ubuntu.com/ubuntu/pool/main/u/ubuntu-keyring/ubuntu-keyring_2021.03.26_all.deb
  echo "0d0e7ed6b112f5d03eabf3c7eb01ebdacf9c57714b279e90495cfc58c8c4520f  $deb" | sha256sum --check --quiet >&2
  dpkg-deb -x "$deb" out/roots/ubuntu-keyring
  echo "$PWD/out/roots/ubuntu-keyring/usr/share/keyrings/ubuntu-archive-keyring.gpg"
}

# Nothing of it needs to run on this machine, so that neither its kernel nor its root needs qemu.
unpack() {
  [ "$(cat "$root.packages" 2>/dev/null)" = "${packages[*]}" ] && return
  rm -rf "$root"
  step "root-$suite" "Make the root $suite" debootstrap --foreign --arch="${suite%-*}" "${options[@]}" \
    --include="$(IFS=,; echo "${packages[*]}")" "${suite#*-}" "$root" "$mirror" >&2
  local deb link
  for deb in "$root"/var/cache/apt/archives/*.deb; do
    dpkg-deb --fsys-tarfile "$deb" | tar -x -C "$root" --keep-directory-symlink
  done
  # Absolute links must be resolved from here.
  find "$root/usr/lib" -lname '/*' | while read -r link; do ln -sfnr "$root$(readlink "$link")" "$link"; done
  grep -rlE '/usr/(lib|include)' "$root"/usr/lib/*/cmake/{assimp,draco}* | xargs sed -Ei "s|([\";:])/usr([/\"])|\1$root/usr\2|g"
  echo "${packages[*]}" >"$root.packages"
}

mkdir -p out/roots
if [[ $suite = arm64-* ]]; then
  unpack
  echo "$root"
  exit
fi
if [ ! -f "$root.made" ]; then
  case ${suite%-build} in
    jammy | noble)
      mirror=http://archive.ubuntu.com/ubuntu
      options+=(--components=main,universe --keyring="$(ubuntu_keys)")
      ;;
  esac
  rm -rf "$root"
  step "root-$suite" "Make the root $suite" debootstrap "${options[@]}" "${suite%-build}" "$root" "$mirror" >&2
  if [[ $mirror = *ubuntu ]]; then echo "deb $mirror ${suite%-build}-updates main universe" >>"$root/etc/apt/sources.list"; fi
  touch "$root.made"
fi
cp /etc/resolv.conf "$root/etc/resolv.conf"
if [ "$(cat "$root.packages" 2>/dev/null)" != "${packages[*]}" ]; then
  step "root-$suite-packages" "Install into it: ${packages[*]}" tests/install/in_root.sh "$root" sh -ec '
    export DEBIAN_FRONTEND=noninteractive
    apt-get update
    apt-get install -y --no-install-recommends "$@"' sh "${packages[@]}" >&2
  echo "${packages[*]}" >"$root.packages"
fi
echo "$root"
