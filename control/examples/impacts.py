"""What decides how hard a foot lands (thesis 4.4.1).

    python control/examples/impacts.py [--seeds 20]

The landings are those of ``landing.py``: on flat ground, on a floor that is a box as the obstacle, and on the obstacle,
onto which the foot is lifted by 10 or by 5 cm. Just before the contact the angle of the knee and the effective mass of
the sole are noted: the vertical force that accelerates the sole by 1 m/s^2 if it does not turn or slide. The inertia of
the motors (armature) belongs to it, and so does the damping of the servos, which acts as inertia within a time step of
the simulation. Impacts are also those that force/torque sensors in the ankles record in each cycle.
"""

from dataclasses import dataclass

import numpy as np
from biped import TIME_STEP, Biped, mujoco
from estimator import SOLE_CENTRE
from experiment import arguments, report, run_all, spread
from landing import LIFTS, OBSTACLE_STEPS, Case, Impact, Judge
from landing import run as land

SPEED = 0.4  # of landing without proximity [m/s]
PLACES = {  # ground, height of the lift [m], and whether the landings are those on the obstacle
    "flat ground": ("flat", LIFTS["flat"], False),
    "floor of a box": ("box", LIFTS["flat"], False),
    "floor next to the obstacle": ("obstacle", LIFTS["obstacle"], False),
    "on the obstacle": ("obstacle", LIFTS["obstacle"], True),
    "on the obstacle, lifted by 5 cm": ("obstacle", 0.05, True),
}
Array = np.ndarray


@dataclass(frozen=True)
class Landing:
    """One landing."""

    impact: Impact
    knee: float  # angle before the contact [rad]
    mass: float  # effective, of the sole [kg]
    links: float  # the same without motors and servos [kg]
    ankle: float  # largest force that the sensor in the ankle records [N]


class Closer(Judge):
    """Also looks at the leg before the contact, and at the sensor in the ankle after it."""

    def __init__(self, *args):
        super().__init__(*args)
        self.landings: list[Landing] = []
        self.ankle = 0.0

    def __call__(self, robot: Biped) -> None:
        """Look at the last cycle."""
        super().__call__(robot)
        if self.foot and self.landed is None:
            knee = robot.data.joint(f"{self.foot}_knee").qpos[0]
            self.leg, self.ankle = (float(knee), *effective_masses(robot, self.foot)), 0.0
        elif self.foot:
            self.ankle = max(self.ankle, -float(robot.data.sensor(f"{self.foot}_force").data[2]))
        elif len(self.impacts) > len(self.landings):
            self.landings.append(Landing(self.impacts[-1], *self.leg, self.ankle))


def effective_masses(robot: Biped, foot: str) -> tuple[float, float]:
    """Return the effective mass of a sole along the vertical, with and without motors and servos [kg]."""
    model, data, body = robot.model, robot.data, robot.data.body(f"{foot}_foot")
    inertia, jacobian = np.zeros((model.nv, model.nv)), np.zeros((6, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    point = body.xpos + body.xmat.reshape(3, 3) @ SOLE_CENTRE
    mujoco.mj_jac(model, data, jacobian[:3], jacobian[3:], point, body.id)
    servos = np.zeros(model.nv)
    servos[6:] = -TIME_STEP * model.actuator_biasprm[:, 2]
    matrices = (inertia + np.diag(servos), inertia - np.diag(model.dof_armature))
    both = (np.linalg.inv(jacobian @ np.linalg.solve(matrix, jacobian.T))[2, 2] for matrix in matrices)
    return tuple(map(float, both))


def run(case: Case) -> list[Landing]:
    """Return the landings of a case."""
    judges: list[Closer] = []

    def judge(*args) -> Closer:
        judges.append(Closer(*args))
        return judges[-1]

    land(case, judging=judge)
    return judges[0].landings


def ratio(soft: list[float], hard: list[float]) -> str:
    """Return the ratios of the means and of the largest values, as text."""
    if not (soft and hard):
        return ""
    return f"{np.mean(soft) / np.mean(hard):.0%}, {max(soft) / max(hard):.0%}".replace("%", " %")


def main() -> None:
    """Run all cases; print a table."""
    given = arguments(__doc__, has_animation=False).parse_args()
    kinds = [
        (*scene, near) for scene in dict.fromkeys(place[:2] for place in PLACES.values()) for near in (False, True)
    ]
    cases = {
        (ground, lift, near): [
            Case(ground, near, OBSTACLE_STEPS if ground == "obstacle" else 3, SPEED, seed, lift=lift)
            for seed in range(given.seeds)
        ]
        for ground, lift, near in kinds
    }
    parts = run_all(run, cases, given)
    results = {
        (place, near): [
            one
            for landings in parts[ground, lift, near]
            for one in landings
            if ground != "obstacle" or one.impact.is_on_obstacle == is_on
        ]
        for place, (ground, lift, is_on) in PLACES.items()
        for near in (False, True)
    }
    rows = []
    for place in PLACES:
        hard, soft = (results[place, near] for near in (False, True))
        rows.append(
            (
                place,
                str(len(hard)),
                spread((one.knee for one in hard), 2),
                spread((one.mass for one in hard), 1),
                spread((one.links for one in hard), 1),
                spread((one.impact.speed for one in hard), 2),
                spread(one.impact.force for one in hard),
                spread(one.impact.force / (one.mass * one.impact.speed) for one in hard),
                ratio([one.impact.force for one in soft], [one.impact.force for one in hard]),
                ratio([one.ankle for one in soft], [one.ankle for one in hard]),
            )
        )
    heads = (
        "place, without proximity",
        "landings",
        "knee [rad]",
        "effective mass [kg]",
        "of the links alone [kg]",
        "speed [m/s]",
        "impact [N]",
        "impact by mass and speed [1/s]",
        "with proximity: ratio of the means, of the largest",
        "the same by ankle sensors",
    )
    report(given, heads, rows)


if __name__ == "__main__":
    main()
