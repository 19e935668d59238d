"""Shared by tests of threads."""

import pathlib
import subprocess
import sys
import threading

from patience import PATIENCE_S


def turns_beside(work):
    """Number of turns of this thread's loop while another one does `work`; small if it holds the interpreter's lock."""
    begun, done = threading.Event(), threading.Event()

    def run():
        begun.set()
        try:
            work()
        finally:
            done.set()

    thread = threading.Thread(target=run)
    thread.start()
    begun.wait()
    turns = 0
    while not done.is_set():
        turns += 1
    thread.join()
    return turns


_ENDS = """
import sys, threading
sys.path.insert(0, {folder!r})
import conftest
{prepare}

def repeat(call):
    try:
        call()
    finally:
        begun.release()
    while True:
        call()

calls = [{calls}]
begun = threading.Semaphore(0)
for call in calls:
    threading.Thread(target=repeat, args=(call,), daemon=True).start()
for call in calls:
    begun.acquire()
sys.exit(3)
"""


def end_with_daemon_threads(prepare, calls):
    """Runs a program that ends with 3 while one of its daemon threads repeats each call. Returns how it ended."""
    lines = [f"lambda: {call}" for call in calls]
    code = _ENDS.format(folder=str(pathlib.Path(__file__).parent), prepare=prepare, calls=", ".join(lines))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE_S)
    return done.returncode, done.stderr
