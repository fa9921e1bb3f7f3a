"""The arm of the biped yields, shrinks back and keeps its hand in place by what its forearm feels (thesis 3.2 to 3.4).

    python examples/control/arm.py [--seeds 20]

The pelvis is held. The arm has position servos; torques of tasks move them through a resolver, as in the thesis's
figure 10. Five experiments: two contacts at once; a small and a large probe with the same force, and their pain; an
obstacle that comes near without contact; and something hot. The controller knows the joints and the forearm's
readings of force, proximity and temperature.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from biped import COUNTS, FULL_SCALE, NOISE, OFFSET, REST, TERRAIN_GROUP, TIME_STEP, build, mujoco, nominal, skins
from experiment import ARM_PAGE, FRAME_TIME, Camera, arguments, count, report, run_all, side_by_side, spread
from PIL import Image
from shapes import ELBOW_RADIUS, FOREARM_LENGTH, RANGE, RANGE_COUNTS, WRIST_RADIUS

from skin_calib_addon.calibration import LinkCalibration
from skin_calib_addon.runtime import Skin
from skin_calib_addon.runtime.poses import pose_from_mujoco
from skin_calib_addon.runtime.reflexes import Switch
from skin_calib_addon.runtime.tasks import TorqueResolver, attraction, contact_torques, prioritized
from skin_calib_addon.runtime.wrench import pressure_driven, proximity_wrench, temperature_wrench

PERIOD = 4e-3  # of the control [s]
# The legs are in the air, and the pelvis is welded to the world.
HELD = '</worldbody><equality><weld body1="pelvis"/></equality><worldbody>'
JOINTS = 7  # of the arm, the last ones of the robot
PROBE_MASS, PROBE_DAMPING, PROBE_STIFFNESS = 0.3, 30.0, 2000.0  # of a hand that presses [kg, N s/m, N/m]
STROKES = {"contacts": 0.06, "near": 0.03, "heat": -0.05}  # beyond the forearm's place at the start [m]
PROBE_SPEED = 0.06  # where no force is wanted [m/s]
MIN_FORCE = 0.3  # below which the mean is nothing [N]
FELT_TIME = 0.02  # of the mean of the felt wrench [s]
START = np.array((0.3, 0.4, 0.0, -1.5, 0.0, 0.0, 0.0))  # [rad]
RESOLVER_DAMPING = 8.0  # D [N m s/rad]. Larger: the arm yields more slowly
HAND_STIFFNESS, HAND_DAMPING, HAND_SPEED = 400.0, 40.0, 0.5  # [N/m, N s/m, m/s]
POSTURE = {"contacts": 4.0, "pressure": 40.0, "pain": 4.0, "near": 4.0, "heat": 4.0}  # stiffness [N m/rad]
AREA = 2.5e-4  # xi: at this area of contact, two cells, the pressure-driven wrench is the felt one [m^2]
PAIN = 10.0, 5.0, 0.5  # of the pressure-driven force: on and off [N, N], time below [s]. The thesis has 10 N
REPULSION = 1e6  # per area of skin with a sensor [N/m^3]: one taxel of nine has one
HOT, HEAT_LIMIT, HEAT_GAIN, AIR = 180.0, 31.0, 400.0, 22.0  # burner, limit [degC], gain [N/(K m^2)], air [degC]
HEAT_TIME, HEAT_STEP, HEAT_NOISE = 0.3, 0.25, 0.1  # of the temperature sensors: delay [s], resolution, noise [K]
# Colours of a pad at the temperature of the air and at that of the last value, in the animation [rgba, rgba, degC].
COLD_PAD, HOT_PAD, SHOWN_HOT = np.array((0.1, 0.6, 0.3, 1.0)), np.array((1.0, 0.1, 0.05, 1.0)), 60.0
SMALL, BALL, PRESSED = 0.006, 0.05, 0.13  # radius of a ball of the probes, of the obstacle, place of the probes [m]
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
TIMES = {"contacts": 2.5, "pressure": 1.0, "pain": 10.0, "near": 3.5, "heat": 4.0}  # [s]
Array = np.ndarray


@dataclass(frozen=True)
class Case:
    """One run."""

    kind: str
    variant: str
    seed: int


def probe_geoms(case: Case) -> str:
    """Return bodies that the experiment moves."""
    shapes = {
        "contacts": ('type="sphere" size=".02"',) * 2,
        "near": (f'type="sphere" size="{BALL}"',),
        "heat": (f'type="sphere" size="{BALL}"',),
    }
    balls = len(cushion()) if case.variant.startswith("large") else 1
    shown = shapes.get(case.kind, (f'type="sphere" size="{SMALL}"',) * balls)
    return "".join(
        f'<body name="probe{k}" gravcomp="1"><joint name="probe{k}" type="slide" axis="0 0 1" limited="false" '
        f'damping="{PROBE_DAMPING / balls}"/><geom class="terrain" {shape} mass="{PROBE_MASS / balls}" '
        'rgba=".85 .4 .2 1"/></body>'
        for k, shape in enumerate(shown)
    )


def cushion() -> Array:
    """Return the places (7, 3) of seven balls of a soft probe on the forearm, the middle one at the origin; z inward.

    Each slides on its own and carries the same part of the force.
    """
    radius = radius_at(PRESSED) + SMALL
    taper = (WRIST_RADIUS - ELBOW_RADIUS) / FOREARM_LENGTH
    around = np.array((-1, -1, 0, 0, 0, 1, 1)) * 0.012 / radius
    x = np.array((-0.5, 0.5, -1, 0, 1, -0.5, 0.5)) * 0.012
    at = radius + taper * x
    return np.column_stack((x, at * np.sin(around), radius - at * np.cos(around)))


def radius_at(distance: float) -> float:
    """Return the radius of the forearm at a distance from the elbow [m]."""
    return ELBOW_RADIUS + (WRIST_RADIUS - ELBOW_RADIUS) * (distance - 0.02) / FOREARM_LENGTH


@dataclass(frozen=True)
class Robot:
    """A robot whose last seven joints are those of an arm with skin on one link, and with a site ``hand``."""

    model: mujoco.MjModel  # simulated, with probes and skin
    nominal: mujoco.MjModel  # what a controller knows
    calibration: LinkCalibration  # of the link
    link: str
    start: Array  # (7,) [rad]
    prefix: str = ""  # of all names in the simulated model


class Arm:
    """The simulated arm; :meth:`senses` is what a controller gets.

    Parameters
    ----------
    case : Case
        Its seed is that of the noise and of the places of the probes.
    """

    def __init__(self, case: Case):
        self.case, self.rng, self.robot = case, np.random.default_rng(case.seed), self.load(case)
        self.model, calibration = self.robot.model, self.robot.calibration
        model, link = self.model, self.robot.prefix + self.robot.link
        self.data = mujoco.MjData(model)
        self.skin = Skin(calibration)
        self._touch = np.array([model.sensor(f"{link}/{id}").adr[0] for id in self.skin.ids])
        self._sites = np.array([model.site(f"{link}/{id}").id for id in self.skin.ids])
        channels = next(m.channels for m in calibration.modalities if m.name == "proximity")
        self._near = [(channel, model.site(f"{link}/{id}").id) for id, channel in channels.items()]
        self.skin.tare(np.stack([self._counts(np.zeros(self.skin.reading_length)) for _ in range(REST)]))
        self.probes = [k for k in range(model.nbody) if model.body(k).name.startswith("probe")]
        self._is_hot, self._heat = case.kind == "heat", np.full(len(self.skin.ids), AIR)
        self.targets = np.zeros(model.nu)
        self.targets[-JOINTS:] = self.data.qpos[-JOINTS:] = self.robot.start
        self.data.ctrl[:] = self.targets
        mujoco.mj_forward(model, self.data)

    def load(self, case: Case) -> Robot:
        """Return the robot with the probes of a case."""
        model = build(probe_geoms(case) + HELD, covered=("forearm",))
        return Robot(model, nominal(), skins()["forearm"], "forearm", START)

    def step(self, targets: Array, torques: Array) -> None:
        """Simulate one control cycle with angles and torques of the servos, (7,) each."""
        self.targets[-JOINTS:] = targets
        self.data.ctrl[:] = self.targets
        self.data.ctrl[-JOINTS:] += torques / self.model.actuator_gainprm[-JOINTS:, 0]
        substeps = round(PERIOD / TIME_STEP)
        for k in range(substeps):  # the sensors, most of the work, are computed when they are read
            self.model.opt.disableflags = 0 if k == substeps - 1 else mujoco.mjtDisableBit.mjDSBL_SENSOR
            mujoco.mj_step(self.model, self.data)

    def senses(self) -> tuple[float, Array, Array, dict[str, Array], Array]:
        """Return time, angles and velocities of the arm, readings of its skin, temperatures of the taxels [degC]."""
        force = np.zeros(self.skin.reading_length)
        force[self.skin.channels] = self.data.sensordata[self._touch]
        readings = {"force": self._counts(force), "proximity": self._proximity()}
        q, qd = self.data.qpos[-JOINTS:].copy(), self.data.qvel[-JOINTS:].copy()
        return self.data.time, q, qd, readings, self._temperatures()

    def _counts(self, force: Array) -> Array:
        noisy = OFFSET + force * COUNTS / FULL_SCALE + self.rng.normal(0, NOISE, force.shape)
        return np.clip(np.rint(noisy), 0, COUNTS)

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
        self._heat += PERIOD / HEAT_TIME * (target - self._heat)
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

    def places(self, kind: str, turn: Array) -> list[tuple[float, Array]]:
        """Return for each probe the distance from the elbow [m], and the direction (3,) from which it comes."""
        up, side = np.array((0.0, 0, 1)), np.array((0.0, 1, 0))
        below, lateral = (0.12, -up + turn[0] * side), (PRESSED, side + turn[0] * up)
        return {
            "contacts": [(0.17, up + turn[0] * side), (0.08, side + turn[1] * up)], "near": [below], "heat": [below]
        }.get(kind, [lateral])  # fmt: skip

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
    skin : Skin
        Of the forearm.
    robot : Robot
        Its nominal model, the name of the link, and the start; nothing else of it is used.
    """

    def __init__(self, case: Case, skin: Skin, robot: Robot):
        self.case, self.skin = case, skin
        self.model, self.link, self.start = robot.nominal, robot.link, robot.start
        self.data = mujoco.MjData(self.model)
        self.resolver = TorqueResolver(self.start, RESOLVER_DAMPING, self.model.jnt_range[-JOINTS:])
        self.pain = Switch(*PAIN)
        self.goal: Array | None = None  # of the hand
        self.since = np.inf  # when the pain began [s]
        self.virtual, self.area, self.felt, self.torques = 0.0, 0.0, np.zeros(6), np.zeros(JOINTS)

    def __call__(
        self, time: float, q: Array, qd: Array, readings: dict[str, Array], heat: Array
    ) -> tuple[Array, Array]:
        """Return angles and torques of the servos, (7,) each [rad, N m]."""
        model, data, resolver = self.model, self.data, self.resolver
        data.qpos[-JOINTS:], data.qvel[:] = q, 0  # of the pelvis as at the start
        mujoco.mj_forward(model, data)
        gravity, mass = data.qfrc_bias[-JOINTS:].copy(), np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        mass = mass[-JOINTS:, -JOINTS:]
        pose = pose_from_mujoco(data.body(self.link).xpos, data.body(self.link).xmat)
        frame = self.skin.update(readings, time)
        kind, variant, geometry = self.case.kind, self.case.variant, self.skin.geometry

        def task(wrenches: Any) -> tuple[Array, Array]:
            rows = contact_torques({self.link: wrenches}, {self.link: pose}, self._jacobian, JOINTS)
            return rows.sum(axis=0), rows

        pressure = kind == "pain" or variant.endswith("pressure")
        wrench = np.nan_to_num(frame.wrench)  # an unknown one is none
        if pressure:
            wrench = pressure_driven(wrench, frame.area, AREA)
        self.felt = self.felt + PERIOD / FELT_TIME * (wrench - self.felt)
        felt = self.felt if np.linalg.norm(self.felt[:3]) > MIN_FORCE else np.zeros(6)
        self.virtual = float(np.linalg.norm(felt[:3]))
        self.area = frame.area
        posture = (
            POSTURE[kind] * (self.start - resolver.angles),
            np.eye(JOINTS),
        )
        hand = self._hand()
        if kind == "contacts":
            tasks = [posture] if variant == "stiff" else [task(felt), posture]
        elif kind == "pressure":
            tasks = [task(felt), posture]
        elif kind == "pain":
            hurts = self.pain.update(self.virtual, time)
            self.since = min(self.since, time) if hurts else np.inf
            tasks = [task(felt), posture] if hurts else [hand, task(felt), posture]
        else:
            if kind == "near":
                virtual = proximity_wrench(geometry, frame.modalities["proximity"], RANGE, REPULSION)
            else:
                virtual = temperature_wrench(geometry, heat, HEAT_LIMIT, HEAT_GAIN)
            self.virtual, flee = float(np.linalg.norm(virtual[:3])), task(virtual)
            orders = {"hand only": [hand], "null space": [hand, flee], "first": [flee, hand]}
            tasks = [*orders[variant], posture]
        self.torques = prioritized(tasks, mass)
        return resolver.step(self.torques, mass, PERIOD), gravity

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
        size = {"contacts": 0.02, "near": BALL, "heat": BALL}.get(case.kind, SMALL)
        places = arm.places(case.kind, turn)
        self.clear = {"near": 0.12, "heat": 0.2}.get(case.kind, 0.003)  # from the forearm at the start [m]
        offsets = cushion() if case.variant.startswith("large") else np.zeros((1, 3))
        self.parts = len(offsets)  # of one probe
        for k in range(len(arm.probes)):
            distance, direction = places[k // self.parts]
            point, outward = arm.surface(distance + jitter[k // self.parts], direction)
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
        first, last = (int(t / PERIOD) for t in (0.15, 0.45))
        return float(self["moved"][last] - self["moved"][first]) / (0.45 - 0.15)

    @property
    def pain_force(self) -> float:
        """Mean force of the probe in the 0.1 s before the pain [N]; NaN without pain."""
        if not self["pain"].any():
            return np.nan
        k = int(self["pain"].argmax())
        return float(self["force"][k - round(0.1 / PERIOD) : k].mean())


COLUMNS = ("time", "force", "second", "virtual", "area", "hand", "gap", "heat", "moved", "pain", "norm")


def run(
    case: Case,
    each: Callable[[Arm], None] | None = None,
    duration: float | None = None,
    kind: Callable[[Case], Arm] = Arm,
) -> Result:
    """Return what happens in a case."""
    arm = kind(case)
    controller, hands, log = Controller(case, arm.skin, arm.robot), Experimenter(case, arm), []
    rest = arm.hand.copy()
    touched = None
    while arm.data.time < (duration or TIMES[case.kind]):
        hands(arm.data.time)
        arm.step(*controller(*arm.senses()))
        forces = [arm.force_on(k) for k in range(len(arm.probes))]
        if hands.parts > 1:
            forces = [sum(forces)]
        if touched is None and forces[0] > 0.5:
            touched = hands.moved(0)
        log.append((arm.data.time, forces[0], forces[-1], controller.virtual, controller.area,
                    np.linalg.norm(arm.hand - rest), arm.gap(), arm.hottest,
                    0.0 if touched is None else hands.moved(0) - touched, controller.pain.is_on,
                    np.linalg.norm(controller.torques)))  # fmt: skip
        if each:
            each(arm)
        if controller.pain.is_on and arm.data.time - controller.since > 1:
            break
    return Result(np.array(log))


class View(Camera):
    """From the side of the arm and a little below it; the colour of each pad is the temperature of its taxel."""

    def __init__(self, arm: Arm):
        super().__init__(arm, azimuth=-115.0, distance=0.75)
        self.view.lookat[:], self.view.elevation = arm.data.body("wrist").xpos, 25

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
        ("contacts", "force", "force of a probe [N]", None), ("pressure", "moved", "motion of the probe [m]", None),
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


def film(path: Path) -> None:
    """Write an animation of the burner with seed 0: left the hand task only, right heat first."""
    views: list[View] = []
    for number, variant in enumerate(("hand only", "first")):

        def look(arm: Arm, number: int = number) -> None:
            if len(views) == number:
                views.append(View(arm))
            views[number](arm)

        run(Case("heat", variant, 0), look)
    side_by_side(*views, path, colours=256)  # few pads are hot


def numbers(kind: str, runs: list[Result]) -> str:
    """Return the numbers of one experiment, mean and range over the seeds."""

    def largest(name: str, digits: int = 0, scale: float = 1.0) -> str:
        return spread((scale * r[name].max() for r in runs), digits)

    hand = f"hand moved {largest('hand', 0, 1e3)} mm"
    if kind == "contacts":
        return f"peaks {largest('force')} N and {largest('second')} N"
    if kind == "pressure":
        areas = (1e4 * np.median(r["area"][30:110]) for r in runs)
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
    given = arguments(__doc__, page=ARM_PAGE).parse_args()
    kinds = [(kind, variant) for kind, variants in VARIANTS.items() for variant in variants]
    cases = [Case(*kind, seed) for kind in kinds for seed in range(given.seeds)]
    found = run_all(run, cases, given)
    results = {kind: found[k * given.seeds : (k + 1) * given.seeds] for k, kind in enumerate(kinds)}
    rows = [
        (TITLES[kind], variant, THESIS.get((kind, variant), ""), numbers(kind, results[kind, variant]))
        for kind, variant in kinds
    ]
    report(given, ("experiment", "controller", "thesis", "here"), rows)
    draw(results, given.out / "arm.png", TITLES)
    if not given.no_animation:
        film(given.out / "arm.gif")
    print(f"diagram and animation in {given.out}")


if __name__ == "__main__":
    main()
