"""Time of the joint torques of contacts, on a robot of 13 links with skin and 30 joints: 0, 1 and 13 links in contact.

python control/examples/torques.py
"""

from itertools import cycle, islice
from statistics import median
from time import perf_counter

import numpy as np

from skin_control.tasks import contact_torques

LINKS, JOINTS = 13, 30
CALLS = 2000  # of each case; the cases take turns, so that other programs hardly count


def main():
    """Print the median time for each number of links in contact."""
    rng = np.random.default_rng(0)
    names = [f"link_{k}" for k in range(LINKS)]
    poses = dict.fromkeys(names, np.eye(4))
    jacobians = {name: rng.normal(size=(6, JOINTS)) for name in names}
    cases = {
        touched: {name: rng.normal(size=6) if k < touched else np.zeros(6) for k, name in enumerate(names)}
        for touched in (0, 1, LINKS)
    }
    seconds = {touched: [] for touched in cases}
    for touched, wrenches in islice(cycle(cases.items()), CALLS * len(cases)):
        start = perf_counter()
        rows = contact_torques(wrenches, poses, jacobians.__getitem__, JOINTS)
        seconds[touched].append(perf_counter() - start)
        assert rows.shape == (touched, JOINTS)
    for touched, times in seconds.items():
        print(f"{touched:2} of {LINKS} links in contact: {median(times) * 1e6:.0f} us")


if __name__ == "__main__":
    main()
