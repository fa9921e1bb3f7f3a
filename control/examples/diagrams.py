"""Diagrams of ZMP and DCM over time."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

Array = np.ndarray
ASSUMED = ("full sole assumed", "what is felt")  # titles of two walks
LINES = (  # of each panel: key of the log, name, colour, width
    ("zmp", "felt ZMP", "#4c72b0", 0.8),
    ("wanted", "desired ZMP", "#c44e52", 1.0),
    ("reference", "ZMP of the plan", "#dd8452", 0.8),
    ("dcm", "DCM", "#55a868", 1.0),
    ("dcm_reference", "DCM of the plan", "#8172b3", 0.8),
)


def draw_walks(runs: Mapping[str, Callable[[Callable[..., None]], Any]], path: Path) -> None:
    """Run cases, and draw their ZMP, DCM and supporting polygon over time, as figures 59 to 64 of the thesis.

    Of the polygon the extent along each axis is drawn; where it is oblique, the ZMP is limited to less than this.

    Parameters
    ----------
    runs : mapping from str to function
        By title. Each runs a case; its argument is to be called with the robot and the walker in each cycle.
    path : path
        Of the picture.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(
        2, len(runs), figsize=(6 * len(runs), 6), sharex=True, sharey="row", squeeze=False, layout="constrained"
    )
    for column, (title, run) in zip(axes.T, runs.items()):
        seen: dict[str, Any] = {}
        run(lambda robot, walker, seen=seen: seen.update(robot=robot, log=walker.log))
        log, fell = seen["log"], seen["robot"].fallen
        time = np.array([row["time"] for row in log.rows])
        for axis, ax in enumerate(column):
            low, high = (np.array([row["limits"][end][axis] for row in log.rows]) for end in (0, 1))
            ax.fill_between(time, low, high, color="#cccccc", alpha=0.5, lw=0, label="extent of the polygon")
            for key, name, colour, width in LINES:
                ax.plot(time, [row[key][axis] for row in log.rows], color=colour, lw=width, label=name)
            for landing in log.landings:
                ax.axvline(landing["time"], color="grey", lw=0.6, ls=":")
            for again in log.retracted:
                ax.axvline(again["time"], color="black", lw=0.8, ls="--")
            middle = np.concatenate((low, high))
            ax.set_ylim(middle.min() - 0.05, middle.max() + 0.05)
        column[0].set_title(f"{title}{', falls' if fell else ''}", fontsize=9)
        column[1].set_xlabel("time [s]; dotted: a landing, dashed: a foot is lifted again", fontsize=8)
    for ax, name in zip(axes[:, 0], ("ahead", "to the left")):
        ax.set_ylabel(f"{name} [m]")
    axes[0, 0].legend(fontsize=7, ncols=2)
    figure.savefig(path, dpi=110)
    plt.close(figure)
