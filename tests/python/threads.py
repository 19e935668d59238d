"""What tests of threads share."""

import threading


def turns_beside(work):
    """How many turns this thread's loop makes while another does `work`: few if that holds the interpreter's lock."""
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
