#!/bin/bash
# try_deb.sh DEB SCENES: installs the Debian package in an empty root, queries a daemon, and purges the package.
set -euo pipefail
deb=$1 scene=$2/nineteen/scene.yaml
export DEBIAN_FRONTEND=noninteractive CLEARANCE_CACHE=off
ours() { find / -xdev \( -path /proc -o -path /dev -o -path /tmp -o -path /var/lib/dpkg -o -path /var/cache/apt \) -prune -o -iname "*clearance*" -print; }
[ -z "$(ours)" ] || { echo "there is something already: $(ours)" >&2; exit 1; }

apt-get update -q >/dev/null
apt-get install -y -q --no-install-recommends "$deb" >/dev/null
[ "$(clearance --version)" = "clearance $(dpkg-query -W -f '${Version}' clearance)" ]
getent passwd clearance >/dev/null
grep -qx 'ExecStart=/usr/bin/clearanced --config /etc/clearance/clearanced.toml' /usr/lib/systemd/system/clearanced.service
systemd-analyze verify /usr/lib/systemd/system/clearanced.service
# The completion offers commands and their options.
(
  . /usr/share/bash-completion/completions/clearance
  COMP_WORDS=(clearance qu) COMP_CWORD=1; _clearance; [ "${COMPREPLY[*]}" = query ]
  COMP_WORDS=(clearance query --max-d) COMP_CWORD=2; _clearance; [[ " ${COMPREPLY[*]} " = *" --max-distance "* ]]
)
# Its man pages show its programs' help. (An image may leave out share/man.)
dpkg-deb --fsys-tarfile "$deb" | tar -xO ./usr/share/man/man1/clearance.1.gz | gzip -d | grep 'max\\-distance' >/dev/null
dpkg-deb --fsys-tarfile "$deb" | tar -xO ./usr/share/man/man8/clearanced.8.gz | gzip -d | grep 'real\\-time' >/dev/null
# A daemon that reads meshes, and one of its answers.
folder=$(mktemp -d)
mkfifo "$folder/ready"
clearanced --scene "$scene" --log-level error --zmq "ipc://$folder/c.ipc" --ready-fd 3 3>"$folder/ready" &
daemon=$!
grep -q ipc "$folder/ready"
clearance query --connect "ipc://$folder/c.ipc" --reduce min >"$folder/answer"
[ -s "$folder/answer" ]
kill "$daemon"
wait "$daemon"

mkdir -p /var/cache/clearance && touch /var/cache/clearance/kept /etc/clearance/clearanced.toml
apt-get purge -y -q clearance >/dev/null
if getent passwd clearance >/dev/null; then echo "the user is left" >&2; exit 1; fi
[ -z "$(ours)" ] || { echo "left behind: $(ours)" >&2; exit 1; }
echo "$(basename "$deb"): installed, asked, purged without a trace"
