"""Tasks of worker processes, in a module that imports little: each process imports it."""

import os
import signal
import time

from skin_calib_addon.common.atomic_file import write_bytes_safely

DEATHS = {
    "killed": ("killed, most likely because of insufficient memory", lambda: os.kill(os.getpid(), signal.SIGKILL)),
    "crashed": ("ended by the signal SIGSEGV", lambda: os.kill(os.getpid(), signal.SIGSEGV)),
    "left": ("exited with code 3", lambda: os._exit(3)),
}


def work(task):
    """Crash, or return the process id; print to stdout, which also carries the results."""
    print("output of a library")
    if task in DEATHS:
        DEATHS[task][1]()
    if task == "slow":
        time.sleep(600)
    if task == "deaf":
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
    return task, os.getpid()


def deaf_and_slow(task):
    return work("deaf"), work(task)


def write(path):
    """Write a file on a very slow disk."""
    if path:
        os.fsync = lambda handle: time.sleep(600)
        write_bytes_safely(path, b"half a file")


def group(task):
    return os.getpgrp()
