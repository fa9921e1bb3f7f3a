"""Keep the balance under pushes with the ZMP of the skin, and with that of force/torque sensors (thesis 4.3.1).

    python control/examples/balance.py [--seeds 24]

The robot stands on its full soles, or on a beam under the middle half of them. It is pushed for 0.1 s at the chest,
from one of eight directions. The controller is that of eq. 4.27 to 4.29 with the gains of table 2, and the ankles turn
the soles. It gets the ZMP either from the soles or from simulated force/torque sensors in the ankles. Both are recorded
in each run. The largest push that the robot survives is sought: it is doubled until the robot falls, then bisected.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from biped import FLAT, PERIOD, Biped, Faults
from experiment import arguments, distances, film_both, report, run_all, spread
from walker import Gains, Walker

BEAM = """
<geom class="terrain" type="box" size=".05 .3 .03" pos=".02 0 -.03"/>
<geom class="terrain" type="plane" pos="0 0 -.06" size="10 10 .1" material="tiles" rgba="1 1 1 1"/>"""
GROUND = {"full sole": FLAT, "half sole": BEAM}
LABELS = {"skin": "ZMP by skin", "ankle": "ZMP by ankles", "none": "no feedback"}  # of what feels the ZMP
SOURCES = ("skin", "ankle")
TABLE_2 = Gains(dcm=1.5, zmp=0.5, com=1.0)
DIRECTIONS = 8
SEEDS = 3 * DIRECTIONS  # each direction counts equally
START, PUSH, END = 0.5, 0.1, 4.0  # begin of a push, its duration, and end of a run [s]
FIRST, RESOLUTION = 8.0, 1.0  # push with which the search begins, and interval with which it ends [N s]
SENSITIVITY = 0.1  # standard deviation of the sensitivity of the cells
Array = np.ndarray


@dataclass(frozen=True)
class Case:
    """One search for the largest push."""

    ground: str
    source: str
    seed: int
    period: float = PERIOD  # of the control [s]

    @property
    def angle(self) -> float:
        """Direction of the push from straight ahead [rad]."""
        return 2 * np.pi * (self.seed % DIRECTIONS) / DIRECTIONS


@dataclass(frozen=True)
class Result:
    """What came out of a search."""

    survived: float  # largest push [N s]
    apart: Array  # distances of both ZMPs in the runs without a fall [m]
    moved: float  # largest distance of the ZMP from where it was before the push [m]


def push(case: Case, impulse: float, each: Callable[[Biped], None] | None = None) -> tuple[bool, Array]:
    """Return whether the robot stands after a push [N s], and the ZMPs (n, 2, 2) by skin and by ankles."""
    faults = Faults(sensitivity=SENSITIVITY)
    robot = Biped(GROUND[case.ground], case.seed, faults, proximity=False, period=case.period)
    walker = Walker(robot, [], gains=TABLE_2, source=case.source, feels=case.source == "skin")
    direction = np.array((np.cos(case.angle), np.sin(case.angle), 0.0))
    while robot.data.time < END and not robot.fallen:
        targets, torques = walker.cycle(robot.senses())
        pushes = START <= robot.data.time < START + PUSH - robot.period / 2
        robot.step(targets, torques, direction * impulse / PUSH if pushes else None)
        if each:
            each(robot)
    rows = [(row["zmp_skin"], row["zmp_ankle"]) for row in walker.log.rows if row["time"] > START / 2]
    return not robot.fallen, np.array(rows)


def largest_push(survives: Callable[[float], bool], first: float, resolution: float) -> float:
    """Return the largest push that is survived [N s]; zero if none is.

    Parameters
    ----------
    survives : callable
        Called with a push [N s].
    first : float
        Push with which the search begins. It is doubled until it is not survived [N s].
    resolution : float
        Largest interval between the push survived and one that is not, with which the search ends [N s].
    """
    low, high = 0.0, first
    while survives(high):
        low, high = high, 2 * high
    while high - low > resolution:
        middle = (low + high) / 2
        low, high = (middle, high) if survives(middle) else (low, middle)
    return low


def run(case: Case) -> Result:
    """Search for the largest push."""
    apart, moved = [np.zeros(0)], [0.0]

    def survives(impulse: float) -> bool:
        stands, zmps = push(case, impulse)
        if stands:
            apart.append(np.linalg.norm(zmps[:, 0] - zmps[:, 1], axis=1))
            moved.append(float(np.nanmax(np.linalg.norm(zmps[:, 0] - zmps[0, 0], axis=1))))
        return stands

    survived = largest_push(survives, FIRST, RESOLUTION)
    return Result(survived, np.concatenate(apart), max(moved))


def draw(results: dict, cases: dict, path) -> None:
    """Draw the largest pushes by direction, and how far both ZMPs are apart, as figure 42 of the thesis.

    Parameters
    ----------
    results, cases : dict of lists
        Searches and their cases by the contact and by what feels the ZMP.
    path : path
        Of the picture.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    grounds, sources = (list(dict.fromkeys(key[k] for key in results)) for k in range(2))
    colours, columns = ("#4c72b0", "#c44e52", "#55a868"), len(grounds) + 1
    figure = plt.figure(figsize=(3 * columns, 3.4), layout="constrained")
    for k, ground in enumerate(grounds):
        ax = figure.add_subplot(1, columns, k + 1, projection="polar")
        for source, colour in zip(sources, colours):
            angles = np.array([case.angle for case in cases[ground, source]])
            survived = np.array([result.survived for result in results[ground, source]])
            around = np.unique(angles)
            means = np.array([survived[angles == angle].mean() for angle in around])
            closed = np.append(np.arange(len(around)), 0)
            ax.plot(around[closed], means[closed], color=colour, label=LABELS[source])
            ax.plot(angles, survived, ".", color=colour, ms=4)
        ax.set_theta_zero_location("N")
        ax.set_rmax(max(search.survived for searches in results.values() for search in searches) + 1)
        ax.set_title(f"largest push survived [N s], {ground}", fontsize=9)
        ax.tick_params(labelsize=7)
        if k == 0:
            ax.legend(fontsize=7, loc="lower left", bbox_to_anchor=(-0.42, -0.3))
    ax = figure.add_subplot(1, columns, columns)
    for ground, style in zip(grounds, ("-", "--")):
        for source, colour in zip(sources, colours):
            apart = np.sort(np.concatenate([result.apart for result in results[ground, source]]))
            ax.plot(
                1e3 * apart, np.linspace(0, 1, len(apart)), style, color=colour, label=f"{ground}; {LABELS[source]}"
            )
    ax.set_xlabel("ZMP by skin to ZMP by ankles [mm]", fontsize=9)
    ax.set_ylabel("fraction of the cycles", fontsize=9)
    ax.set_xlim(left=0)
    ax.legend(fontsize=7)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Run all cases; print a table; draw."""
    given = arguments(__doc__, seeds=SEEDS).parse_args()
    kinds = [(ground, source) for ground in GROUND for source in SOURCES]
    cases = {kind: [Case(*kind, seed) for seed in range(given.seeds)] for kind in kinds}
    results = run_all(run, cases, given)
    rows = []
    for (ground, source), searches in results.items():
        rows.append(
            (
                ground,
                LABELS[source].removeprefix("ZMP by "),
                f"{spread([search.survived for search in searches], 1)}, steps of {RESOLUTION:g}",
                distances(search.apart for search in searches),
                spread([1e3 * search.moved for search in searches]),
            )
        )
    heads = (
        "contact",
        "ZMP by",
        "largest push survived [N s]",
        "ZMPs apart, mean / 95 % / maximum [mm]",
        "ZMP moves [mm]",
    )
    report(given, heads, rows)
    draw(results, cases, given.out / "balance.png")
    if not given.no_animation:
        films = [
            lambda each, ground=ground: push(
                Case(ground, "skin", 0), max(results[ground, "skin"][0].survived, 1.0), each
            )
            for ground in GROUND
        ]
        film_both(films, given.out / "balance.gif", azimuth=90)


if __name__ == "__main__":
    main()
