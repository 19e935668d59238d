#!/bin/sh
# in_root.sh ROOT COMMAND...: runs a command in another system's root, with its own /proc and /dev, and ends its
# remaining processes.
set -eu
exec unshare --mount --pid --fork --kill-child sh -euc '
  root=$1
  shift
  mount --bind /dev "$root/dev"
  mount -t proc proc "$root/proc"
  exec chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 "$@"
' in_root "$@"
