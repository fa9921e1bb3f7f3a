"""Step elsewhere when a foothold is not safe, by what the sole feels (thesis 4.3.2).

    python control/examples/replanning.py [--seeds 20]

An obstacle of 3 cm is below the third of five steps. When a foot meets the ground, the skin gives the part of
the sole that is near it: by the pressed cells, and by the proximity sensors. If the part is small, the foot is lifted
again, and put down next to what it felt. Other walks know the felt foothold and make no new step, or assume the full
sole. The walk is slow: after a landing the ZMP stays below the other foot for a while, so that a foot can be lifted
again.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from biped import FEET, FLAT, PERIOD, SIDE, Biped
from diagrams import draw_walks
from estimator import SOLE_CENTRE, State
from experiment import arguments, count, film_both, report, run_all, spread, stands_and_steps
from foothold import full_sole
from shapes import HALF_SIZE, PITCH
from walker import Gait, Log, Walker, forward_steps, walk

from skin_calib_addon.runtime import Polygon, convex_hull
from skin_control.foothold import must_replan, sidestep

STEP, WIDTH, STEPS = 0.15, 0.18, 5  # [m, m, 1]
ONTO = 2  # index of the step onto the obstacle, of the right foot
HEIGHT = 0.03  # of the obstacles [m]
GAIT = Gait(single=0.9, double=0.6, hold=0.4)
MIN_AREA = 0.8  # epsilon_A of the thesis: parts of the sole near the ground up to this are not safe
NEAR = 0.012  # a proximity sensor with less is above what the sole stands on [m]
CELL = 0.015  # half the distance of the proximity sensors [m]
IMPACT = 0.02  # time after a contact in which the moment at the ankle is sought [s]
CLEARANCE = 0.015  # of the new step from the obstacle [m]
MAX_RETRIES = 2  # of one step
# What the controller uses: the part of the sole that bears, and new steps.
KINDS = {"full sole assumed": (False, False), "what is felt": (True, False), "what is felt, new steps": (True, True)}
SHOWN = "small block at the border"
SOLE = convex_hull(HALF_SIZE * [(1, 1), (-1, 1), (-1, -1), (1, -1)])  # about its centre
Array = np.ndarray


def block(x: tuple[float, float], y: tuple[float, float]) -> str:
    """Return a block whose edges are given from the centre of the sole in half sizes of it."""
    centre = forward_steps(STEPS, STEP, WIDTH)[ONTO].centre
    (x0, x1), (y0, y1) = (np.array(part) * half for part, half in zip((x, y), HALF_SIZE))
    return (
        f'<geom class="terrain" type="box" size="{(x1 - x0) / 2} {(y1 - y0) / 2} {HEIGHT / 2}" '
        f'pos="{centre[0] + (x0 + x1) / 2} {centre[1] + (y0 + y1) / 2} {HEIGHT / 2}"/>'
    )


# As in table 3 of the thesis: a large block, a small one at the border of the sole or below its middle, three pebbles.
OBSTACLES = {
    "large block": block((-1.5, 3.5), (-1.5, 1.5)),
    "small block at the border": block((-0.6, 0.4), (-1.0, -0.5)),
    "small block in the middle": block((-0.4, 0.3), (-0.7, 0.7)),
    "three pebbles": block((-0.5, -0.35), (-0.4, 0.4))
    + block((0.2, 0.4), (0.2, 0.6))
    + block((0.2, 0.4), (-0.6, -0.2)),
}
# Table 3 of the thesis: moment at the ankle [N m], area at the contact [%], and what the robot did by each of them.
THESIS = {
    "large block": ("6.5", "85", "steps on it, steps on it"),
    "small block at the border": ("8.6", "16", "new step, new step"),
    "small block in the middle": ("6.0", "33", "steps on it, new step"),
    "three pebbles": ("4.5", "23", "steps on it, new step"),
}


@dataclass(frozen=True)
class Case:
    """One walk."""

    obstacle: str
    kind: str  # one of KINDS
    seed: int
    period: float = PERIOD  # of the control [s]


@dataclass(frozen=True)
class Result:
    """How it ended."""

    stands: bool
    steps: int  # that were made
    retracted: tuple[str, ...]  # the feet that were lifted again
    area: float  # near the ground at the first contact with the obstacle, relative to the sole; NaN without the rule
    moments: list[tuple[float, float]]  # at the ankle, by landing: at the contact, and the largest of its impact [N m]


class Rule:
    """Decides whether the ground below a foot is safe, and where else to step.

    Parameters
    ----------
    robot : Biped
        Its skins; nothing else of it is used.
    """

    def __init__(self, robot: Biped):
        self.retries = 0
        self.areas: dict[str, list[float]] = {foot: [] for foot in FEET}  # near the ground, relative to the sole
        skin = robot.body.skins["right_foot"]
        self.places = skin.positions[:, :2] - SOLE_CENTRE[:2]  # of the taxels from the centre of the sole [m]

    def __call__(self, state: State, foot: str) -> Array | None:
        """Return the shift (2,) of a step that is not safe [m], or None."""
        touched = self._touched(state, foot)
        self.areas[foot].append(touched.area / full_sole().area)
        is_unsafe = touched.kind != "empty" and must_replan(self.areas[foot][-1], MIN_AREA)
        if not is_unsafe or self.retries == MAX_RETRIES:
            self.retries = 0  # for the next step
            return None
        self.retries += 1
        return shift_off(touched, foot)

    def _touched(self, state: State, foot: str) -> Polygon:
        """Return the hull of the cells that are pressed, and of those whose proximity sensor is near the ground."""
        frame = state.frame.links[f"{foot}_foot"]
        pressed = np.zeros(len(self.places), bool) if frame.sets is None else frame.sets.active
        near = np.nan_to_num(frame.modalities["proximity"].values, nan=np.inf) < NEAR
        corners = np.array([(a, b) for a in (-1, 1) for b in (-1, 1)])
        cells = [self.places[pressed][:, None] + PITCH / 2 * corners, self.places[near][:, None] + CELL * corners]
        limit = HALF_SIZE - PITCH / 2
        return convex_hull(np.clip(np.concatenate(cells).reshape(-1, 2), -limit, limit))


def shift_off(obstacle: Polygon, foot: str) -> Array:
    """Return the shortest shift (2,) backward, forward or outward by which a sole leaves an obstacle below it [m]."""
    directions = np.array(((-1.0, 0.0), (1.0, 0.0), (0.0, SIDE[foot])))
    distances = [sidestep(obstacle, SOLE, direction, CLEARANCE) for direction in directions]
    shortest = int(np.argmin(distances))
    return distances[shortest] * directions[shortest]


def run(case: Case, each: Callable[[Biped, Walker], None] | None = None) -> Result:
    """Walk."""
    robot = Biped(FLAT + OBSTACLES[case.obstacle], case.seed, period=case.period)
    feels, avoids = KINDS[case.kind]
    rule = Rule(robot) if avoids else None
    walker = Walker(robot, forward_steps(STEPS, STEP, WIDTH), GAIT, feels=feels, avoid=rule)
    stands = walk(robot, walker, 30.0, each=lambda robot: each(robot, walker) if each else None)
    # The first step of the right foot is on flat ground, the second one on the obstacle.
    area = rule.areas["right"][1] if rule and len(rule.areas["right"]) > 1 else np.nan
    again = tuple(row["foot"] for row in walker.log.retracted)
    return Result(stands, len(walker.log.landings), again, area, moments_of(walker.log))


def moments_of(log: Log) -> list[tuple[float, float]]:
    """Return the moment at the ankle at each landing, and the largest one of its impact [N m]."""
    found = []
    for landing in log.landings:
        since = [
            row["moments"][landing["foot"]] for row in log.rows if 0 <= row["time"] - landing["time"] < IMPACT + 1e-9
        ]
        found.append((since[0], max(since)))
    return found


def spreads(moments: Iterable[tuple[float, float]]) -> list[str]:
    """Return the moments at the contacts, and the largest ones of the impacts, as texts."""
    return [spread(values, 1) for values in zip(*moments)]


def main() -> None:
    """Run all cases; print a table; draw."""
    given = arguments(__doc__).parse_args()
    kinds = [(obstacle, kind) for obstacle in OBSTACLES for kind in KINDS]
    cases = {kind: [Case(*kind, seed) for seed in range(given.seeds)] for kind in kinds}
    results, rows = run_all(run, cases, given), []
    for obstacle in OBSTACLES:
        blind, felt, avoiding = (results[obstacle, kind] for kind in KINDS)
        again, area = count(bool(r.retracted) for r in avoiding), spread([100 * r.area for r in avoiding])
        moments = spreads(r.moments[ONTO] for r in blind)
        rows.append((obstacle, *stands_and_steps(blind, felt, avoiding), again, area, *moments, *THESIS[obstacle]))
    flat = spreads(pair for runs in results.values() for r in runs for pair in r.moments[:ONTO])
    rows.append(("none: the steps before", *[""] * 8, *flat, "", "", ""))
    heads = (
        "obstacle",
        *(head for kind in KINDS for head in (f"{kind}: stands", f"steps of {STEPS}")),
        "new step",
        "area at the contact [%]",
        "moment at the ankle: contact [N m]",
        "largest of the impact [N m]",
        "thesis: moment [N m]",
        "area [%]",
        "robot, by moment and by area",
    )
    report(given, heads, rows)
    shown = list(KINDS)[::2]
    films = [lambda each, kind=kind: run(Case(SHOWN, kind, 0), each) for kind in shown]
    draw_walks(dict(zip(shown, films)), given.out / "replanning.png")
    if not given.no_animation:
        film_both(films, given.out / "replanning.gif", azimuth=100, every=2)


if __name__ == "__main__":
    main()
