"""The time of a fit's first call in a fresh process, after all imports.

A server process imports every library and calls nothing. Each cold time comes from a child that is forked from it,
reads the link and calls the fit once. What a peer prepares before the clock starts, as a smoothing factor, is prepared
in the child too.
"""

import multiprocessing
import os
import warnings
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import numpy as np

# Imported in the server, with what they import: ours, the paper's method and the peers.
LIBRARIES = ["time_error", "geomdl.fitting", "splipy", "splipy.surface_factory", "splinepy", "splinepy.helpme.fit"]
LIBRARIES += ["OCP.GeomAPI", "OCP.Approx", "OCP.GeomAbs", "OCP.gp", "OCP.collections", "scipy.interpolate"]
LONGEST = 120.0  # [s] for one child; a longer one is ended and gives no time


def cold_milliseconds(link: str, prepare: Callable) -> float:
    """Return the time of a first call in a process of its own [ms]; NaN where it fails.

    ``prepare`` must be picklable. From the link, which each process loads by its name, it makes the timed function.
    """
    context = multiprocessing.get_context("forkserver")
    os.environ["PYTHONPATH"] = str(Path(__file__).parent)  # where the server finds our modules
    context.set_forkserver_preload(LIBRARIES)  # has an effect on the first call only
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=first_call, args=(sender, link, prepare))
    process.start()
    sender.close()
    try:
        seconds = receiver.recv() if receiver.poll(LONGEST) else None
    except EOFError:  # the process crashed
        seconds = None
    process.kill()
    process.join()
    return np.nan if seconds is None else 1e3 * seconds


def first_call(sender, link: str, prepare: Callable) -> None:
    """Send the seconds of one call, or None where it fails."""
    from links import link_of

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            call = prepare(link_of(link))
            start = perf_counter()
            call()
            sender.send(perf_counter() - start)
    except Exception:
        sender.send(None)
