"""The arm of the biped yields, shrinks back and keeps its hand in place by what its forearm feels (thesis 3.2 to 3.4).

    python control/examples/arm.py [--seeds 20]

The pelvis is held. The arm has position servos; torques of tasks move them through a resolver, as in the thesis's
figure 10. Five experiments: two contacts at once; a small and a large probe with the same force, and their pain; an
obstacle that comes near without contact; and something hot. The controller knows the joints and the forearm's
readings of force, proximity and temperature.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from biped import FULL_SCALE, NOISE, REST, TERRAIN_GROUP, TIME_STEP, build, force_counts, mujoco, nominal, skins
from experiment import FRAME_TIME, Camera, arguments, count, report, run_all, side_by_side, spread
from PIL import Image
from shapes import ELBOW_RADIUS, FOREARM_LENGTH, RANGE, RANGE_COUNTS, WRIST_RADIUS

from skin_calib_addon.calibration import LinkCalibration
from skin_calib_addon.runtime import Skin
from skin_calib_addon.runtime.poses import pose_from_mujoco
from skin_control.reflexes import Switch
from skin_control.tasks import TorqueResolver, attraction, contact_torques, prioritized
from skin_control.virtual import pressure_driven, proximity_wrench, temperature_wrench

PERIOD = 4e-3  # of the control [s]
# The legs are in the air, and the pelvis is welded to the world.
HELD = '</worldbody><equality><weld body1="pelvis"/></equality><worldbody>'
JOINTS = 7  # of the arm, the last ones of the robot
PROBE_MASS, PROBE_DAMPING, PROBE_STIFFNESS = 0.3, 30.0, 2000.0  # of a hand that presses [kg, N s/m, N/m]
STROKES = {"contacts": 0.06, "links": 0.06, "near": 0.03, "heat": -0.05}  # beyond the forearm's place at the start [m]
PROBE_SPEED = 0.06  # where no force is wanted [m/s]
MIN_FORCE = 0.3  # below which the mean is nothing [N]
FELT_TIME = 0.02  # of the mean of the felt wrench [s]
START = np.array((0.3, 0.4, 0.0, -1.5, 0.0, 0.0, 0.0))  # [rad]
RESOLVER_DAMPING = 8.0  # D [N m s/rad]. Larger: the arm yields more slowly
HAND_STIFFNESS, HAND_DAMPING, HAND_SPEED = 400.0, 40.0, 0.5  # [N/m, N s/m, m/s]
POSTURE = {  # stiffness [N m/rad]
    "contacts": 4.0, "links": 4.0, "pressure": 40.0, "pain": 4.0, "near": 4.0, "heat": 4.0
}  # fmt: skip
AREA = 2.5e-4  # xi: at this area of contact, 2.5 cells, the pressure-driven wrench is the felt one [m^2]
PAIN = 10.0, 5.0, 0.5  # of the pressure-driven force: on and off [N, N], time below [s]. The thesis has 10 N
REPULSION = 1e6  # per area of skin with a sensor [N/m^3]: one taxel of nine has one
HOT, HEAT_LIMIT, HEAT_GAIN, AIR = 180.0, 31.0, 400.0, 22.0  # burner, limit [degC], gain [N/(K m^2)], air [degC]
HEAT_TIME, HEAT_STEP, HEAT_NOISE = 0.3, 0.25, 0.1  # of the temperature sensors: delay [s], resolution, noise [K]
# Colours of a pad at the temperature of the air and at that of the last value, in the animation [rgba, rgba, degC].
COLD_PAD, HOT_PAD, SHOWN_HOT = np.array((0.1, 0.6, 0.3, 1.0)), np.array((1.0, 0.1, 0.05, 1.0)), 60.0
SMALL, BALL, PRESSED = 0.006, 0.05, 0.13  # radius of a ball of the probes, of the obstacle, place of the probes [m]
PROBES = {"contacts": 2, "links": 2, "near": 1, "heat": 1}  # where they are not those of a small or a large one
RADIUS = {"contacts": 0.02, "links": 0.02, "near": BALL, "heat": BALL}  # of other probes [m]
# Places of the balls of a large probe along and around the arm, in distances between adjacent ones.
SEVEN = np.array(((-0.5, -1), (0.5, -1), (-1, 0), (0, 0), (1, 0), (-0.5, 1), (0.5, 1)))
TITLES = {
    "contacts": "two contacts, each moves 6 cm inward",
    "pressure": "8 N by a small and a large probe",
    "pain": "a hand task, and force that rises by 5 N/s",
    "near": "an obstacle comes 3 cm into the arm's place",
    "heat": "a burner of 180 °C comes near",
}
VARIANTS = {
    "contacts": ("stiff", "yields"),
    "pressure": ("small, force", "large, force", "small, pressure", "large, pressure"),
    "pain": ("small", "large"),
    "near": ("hand only", "null space", "first"),
    "heat": ("hand only", "null space", "first"),
}
THESIS = {  # what it states of its figures, which are diagrams
    ("contacts", "yields"): "multiple simultaneous contacts",
    ("pressure", "small, pressure"): "fast",
    ("pressure", "large, pressure"): '"almost no motion"',
    ("pain", "small"): '"small" force',
    ("pain", "large"): '"considerably larger" force',
    ("near", "first"): "repelled without contact (figure 17)",
    ("heat", "first"): "the hand task is blocked (figures 19 and 20)",
}
TIMES = {"contacts": 2.5, "links": 2.5, "pressure": 1.0, "pain": 10.0, "near": 3.5, "heat": 4.0}  # [s]
Array = np.ndarray


@dataclass(frozen=True)
class Case:
    """One run."""

    kind: str
    variant: str
    seed: int
    period: float = PERIOD  # of the control [s]


def probe_geoms(case: Case) -> str:
    """Return bodies that the experiment moves."""
    balls = balls_of(case)
    return "".join(
        f'<body name="probe{k}" gravcomp="1"><joint name="probe{k}" type="slide" axis="0 0 1" limited="false" '
        f'damping="{PROBE_DAMPING / balls}"/><geom class="terrain" type="sphere" size="{RADIUS.get(case.kind, SMALL)}" '
        f'mass="{PROBE_MASS / balls}" rgba=".85 .4 .2 1"/></body>'
        for k in range(PROBES.get(case.kind, balls))
    )


def balls_of(case: Case) -> int:
    """Return the number of balls of one probe."""
    return len(SEVEN) if case.variant.startswith("large") else 1


def cushion() -> Array:
    """Return the places (7, 3) of seven balls of a soft probe on the forearm, the middle one at the origin; z inward.

    Each slides on its own and carries the same part of the force.
    """
    radius = radius_at(PRESSED) + SMALL
    taper = (WRIST_RADIUS - ELBOW_RADIUS) / FOREARM_LENGTH
    x, y = 0.012 * SEVEN.T
    around = y / radius
    at = radius + taper * x
    return np.column_stack((x, at * np.sin(around), radius - at * np.cos(around)))


def radius_at(distance: float) -> float:
    """Return the radius of the forearm at a distance from the elbow [m]."""
    return ELBOW_RADIUS + (WRIST_RADIUS - ELBOW_RADIUS) * (distance - 0.02) / FOREARM_LENGTH


@dataclass(frozen=True)
class Robot:
    """A robot whose last seven joints are those of an arm with skin, and with a site ``hand``."""

    model: mujoco.MjModel  # simulated, with probes and skin
    nominal: mujoco.MjModel  # what a controller knows
    calibrations: tuple[LinkCalibration, ...]  # the first one is that of the link that most experiments touch
    start: Array  # (7,) [rad]
    prefix: str = ""  # of all names in the simulated model
    area: float = AREA  # xi of the pressure-driven wrench [m^2]

    @property
    def link(self) -> str:
        """The link that most experiments touch."""
        return self.calibrations[0].link


class Arm:
    """The simulated arm; :meth:`senses` is what a controller gets.

    Parameters
    ----------
    case : Case
        Its seed is that of the noise and of the places of the probes.
    """

    azimuth = -115.0  # of an animation [degree]

    def __init__(self, case: Case):
        self.case, self.rng, self.robot = case, np.random.default_rng(case.seed), self.load(case)
        self.model, link, model = self.robot.model, self.robot.prefix + self.robot.link, self.robot.model
        self.data = mujoco.MjData(model)
        self.skins = {calibration.link: Skin(calibration) for calibration in self.robot.calibrations}
        self.skin = self.skins[self.robot.link]
        self._touch = {
            name: np.array([model.sensor(f"{self.robot.prefix}{name}/{id}").adr[0] for id in skin.ids])
            for name, skin in self.skins.items()
        }
        self._sites = np.array([model.site(f"{link}/{id}").id for id in self.skin.ids])
        channels = next(m.channels for m in self.robot.calibrations[0].modalities if m.name == "proximity")
        self._near = [(channel, model.site(f"{link}/{id}").id) for id, channel in channels.items()]
        for skin in self.skins.values():
            skin.tare(np.stack([self._counts(np.zeros(skin.reading_length)) for _ in range(REST)]), accept=True)
        self.probes = [k for k in range(model.nbody) if model.body(k).name.startswith("probe")]
        self._is_hot, self._heat = case.kind == "heat", np.full(len(self.skin.ids), AIR)
        self.targets = np.zeros(model.nu)
        self.targets[-JOINTS:] = self.data.qpos[-JOINTS:] = self.robot.start
        self.data.ctrl[:] = self.targets
        mujoco.mj_forward(model, self.data)

    def load(self, case: Case) -> Robot:
        """Return the robot with the probes of a case."""
        model = build(probe_geoms(case) + HELD, covered=("forearm",))
        return Robot(model, nominal(), (skins()["forearm"],), START)

    def step(self, targets: Array, torques: Array) -> None:
        """Simulate one control cycle with angles and torques of the servos, (7,) each."""
        self.targets[-JOINTS:] = targets
        self.data.ctrl[:] = self.targets
        self.data.ctrl[-JOINTS:] += torques / self.model.actuator_gainprm[-JOINTS:, 0]
        substeps = round(self.case.period / TIME_STEP)
        for k in range(substeps):  # the sensors, most of the work, are computed when they are read
            self.model.opt.disableflags = 0 if k == substeps - 1 else mujoco.mjtDisableBit.mjDSBL_SENSOR
            mujoco.mj_step(self.model, self.data)

    def senses(self) -> tuple[float, Array, dict[str, dict[str, Array]], Array]:
        """Return time, angles of the arm, readings of its skins, temperatures of the taxels [degC].

        The skin of the first link alone has distances and temperatures.
        """
        readings = {}
        for link, skin in self.skins.items():
            force = np.zeros(skin.reading_length)
            force[skin.channels] = self.data.sensordata[self._touch[link]]
            readings[link] = {"force": self._counts(force)}
        readings[self.robot.link]["proximity"] = self._proximity()
        return self.data.time, self.data.qpos[-JOINTS:].copy(), readings, self._temperatures()

    def _counts(self, force: Array) -> Array:
        return force_counts(force, FULL_SCALE, self.rng.normal(0, NOISE, force.shape))

    def _proximity(self) -> Array:
        group, found = np.zeros(6, np.uint8), np.zeros(1, np.int32)
        group[TERRAIN_GROUP] = 1
        readings = np.zeros(max(channel for channel, _ in self._near) + 1)
        for channel, site in self._near:
            outward = self.data.site_xmat[site].reshape(3, 3)[:, 2]
            distance = mujoco.mj_ray(self.model, self.data, self.data.site_xpos[site], outward, group, 1, -1, found)
            if 0 <= distance <= RANGE:
                count = RANGE_COUNTS * (1 - distance / RANGE) + self.rng.normal(0, NOISE)
                readings[channel] = np.clip(np.rint(count), 0, RANGE_COUNTS)
        return readings

    def _temperatures(self) -> Array:
        """Radiation of the burner on the taxels that face it, delayed."""
        target = np.full(len(self._heat), AIR)
        if self._is_hot:
            arm = self.probe(0) - self.data.site_xpos[self._sites]
            distance = np.linalg.norm(arm, axis=1)
            facing = (self.data.site_xmat[self._sites].reshape(-1, 3, 3)[:, :, 2] * arm).sum(axis=1) / distance
            target += (HOT - AIR) * np.clip(facing, 0, 1) * np.minimum(BALL / distance, 1) ** 2
        self._heat += self.case.period / HEAT_TIME * (target - self._heat)
        noisy = self._heat + self.rng.normal(0, HEAT_NOISE, len(target))
        return np.rint(noisy / HEAT_STEP) * HEAT_STEP

    # The truth, and the experimenter's hands, which are not for a controller.

    @property
    def heat(self) -> Array:
        """True temperatures (n,) of the taxels [degC]."""
        return self._heat

    @property
    def hottest(self) -> float:
        """Largest true temperature of a taxel [degC]."""
        return float(self._heat.max())

    @property
    def pads(self) -> Array:
        """Geoms (n,) of the pads below the taxels, in their order."""
        body = self.model.body(f"{self.robot.prefix}{self.robot.link}/{self.robot.link}")
        return body.geomadr[0] + np.arange(body.geomnum[0])

    @property
    def centre(self) -> Array:
        """Where an animation looks (3,) [m]."""
        return self.data.body("wrist").xpos

    @property
    def hand(self) -> Array:
        """Position (3,) of the hand [m]."""
        return self.data.site(f"{self.robot.prefix}hand").xpos

    def probe(self, k: int) -> Array:
        """Return the position (3,) of a probe [m]."""
        return self.data.xpos[self.probes[k]]

    def force_on(self, k: int) -> float:
        """Return the true normal force on a probe [N]."""
        contacts = self.data.contact
        rows = contacts.efc_address[(self.model.geom_bodyid[contacts.geom] == self.probes[k]).any(axis=1)]
        return float(self.data.efc_force[rows[rows >= 0]].sum())

    def places(self, turn: Array, jitter: Array) -> list[tuple[Array, Array]]:
        """Return for each probe of the case the point (3,) to which it comes, and an outward vector (3,) there.

        The vector is perpendicular to :attr:`axis`.

        Parameters
        ----------
        turn, jitter : array, shape (2,)
            By which the directions and the points are moved along the arm, which the seed decides [1, m].
        """
        up, side = np.array((0.0, 0, 1)), np.array((0.0, 1, 0))
        below, lateral = (0.12, -up + turn[0] * side), (PRESSED, side + turn[0] * up)
        places = {
            "contacts": [(0.17, up + turn[0] * side), (0.08, side + turn[1] * up)], "near": [below], "heat": [below]
        }.get(self.case.kind, [lateral])  # fmt: skip
        return [self.surface(distance + by, direction) for (distance, direction), by in zip(places, jitter)]

    @property
    def cushion(self) -> Array:
        """Places (7, 3) of the balls of a large probe; z inward [m]."""
        return cushion()

    @property
    def axis(self) -> Array:
        """The direction (3,) from the elbow to the hand."""
        return -self.data.body("forearm").xmat.reshape(3, 3)[:, 2]

    def surface(self, distance: float, direction: Array) -> tuple[Array, Array]:
        """Return a point of the forearm at a distance from the elbow in a direction, and the outward normal there."""
        body, axis = self.data.body("forearm"), self.axis
        outward = direction - (direction @ axis) * axis
        outward /= np.linalg.norm(outward)
        return body.xpos + distance * axis + radius_at(distance) * outward, outward

    def gap(self) -> float:
        """Return the distance between the obstacle and the forearm [m], negative if they overlap."""
        axis, away = self.axis, self.probe(0) - self.data.body("forearm").xpos
        along = np.clip(away @ axis, 0.02, 0.02 + FOREARM_LENGTH)
        return float(np.linalg.norm(away - along * axis) - radius_at(along) - BALL)


class Controller:
    """Angles of the servos from what is felt.

    Parameters
    ----------
    case : Case
        Its kind and variant say which tasks there are.
    skins : dict of Skin
        By link.
    robot : Robot
        Its nominal model, the name of the first link, the start, and the area; nothing else of it is used.
    """

    def __init__(self, case: Case, skins: dict[str, Skin], robot: Robot):
        self.case, self.skins, self.xi = case, skins, robot.area
        self.model, self.link, self.start = robot.nominal, robot.link, robot.start
        self.data = mujoco.MjData(self.model)
        self.resolver = TorqueResolver(self.start, RESOLVER_DAMPING, self.model.jnt_range[-JOINTS:])
        self.pain = Switch(*PAIN)
        self.goal: Array | None = None  # of the hand
        self.since = np.inf  # when the pain began [s]
        self.virtual, self.area, self.torques = 0.0, 0.0, np.zeros(JOINTS)
        self.felt = {link: np.zeros(6) for link in skins}  # mean wrench of each link

    def __call__(
        self, time: float, q: Array, readings: dict[str, dict[str, Array]], heat: Array
    ) -> tuple[Array, Array]:
        """Return angles and torques of the servos, (7,) each [rad, N m]."""
        model, data, resolver = self.model, self.data, self.resolver
        data.qpos[-JOINTS:], data.qvel[:] = q, 0  # of the pelvis as at the start
        mujoco.mj_forward(model, data)
        gravity, mass = data.qfrc_bias[-JOINTS:].copy(), np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        mass = mass[-JOINTS:, -JOINTS:]
        poses = {link: pose_from_mujoco(data.body(link).xpos, data.body(link).xmat) for link in self.skins}
        frames = {link: skin.update(readings[link], time) for link, skin in self.skins.items()}
        frame, geometry = frames[self.link], self.skins[self.link].geometry
        kind, variant = self.case.kind, self.case.variant

        def task(wrenches: dict[str, Any]) -> tuple[Array, Array]:
            rows = contact_torques(wrenches, poses, self._jacobian, JOINTS)
            return rows.sum(axis=0), rows

        for link, felt in frames.items():
            wrench = np.nan_to_num(felt.wrench)  # an unknown one is none
            if kind == "pain" or variant.endswith("pressure"):
                wrench = pressure_driven(wrench, felt.area, self.xi)
            self.felt[link] = self.felt[link] + self.case.period / FELT_TIME * (wrench - self.felt[link])
        contacts = {link: wrench for link, wrench in self.felt.items() if np.linalg.norm(wrench[:3]) > MIN_FORCE}
        self.virtual = float(np.linalg.norm(contacts.get(self.link, np.zeros(6))[:3]))
        self.area = frame.area
        posture = POSTURE[kind] * (self.start - resolver.angles), np.eye(JOINTS)
        hand = self._hand()
        if kind in ("contacts", "links"):
            if variant == "one link":
                contacts = {link: wrench for link, wrench in contacts.items() if link == self.link}
            tasks = [posture] if variant == "stiff" else [task(contacts), posture]
        elif kind == "pressure":
            tasks = [task(contacts), posture]
        elif kind == "pain":
            hurts = self.pain.update(self.virtual, time)
            self.since = min(self.since, time) if hurts else np.inf
            tasks = [task(contacts), posture] if hurts else [hand, task(contacts), posture]
        else:
            if kind == "near":
                virtual = proximity_wrench(geometry, frame.modalities["proximity"], RANGE, REPULSION)
            else:
                virtual = temperature_wrench(geometry, heat, HEAT_LIMIT, HEAT_GAIN)
            self.virtual, flee = float(np.linalg.norm(virtual[:3])), task({self.link: virtual})
            orders = {"hand only": [hand], "null space": [hand, flee], "first": [flee, hand]}
            tasks = [*orders[variant], posture]
        self.torques = prioritized(tasks, mass)
        return resolver.step(self.torques, mass, self.case.period), gravity

    def _jacobian(self, link: str) -> Array:
        jacobian = np.zeros((6, self.model.nv))
        body = self.model.body(link).id
        mujoco.mj_jac(self.model, self.data, jacobian[:3], jacobian[3:], self.data.xpos[body], body)
        return jacobian[:, -JOINTS:]

    def _hand(self) -> tuple[Array, Array]:
        """Return torque and Jacobian that keep the hand where it is at the start (thesis eq. 3.39)."""
        jacobian, position = np.zeros((3, self.model.nv)), self.data.site("hand").xpos
        mujoco.mj_jacSite(self.model, self.data, jacobian, None, self.model.site("hand").id)
        own = jacobian[:, -JOINTS:]
        self.goal = position.copy() if self.goal is None else self.goal
        velocity = own @ self.resolver.velocities
        return own.T @ attraction(position, velocity, self.goal, HAND_STIFFNESS, HAND_DAMPING, HAND_SPEED), own


class Experimenter:
    """Moves the probes.

    Parameters
    ----------
    case : Case
    arm : Arm
    """

    def __init__(self, case: Case, arm: Arm):
        self.case, self.arm = case, arm
        rng = np.random.default_rng(1000 + case.seed)
        jitter = rng.uniform(-0.01, 0.01, 2)
        turn = rng.uniform(-0.2, 0.2, 2)
        size = RADIUS.get(case.kind, SMALL)
        places = arm.places(turn, jitter)
        self.clear = {"near": 0.12, "heat": 0.2}.get(case.kind, 0.003)  # from the forearm at the start [m]
        offsets = arm.cushion if case.variant.startswith("large") else np.zeros((1, 3))
        self.parts = len(offsets)  # of one probe
        for k in range(len(arm.probes)):
            point, outward = places[k // self.parts]
            axis = arm.axis  # of the large probe
            frame = np.column_stack((axis, np.cross(-outward, axis), -outward))  # it slides along its z, inward
            start = point + (size + self.clear) * outward + frame @ offsets[k % self.parts]
            arm.model.body_pos[arm.probes[k]] = start
            mujoco.mju_mat2Quat(arm.model.body_quat[arm.probes[k]], frame.ravel())
        mujoco.mj_forward(arm.model, arm.data)

    def __call__(self, time: float) -> None:
        """Set their forces for one cycle."""
        for k in range(len(self.arm.probes)):
            moved = self.moved(k)
            if self.case.kind in ("pressure", "pain"):
                force = (8.0 if self.case.kind == "pressure" else 5.0 * time) / self.parts
            else:
                stroke = self.clear + STROKES[self.case.kind]
                force = PROBE_STIFFNESS * (min(PROBE_SPEED * time, stroke) - moved)
            self.arm.data.qfrc_applied[k] = force

    def moved(self, k: int) -> float:
        """Return how far a probe moved inward [m]."""
        return float(self.arm.data.qpos[k])


@dataclass(frozen=True)
class Result:
    """One run: rows of COLUMNS [s, N, N, N, m^2, m, m, degC, m, 1, N m], one for each cycle."""

    log: Array

    def __getitem__(self, name: str) -> Array:
        return self.log[:, COLUMNS.index(name)]

    @property
    def speed(self) -> float:
        """Mean speed of the probe while it presses, 0.15 to 0.45 s after the start [m/s]."""
        first, last = (int(t / self.period) for t in (0.15, 0.45))
        return float(self["moved"][last] - self["moved"][first]) / (0.45 - 0.15)

    @property
    def period(self) -> float:
        """Between the rows [s]."""
        return float(self["time"][0])

    @property
    def pressed_area(self) -> float:
        """Median area of the contact in the time in which the probe presses [m^2]."""
        return float(np.median(self["area"][round(0.12 / self.period) : round(0.44 / self.period)]))

    @property
    def pain_force(self) -> float:
        """Mean force of the probe in the 0.1 s before the pain [N]; NaN without pain."""
        if not self["pain"].any():
            return np.nan
        k = int(self["pain"].argmax())
        return float(self["force"][k - round(0.1 / self.period) : k].mean())


COLUMNS = ("time", "force", "second", "virtual", "area", "hand", "gap", "heat", "moved", "pain", "norm")


def run(
    case: Case,
    each: Callable[[Arm], None] | None = None,
    duration: float | None = None,
    kind: Callable[[Case], Arm] = Arm,
) -> Result:
    """Return what happens in a case."""
    arm = kind(case)
    controller, hands, log = Controller(case, arm.skins, arm.robot), Experimenter(case, arm), []
    rest = arm.hand.copy()
    touched, middle = None, hands.parts // 2  # of a large probe, whose outer balls can pass by the arm
    while arm.data.time < (duration or TIMES[case.kind]):
        hands(arm.data.time)
        arm.step(*controller(*arm.senses()))
        forces = [arm.force_on(k) for k in range(len(arm.probes))]
        if hands.parts > 1:
            forces = [sum(forces)]
        if touched is None and forces[0] > 0.5:
            touched = hands.moved(middle)
        log.append((arm.data.time, forces[0], forces[-1], controller.virtual, controller.area,
                    np.linalg.norm(arm.hand - rest), arm.gap(), arm.hottest,
                    0.0 if touched is None else hands.moved(middle) - touched, controller.pain.is_on,
                    np.linalg.norm(controller.torques)))  # fmt: skip
        if each:
            each(arm)
        if controller.pain.is_on and arm.data.time - controller.since > 1:
            break
    return Result(np.array(log))


class View(Camera):
    """From the side of the arm and a little below it; the colour of each pad is the temperature of its taxel."""

    def __init__(self, arm: Arm):
        super().__init__(arm, azimuth=arm.azimuth, distance=0.75)
        self.view.lookat[:], self.view.elevation = arm.centre, 25

    def __call__(self, robot: Arm) -> None:
        """Take a frame if it is time for one."""
        if robot.data.time >= self.next:
            self.next += FRAME_TIME
            part = np.clip((robot.heat - AIR) / (SHOWN_HOT - AIR), 0, 1)[:, None]
            robot.model.geom_rgba[robot.pads] = (1 - part) * COLD_PAD + part * HOT_PAD
            self.renderer.update_scene(robot.data, self.view, self.options)
            self.frames.append(Image.fromarray(self.renderer.render()))


def draw(results: dict[tuple[str, str], list[Result]], path, titles: Mapping[str, str]) -> None:
    """Draw the runs with seed 0 of the experiments that were made, as figures 15, 20 and 23 of the thesis."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    panels = (
        ("contacts", "force", "force of a probe [N]", None), ("links", "second", "force on the upper arm [N]", None),
        ("pressure", "moved", "motion of the probe [m]", None),
        ("pain", "virtual", "pressure-driven force [N]", PAIN[0]), ("near", "gap", "distance [m]", None),
        ("near", "hand", "error of the hand [m]", None), ("heat", "heat", "hottest taxel [°C]", HEAT_LIMIT),
    )  # fmt: skip
    variants: dict[str, list[str]] = {}
    for kind, variant in results:
        variants.setdefault(kind, []).append(variant)
    panels = [panel for panel in panels if panel[0] in variants]
    rows = (len(panels) + 1) // 2
    figure, axes = plt.subplots(rows, 2, figsize=(9, 3 * rows), squeeze=False, layout="constrained")
    for ax, (kind, column, label, limit) in zip(axes.ravel(), panels):
        for variant, colour in zip(variants[kind], ("#c44e52", "#4c72b0", "#dd8452", "#55a868")):
            result = results[kind, variant][0]
            ax.plot(result["time"], result[column], label=variant, color=colour, lw=1.1)
        if limit is not None:
            ax.axhline(limit, color="grey", lw=0.8, ls="--")
        ax.set_title(titles[kind], fontsize=9)
        ax.set_ylabel(label, fontsize=8)
        ax.set_xlabel("time [s]", fontsize=8)
        ax.legend(fontsize=7)
        ax.set_ylim(bottom=20 if kind == "heat" else None)
    for ax in axes.ravel()[len(panels) :]:
        ax.remove()
    figure.savefig(path, dpi=110)


def film(runs: Sequence[Callable[[Callable[[Arm], None]], Any]], path: Path) -> None:
    """Write an animation of two runs, each of which calls its argument with the arm in each cycle."""
    views: list[View] = []
    for number, run in enumerate(runs):

        def look(arm: Arm, number: int = number) -> None:
            if len(views) == number:
                views.append(View(arm))
            views[number](arm)

        run(look)
    side_by_side(*views, path, colours=256)  # few pads are hot


def numbers(kind: str, runs: list[Result]) -> str:
    """Return the numbers of one experiment, mean and range over the seeds."""

    def largest(name: str, digits: int = 0, scale: float = 1.0) -> str:
        return spread((scale * r[name].max() for r in runs), digits)

    hand = f"hand moved {largest('hand', 0, 1e3)} mm"
    if kind in ("contacts", "links"):
        is_one = all((r["force"] == r["second"]).all() for r in runs)
        return f"peak {largest('force')} N" if is_one else f"peaks {largest('force')} N and {largest('second')} N"
    if kind == "pressure":
        areas = (1e4 * r.pressed_area for r in runs)
        return f"speed {spread((1e3 * r.speed for r in runs), 0)} mm/s, area {spread(areas, 1)} cm^2"
    if kind == "pain":
        force = spread((r.pain_force for r in runs), 1)
        return f"pain in {count(r['pain'].any() for r in runs)} runs, at {force} N; until then the {hand_before(runs)}"
    if kind == "near":
        gap = spread((1e3 * r["gap"].min() for r in runs), 0)
        contacts = count(r["force"].max() > 0 for r in runs)
        return f"contact in {contacts} runs, up to {largest('force')} N; smallest distance {gap} mm, {hand}"
    end = spread((r["heat"][-1] for r in runs), 1)
    return f"hottest {largest('heat', 1)} °C, at the end {end} °C, {hand}"


def hand_before(runs: list[Result]) -> str:
    """Return how far the hand moved before the pain, as text."""
    ends = [int(r["pain"].argmax()) if r["pain"].any() else len(r.log) for r in runs]
    return f"hand moved {spread((1e3 * r['hand'][:end].max() for r, end in zip(runs, ends)), 0)} mm"


def main() -> None:
    """Run all cases; print the numbers; draw."""
    given = arguments(__doc__).parse_args()
    kinds = [(kind, variant) for kind, variants in VARIANTS.items() for variant in variants]
    cases = {kind: [Case(*kind, seed) for seed in range(given.seeds)] for kind in kinds}
    results = run_all(run, cases, given)
    rows = [
        (TITLES[kind], variant, THESIS.get((kind, variant), ""), numbers(kind, results[kind, variant]))
        for kind, variant in kinds
    ]
    report(given, ("experiment", "controller", "thesis", "here"), rows)
    draw(results, given.out / "arm.png", TITLES)
    if not given.no_animation:
        shown = [Case("heat", variant, 0) for variant in ("hand only", "first")]
        film([lambda each, case=case: run(case, each) for case in shown], given.out / "arm.gif")


if __name__ == "__main__":
    main()
