"""Starts clearanced for the demo and the benchmark: its endpoints, and its readiness."""
import os
import random
import socket
import struct
import time
from pathlib import Path

from processes import DemoError, ReadyNotice

ROOT = Path(__file__).resolve().parents[1]
BIN = ROOT / "build/bin"
GROUP = "239.255.76.67"  # LCM's own multicast address
ROUTE = f"ip link set lo up && ip route add {GROUP}/32 dev lo"


def start_daemon(stage, scene, prefix=(), options=(), program=BIN / "clearanced", seconds=30.0):
    """Starts clearanced on a scene file with its sockets in the stage's folder, and waits until it serves.

    prefix: a command that runs it, such as ("taskset", "-c", "0").
    options: additional options of the daemon.
    program: the daemon, if it is not this build's.
    seconds: timeout.

    Returns the process, {"shm": url, "zmq": url, "lcm": url} (lcm only if multicast works), and the seconds it took.
    """
    urls = {"shm": f"shm://{stage.folder}/shm.sock", "zmq": f"ipc://{stage.folder}/zmq.sock"}
    command = [
        *prefix,
        program,
        "--scene",
        scene,
        "--shm",
        urls["shm"][len("shm://") :],
        "--zmq",
        urls["zmq"],
        *options,
    ]
    port = free_udp_port()
    if multicast_works(port):
        urls["lcm"] = f"udpm://{GROUP}:{port}?ttl=0"
        command += ["--lcm", urls["lcm"]]
    notice = ReadyNotice(stage.folder)
    started = time.monotonic()
    process = stage.start("clearanced", command, env={**os.environ, "NOTIFY_SOCKET": notice.path})
    stage.wait_until(notice.arrived, "clearanced to become ready", seconds)
    return process, urls, time.monotonic() - started


def free_udp_port():
    """A port on which no other daemon on this machine listens at the moment."""
    for port in random.SystemRandom().sample(range(20000, 30000), 100):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("", port))
                return port
            except OSError:
                continue
    raise DemoError("found no free UDP port between 20000 and 30000")


def multicast_works(port):
    """True if a datagram to LCM's multicast group comes back to this machine."""
    word = random.randbytes(16)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver, \
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        try:
            receiver.bind(("", port))
            receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP,
                                struct.pack("4sI", socket.inet_aton(GROUP), socket.INADDR_ANY))
            receiver.settimeout(1.0)
            sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            sender.sendto(word, (GROUP, port))
            return receiver.recv(64) == word
        except OSError:
            return False
