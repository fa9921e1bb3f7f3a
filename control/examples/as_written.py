"""The rules of the thesis for landings and footholds, as they are written, against those of the walker (thesis 4.4).

    python control/examples/as_written.py [--seeds 20]

Landings: the felt wrench replaces that of the virtual springs in contact (eq. 4.30), and the swing ends when one of
both pushes by more than a limit (eq. 4.31): the foot stops above the ground. Footholds: right after the contact the ZMP
is planned at the centroid of the cells that are pressed, and it is limited to the hull of the cells that are pressed
now (4.4.2, 4.4.3). The runs are those of ``landing.py`` and ``footholds.py``, all else is the walker's.
"""

from typing import Any

import footholds
import landing
import numpy as np
from experiment import arguments, count, report, run_all, spread
from foothold import Foothold, full_sole
from shapes import PITCH
from walker import Proximity

from skin_calib_addon.runtime import Frame, Skin, convex_hull
from skin_calib_addon.runtime.wrench import about
from skin_control.virtual import lands_early, sole_wrench

CORNERS = np.array([(x, y) for x in (-1, 1) for y in (-1, 1)]) * PITCH / 2  # of a cell, from its centre [m]
# Force of the springs that ends a swing: of a sole 3 mm above flat ground. The thesis has no number. Larger: the foot
# stops nearer to the ground; above 3.6 N never.
STOP = 3.0  # [N]
SPEED = 0.4  # of landings without proximity [m/s]
STEPS = {"flat": 3, "obstacle": landing.OBSTACLE_STEPS}  # of landings
WALK = "flat ground"  # where the rule for footholds is tried
EXPERIMENTS = {"flat": "landing on flat ground", "obstacle": "landing on the obstacle", WALK: "walk on flat ground"}
RULES = ("thesis", "here")
Array = np.ndarray


class WrittenProximity(Proximity):
    """Springs until the contact, then what is felt; each of them can end the swing."""

    def wrench(self, skin: Skin, frame: Frame, centre: Array) -> Array:
        """Return the wrench (6,) of the sole about its centre (3,) (thesis eq. 4.30)."""
        return sole_wrench(
            frame.touched, about(np.nan_to_num(frame.wrench), centre), super().wrench(skin, frame, centre)
        )

    def stops(self, wrench: Array) -> bool:
        """Return whether the wrench (6,) pushes so hard that the foot stops (thesis eq. 4.31)."""
        return lands_early(wrench, STOP)


class WrittenFoothold(Foothold):
    """The pressed area is the supporting area: nothing is learnt from silent cells."""

    def lift(self) -> None:
        """Plan the next step for the full sole."""
        super().lift()
        self.area, self.landed = full_sole(), None
        self.inside[:] = True  # the plan does not wait for evidence

    @property
    def centroid(self) -> Array:
        """That of the first polygon after the contact (2,), from the centre of the sole [m]."""
        return self.area.centroid if self.landed is None else self.landed

    def update(self, frame: Frame, slope: Array) -> bool:
        """Take the hull of the active cells (thesis eq. 4.24); return whether it is the first one."""
        if frame.sets is None or not frame.sets.active.any():
            return False
        cells = self.places[frame.sets.active]
        self.area = convex_hull((cells[:, None] + CORNERS).reshape(-1, 2))
        if self.landed is not None:
            return False
        self.landed = self.area.centroid
        return True


def cases_of(name: str, rule: str, seeds: range) -> list[Any]:
    """Return the cases of a row of the table."""
    if name != WALK:
        compliance = WrittenProximity() if rule == "thesis" else Proximity()
        return [landing.Case(name, True, STEPS[name], SPEED, seed, compliance=compliance) for seed in seeds]
    kind = WrittenFoothold if rule == "thesis" else Foothold
    return [footholds.Case(name, True, seed, foothold=kind) for seed in seeds]


def run(case: Any) -> Any:
    """Return the result of a case of one of the two scripts."""
    return (landing if isinstance(case, landing.Case) else footholds).run(case)


def texts(name: str, results: list[Any]) -> tuple[str, ...]:
    """Return the numbers of a row: robots that stand, steps, impacts, times of touch-down."""
    if name == WALK:
        return count(r.stands for r in results), spread((r.steps for r in results), 1), "", ""
    met = [i for _, impacts in results for i in impacts if name == "flat" or i.is_on_obstacle]
    steps = spread((len(impacts) for _, impacts in results), 1)
    return count(stands for stands, _ in results), steps, spread(i.force for i in met), spread((i.time for i in met), 2)


def main() -> None:
    """Run all cases; print a table."""
    given = arguments(__doc__, has_animation=False).parse_args()
    kinds = [(name, rule) for name in EXPERIMENTS for rule in RULES]
    results = run_all(run, {kind: cases_of(*kind, range(given.seeds)) for kind in kinds}, given)
    rows = [(EXPERIMENTS[name], rule, *texts(name, runs)) for (name, rule), runs in results.items()]
    report(given, ("experiment", "rule", "stands", "steps", "impact [N]", "touch-down [s]"), rows)


if __name__ == "__main__":
    main()
