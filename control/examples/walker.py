"""Walk with a reference of the DCM, and with the ZMP that the soles feel."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from biped import DAMPING, FEET, Biped, Senses
from distribution import distribute
from estimator import SOLE_CENTRE, STALE, Estimator, State
from foothold import MIN_LOAD, Foothold, full_sole
from legs import joint_angles, rotation
from zmp_plan import Reference, ZmpPlan

from skin_calib_addon.runtime import Frame, Polygon, Skin, convex_hull, zero_moment_point
from skin_calib_addon.runtime.wrench import about
from skin_control.virtual import proximity_wrench
from skin_control.walking import (
    GRAVITY,
    com_velocity,
    com_velocity_command,
    dcm_velocity,
    desired_zmp,
    divergent_component,
    pendulum_frequency,
)

Array = np.ndarray
# Flags of a skin with which silent cells say nothing about the ground.
FAULTY = STALE | {"below_rest", "blind", "dead", "drift", "lost", "noisy", "not_finite", "stuck", "too_large"}
SURE = 0.9  # part of a sole in the hull of the pressed cells, from which on it stands on full ground
# Along each axis, that the program may use: both together are at most that of the ground, 0.7.
FRICTION = 0.49
UNKNOWN = np.full(2, np.nan)
OTHER = {"left": "right", "right": "left"}


@dataclass(frozen=True)
class Gains:
    """Of the balance; those of a study that walked."""

    dcm: float = 3.0  # k of eq. 4.28 [1/s]
    zmp: float = 0.5  # k_f of eq. 4.29 [1/s]
    com: float = 1.0  # k_x of eq. 4.29 [1/s]
    ankle: float = 0.005  # [rad/s/(N m)]
    leak: float = 0.3  # time constant with which the ankles return [s]
    margin: float = 0.01  # of the desired ZMP from the edge of the polygon [m]
    delay: float = 0.03  # between the DCM and the plan, up to which the plan goes on by the clock [s]
    catch_up: float = 0.1  # more of this delay, for which the plan goes on twice as fast [s]
    slow: float = 0.1  # speed of the DCM, below which time says little about where it is [m/s]
    fastest: float = 2.0  # rate of the plan
    anchor_speed: float = 0.05  # with which commanded feet move to where they stand [m/s]


@dataclass(frozen=True)
class Gait:
    """Times and heights of the steps."""

    single: float = 0.9  # [s]
    double: float = 0.3  # [s]
    hold: float = 0.0  # after a landing, in which the ZMP stays below the other foot [s]. Larger: slower, and safer
    start: float = 1.0  # of the first shift [s]
    end: float = 3.0  # of standing after the last step, in which a bad foothold shows [s]
    lift: float = 0.05  # [m]
    landing_speed: float = 0.08  # of a foot that meets the ground [m/s]
    wait: float = 0.15  # at most, until it is known where the ground bears a foot that has landed [s]
    arrival: float = 0.9  # fraction of the single support after which the foot is planned to meet the ground
    contact: float = 30.0  # load from which a swinging foot has landed [N]


@dataclass(frozen=True)
class Proximity:
    """Preemptive foot compliance (thesis 4.4.1): virtual springs between a landing sole and the ground slow it down."""

    near: float = 0.02  # distance from which the springs push [m]
    stiffness: float = 1e5  # of the springs, for an area [N/m^3]
    damping: float = 10.0  # force of the springs that slows the foot by 1 m/s [N s/m]
    creep: float = 0.04  # slowest speed of a foot that has not landed [m/s]
    lead: float = 0.12  # by which the foot starts to descend earlier, because it will be slower [s]
    turning: float = 3.0  # with which the sole becomes parallel to the ground [rad/s/(N m)]

    def wrench(self, skin: Skin, frame: Frame, centre: Array) -> Array:
        """Return the wrench (6,) of the virtual springs of a sole about its centre (3,) (thesis eq. 4.26)."""
        return about(proximity_wrench(skin.geometry, frame.modalities["proximity"], self.near, self.stiffness), centre)

    def slowed(self, speed: float, force: float) -> float:
        """Return the speed of a descending foot after the springs push it with a force [m/s]."""
        return max(speed - force / self.damping, min(speed, self.creep))

    def stops(self, wrench: Array) -> bool:
        """Return whether a wrench (6,) ends the swing before the felt load does: never, the springs only slow down."""
        return False


@dataclass(frozen=True)
class Step:
    """A footstep."""

    foot: str
    centre: Array  # (2,) of the sole [m]


def forward_steps(count: int, length: float, width: float, first: str = "right") -> list[Step]:
    """Return steps straight ahead, the last of which closes the feet."""
    steps, foot, x = [], first, 0.0
    for k in range(count):
        x += length if k < count - 1 else 0.0
        steps.append(Step(foot, np.array((x, width / 2 * (1 if foot == "left" else -1)))))
        foot = OTHER[foot]
    return steps


@dataclass
class Log:
    """What happened, by cycle and by step."""

    rows: list[dict] = field(default_factory=list)
    landings: list[dict] = field(default_factory=list)
    retracted: list[dict] = field(default_factory=list)
    stopped: float | None = None  # time at which the rest of the steps was given up [s]


class Walker:
    """The controller of one walk.

    Parameters
    ----------
    robot : Biped
        Its skins and its start; nothing else of it is used.
    steps : sequence of Step
        Where to walk.
    gait : Gait
    gains : Gains
    proximity : Proximity, optional
        Whether and how the soles slow down before they land.
    feels : bool
        Whether the feet learn where the ground bears them; otherwise the full sole is assumed.
    source : str
        As for :class:`Estimator`.
    heeds : bool
        Whether the flags of the skins count: a foot whose contact is not known lands by time, and the walk ends.
    cone : str, optional
        Distribute the wrench by a quadratic program with the wrench cone of the ``"full"`` sole or of what is
        ``"felt"``. Default: by the distances from the feet.
    avoid : callable, optional
        Called with the state and a foot that has just met the ground. Returns by how much (2,) its step is to be moved
        because the ground is not safe [m], or None if it is. The foot is then lifted once more.
    foothold : type of Foothold
        How a foot learns where the ground bears it.
    """

    def __init__(
        self,
        robot: Biped,
        steps: Sequence[Step],
        gait: Gait = Gait(),
        gains: Gains = Gains(),
        proximity: Proximity | None = None,
        feels: bool = True,
        source: str = "skin",
        heeds: bool = True,
        cone: str | None = None,
        avoid: Callable[[State, str], Array | None] | None = None,
        foothold: type[Foothold] = Foothold,
    ):
        self.estimator, self.gait, self.gains, self.proximity = (
            Estimator(robot.body, source, heeds),
            gait,
            gains,
            proximity,
        )
        self.steps = list(steps)
        self.period = robot.period
        self.arm = robot.start[12:]  # all joints after those of the legs stay where they are
        self.log = Log()
        self.phase = ""
        self.clock, self.rate = 0.0, 1.0  # time of the plan, and how fast it goes on [s, 1]
        self.index = 0  # of the step that is taken, or comes next
        self.tilts = {foot: np.zeros(2) for foot in FEET}  # roll and pitch of the ankle admittance [rad]
        self.footholds = {foot: foothold(robot.body.skins[f"{foot}_foot"], robot.period) for foot in FEET}
        self.cone, self.avoid = cone, avoid
        self.feels, self.heeds = feels, heeds
        self.last: Array | None = None  # angles of the last cycle
        self.done = False

    # One cycle

    def cycle(self, senses: Senses) -> tuple[Array, Array]:
        """Return targets (j,) [rad] and additional torques (j,) [N m] of the servos of all joints."""
        state = self.estimator.update(senses)
        if not self.phase:
            self._begin(state)
        self._change_phase(state)
        self._learn(state)
        since = self.clock - self.began
        reference = self.plan.at(self.clock - self.planned)
        velocity = com_velocity(self.com_reference, reference.dcm, self.omega)
        self.com_reference = self.com_reference + velocity * self.period
        dcm = divergent_component(state.com[:2], state.com_velocity[:2], self.omega)
        is_held = self._is_unsure(state)
        self.rate = 0.0 if is_held else plan_rate(reference, dcm, self.omega, self.gains)
        self.clock += self.rate * self.period
        # The ZMP of the plan moves the DCM on. Below the DCM it keeps it where it is while the plan is held.
        planned = reference.dcm if is_held else reference.zmp
        wanted = desired_zmp(planned, reference.dcm, dcm, self.gains.dcm, self.omega)
        support = self._supporting(state)
        wanted = support.closest(wanted)
        zmp = state.felt.zmp
        if zmp is not None:
            velocity = velocity + com_velocity_command(
                zmp, wanted, self.com, self.com_reference, self.gains.zmp, self.gains.com
            )
        self.com = self.com + velocity * self.period
        self._distribute(state, wanted)
        self._move_feet(state, since)
        self._tilt_ankles(state, wanted)
        targets, torques = self._angles(state, wanted)
        self.log.rows.append(
            {
                "time": state.time,
                "phase": self.phase,
                "zmp": UNKNOWN if zmp is None else zmp,
                "zmp_skin": UNKNOWN if state.skin.zmp is None else state.skin.zmp,
                "zmp_ankle": UNKNOWN if state.ankle.zmp is None else state.ankle.zmp,
                "wanted": wanted,
                "limits": support.bounds,
                "reference": reference.zmp,
                "dcm": dcm,
                "dcm_reference": reference.dcm,
                "com": state.com,
                "loads": tuple(np.nan if state.felt.loads[foot] is None else state.felt.loads[foot] for foot in FEET),
                "moments": state.ankle.moments,
                "soles": np.stack([state.soles[foot] for foot in FEET]),
            }
        )
        return targets, torques

    # Phases

    def _begin(self, state: State) -> None:
        self.omega = pendulum_frequency(float(state.com[2]))
        self.height = float(state.com[2])
        self.com = self.com_reference = state.com[:2].copy()
        self.commanded = {foot: state.soles[foot].copy() for foot in FEET}
        self.turn = {foot: np.eye(3) for foot in FEET}
        self._start("double", state, self.gait.start)

    def _start(self, phase: str, state: State, duration: float, early: float = 0.0) -> None:
        """Begin a phase; the ZMP first stays where it is for the time by which the foot has landed too early."""
        self.waited = 0.0  # until the foothold was known
        self.phase, self.began, self.duration, self.early = phase, self.clock, duration + early, early
        if phase == "single":
            self.lifted = self.commanded[self.swing_foot].copy()
            self.footholds[self.swing_foot].lift()
        self._plan(state)

    def _plan(self, state: State) -> None:
        """Plan the ZMP from now to the end of the walk."""
        now = self.plan.at(self.clock - self.planned).zmp if hasattr(self, "plan") else state.com[:2]
        centroids = {foot: self.footholds[foot].centroid for foot in FEET}
        ground = {foot: self.estimator.anchors[foot][:2] + centroids[foot] for foot in FEET}
        left = max(self.began + self.duration - self.clock, self.period)
        times, points = [0.0, left], [now]
        early = min(self.early - (self.clock - self.began), left - self.period)
        if early > 0:
            times, points = [0.0, early, left], [now, now]
        if self.phase == "single":
            points.append(ground[OTHER[self.swing_foot]])
            times[-1] += self.gait.hold
            times.append(times[-1] + self.gait.double)
            ground = ground | {self.swing_foot: self.steps[self.index].centre + centroids[self.swing_foot]}
        for step in self.steps[self.index + (self.phase == "single") :]:
            points += [ground[OTHER[step.foot]]] * 2
            end = times[-1] + self.gait.single + self.gait.hold
            times += [end, end + self.gait.double]
            ground = ground | {step.foot: step.centre + centroids[step.foot]}
        points.append(sum(ground.values()) / 2)
        self.plan, self.planned = ZmpPlan(times, points, self.omega), self.clock

    def _change_phase(self, state: State) -> None:
        since = self.clock - self.began
        if self.phase == "double" and self._stop_if_blind(state):
            self._plan(state)
        if self.phase == "double" and since >= self.duration:
            if self.index < len(self.steps):
                self._start("single", state, self.gait.single)
            elif since >= self.duration + self.gait.end:
                self.done = True
        elif self.phase == "single":
            foot = self.steps[self.index].foot
            load = state.felt.loads[foot]
            has_landed = since >= self.duration if load is None else load > self.gait.contact
            if self.proximity and self.proximity.stops(self._springs(state, foot)):
                has_landed = True
            if since > 0.3 * self.duration and has_landed:
                shift = self.avoid(state, foot) if self.avoid else None
                if shift is None:
                    self._land(foot, state)
                else:
                    self._retract(foot, shift, state)

    def _land(self, foot: str, state: State) -> None:
        self.log.landings.append({"time": state.time, "foot": foot, "late": self.clock - self.began - self.duration})
        self.estimator.land(foot, self._ground_height(foot, state))
        self.index += 1
        self._stop_if_blind(state)
        early = max(self.began + self.duration + self.gait.hold - self.clock, 0.0)
        self._start("double", state, self.gait.double, early)

    def _retract(self, foot: str, shift: Array, state: State) -> None:
        """Lift a foot that has just met unsafe ground, and begin its step anew with another goal."""
        self.log.retracted.append({"time": state.time, "foot": foot, "shift": shift})
        moved = state.soles[foot][:2] + shift - self.steps[self.index].centre
        self.steps[self.index :] = [Step(step.foot, step.centre + moved) for step in self.steps[self.index :]]
        self.commanded[foot] = state.soles[foot].copy()
        self._start("single", state, self.gait.single)

    def _stop_if_blind(self, state: State) -> bool:
        """End the walk with both feet on the ground if the contact of one is not known; return whether it ends now."""
        if None not in state.felt.loads.values() or self.index == len(self.steps):
            return False
        self.log.stopped = state.time
        del self.steps[self.index :]
        return True

    def _learn(self, state: State) -> None:
        """Find out which parts of the standing feet hang in the air; plan anew if there are new ones."""
        for foot in self._standing() if self.feels else ():
            frame = state.frame.links.get(f"{foot}_foot")
            if frame is None:
                continue
            if self.heeds and frame.flags & FAULTY:  # a silent cell is then no evidence: assume the full sole
                had_changed = self.footholds[foot].void.any()
                self.footholds[foot].clear()
            else:
                had_changed = self.footholds[foot].update(frame, state.feet[foot][2, :2])
            if had_changed:
                self._plan(state)

    def _ground_height(self, foot: str, state: State) -> float | None:
        """Return the height of the standing foot if the landed one is nearly at it: then the ground is flat."""
        height = self.estimator.anchors[OTHER[foot]][2]
        return height if abs(state.soles[foot][2] - height) < 0.01 else None

    def _is_unsure(self, state: State) -> bool:
        """Return whether it is not known yet where the ground bears the foot that has landed last.

        A foot on full ground has pressed nearly all of its sole soon after the load is enough to find void cells.
        """
        if not self.feels or self.phase == "single" or self.index == 0:
            return False
        foot = self.steps[self.index - 1].foot
        is_loaded = self.waited > 0 or (state.felt.loads[foot] or 0.0) > MIN_LOAD  # to wait changes the load
        is_unsure = is_loaded and self.footholds[foot].inside.mean() < SURE and self.waited < self.gait.wait
        self.waited += self.period * is_unsure
        return is_unsure

    # Feet and ankles

    def _move_feet(self, state: State, since: float) -> None:
        for foot in FEET:
            if foot == self.swing_foot:
                self.commanded[foot] = self._swing(state, since)
            else:
                away = self.estimator.anchors[foot] - self.commanded[foot]
                far = np.linalg.norm(away)
                self.commanded[foot] = self.commanded[foot] + away * min(
                    1.0, self.gains.anchor_speed * self.period / max(far, 1e-9)
                )

    def _swing(self, state: State, since: float) -> Array:
        """Return where the sole of the swinging foot is to be.

        It moves by a polynomial of fifth order to above its place and half of the time up; then down by one of third
        order that ends with the speed of landing, and on with this speed. Virtual springs reduce the speed.
        """
        step, gait, compliant = self.steps[self.index], self.gait, self.proximity
        ground = self.estimator.anchors[OTHER[step.foot]][2]
        arrival = gait.arrival * gait.single - (compliant.lead if compliant else 0.0)
        smooth = quintic(min(since / arrival, 1.0))
        flat = self.lifted[:2] + smooth * (step.centre - self.lifted[:2])
        top, half = ground + gait.lift, 0.45 * arrival
        if since < half:
            return np.array((*flat, self.lifted[2] + (top - self.lifted[2]) * quintic(since / half)))
        speed = descent(since - half, arrival - half, top - ground, gait.landing_speed)
        if compliant:
            virtual = self._springs(state, step.foot)
            turn = compliant.turning * self.period * virtual[3:5]
            self.tilts[step.foot] = self.tilts[step.foot] + turn
            speed = compliant.slowed(speed, virtual[2])
        return np.array((*flat, self.commanded[step.foot][2] - speed * self.rate * self.period))

    def _springs(self, state: State, foot: str) -> Array:
        """Return the wrench (6,) that slows a swinging foot, about the centre of its sole; zero without a frame."""
        frame = state.frame.links.get(f"{foot}_foot")
        if frame is None:
            return np.zeros(6)
        return self.proximity.wrench(self.estimator.body.skins[f"{foot}_foot"], frame, SOLE_CENTRE)

    def _tilt_ankles(self, state: State, wanted: Array) -> None:
        """Turn the soles so that their CoPs go to the desired ZMP (admittance)."""
        goals = self._parts(state, wanted)
        for foot in FEET:
            self.tilts[foot] = self.tilts[foot] * (1 - self.period / self.gains.leak)
            load, cop = state.felt.loads[foot], state.felt.cops[foot]
            if not load or cop is None or foot == self.swing_foot:
                continue
            goal = self.footholds[foot].area.inset(self.gains.margin).closest(goals[foot][1] - state.soles[foot][:2])
            if foot in self.wrenches:
                goal = zero_moment_point(self.wrenches[foot])
            if goal is None:
                goal = self.footholds[foot].area.centroid
            moment = load * (goal - cop)
            self.tilts[foot] = self.tilts[foot] + self.gains.ankle * self.period * np.array((-moment[1], moment[0]))

    def _distribute(self, state: State, wanted: Array) -> None:
        """Find the wrench of each standing foot, if there is to be a program for it."""
        self.wrenches: dict[str, Array] = {}
        if self.cone:
            soles = {foot: state.soles[foot] for foot in self._standing()}
            areas = {foot: self.footholds[foot].area if self.cone == "felt" else full_sole() for foot in soles}
            areas = {foot: area.inset(self.gains.margin) for foot, area in areas.items()}
            self.wrenches = distribute(wanted, self.estimator.mass * GRAVITY, soles, areas, FRICTION) or {}

    @property
    def swing_foot(self) -> str | None:
        """The foot in the air."""
        return self.steps[self.index].foot if self.phase == "single" else None

    def _standing(self) -> list[str]:
        return [foot for foot in FEET if foot != self.swing_foot]

    def _supporting(self, state: State) -> Polygon:
        """Return the polygon of the feet that are meant to stand, less a margin."""
        corners = [self.footholds[foot].area.corners + state.soles[foot][:2] for foot in self._standing()]
        hull = convex_hull(np.concatenate(corners))
        smaller = hull.inset(self.gains.margin)
        return smaller if len(smaller.corners) else convex_hull(hull.centroid[None])

    # Joints

    def _angles(self, state: State, wanted: Array) -> tuple[Array, Array]:
        pelvis = np.array((*self.com, self.height)) - state.com_in_pelvis  # the pelvis is to be upright
        feet = {}
        for foot in FEET:
            roll, pitch = self.tilts[foot]
            turn = rotation(1, pitch) @ rotation(0, roll)
            feet[foot] = (self.commanded[foot] - turn @ SOLE_CENTRE, turn)
        targets = np.concatenate((joint_angles(pelvis, np.eye(3), feet), self.arm))
        rates = np.zeros_like(targets) if self.last is None else (targets - self.last) / self.period
        self.last = targets
        torques = self.estimator.gravity_torques(self._forces(state, wanted))
        return targets, torques + DAMPING * rates  # the servos damp velocities; the arm does not move

    def _forces(self, state: State, wanted: Array) -> dict[str, tuple[Array, Array]]:
        """Return the forces of the ground that together act at the desired ZMP, and their points."""
        if self.wrenches:
            points = {foot: zero_moment_point(wrench) for foot, wrench in self.wrenches.items()}
            return {
                foot: (wrench[:3], state.soles[foot] + np.array((*points[foot], 0.0)))
                for foot, wrench in self.wrenches.items()
            }
        weight = self.estimator.mass * GRAVITY
        return {
            foot: (np.array((0, 0, part * weight)), np.array((*point, state.soles[foot][2])))
            for foot, (part, point) in self._parts(state, wanted).items()
        }

    def _parts(self, state: State, wanted: Array) -> dict[str, tuple[float, Array]]:
        """Return the part of the weight that each standing foot carries for a ZMP, and its CoP (2,) in the world [m].

        The CoPs are as far from the centroids of the footholds as the ZMP is from the line between them. A foot that
        gets its load near its centroid presses many cells, and finds out early where the ground ends.
        """
        centroids = {foot: state.soles[foot][:2] + self.footholds[foot].centroid for foot in self._standing()}
        if len(centroids) == 1:
            return {foot: (1.0, wanted) for foot in centroids}
        (one, a), (other, b) = centroids.items()
        part = float(np.clip((wanted - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1))
        away = wanted - (1 - part) * a - part * b
        return {one: (1 - part, a + away), other: (part, b + away)}


def plan_rate(reference: Reference, dcm: Array, omega: float, gains: Gains) -> float:
    """Return how fast a plan is to go on: faster if the DCM is ahead of it, slower or not at all if it is behind.

    A ZMP at the edge of the foothold cannot bring the DCM back to a plan that does not wait for it.
    """
    velocity = dcm_velocity(reference.dcm, reference.zmp, omega)
    ahead = (dcm - reference.dcm) @ velocity / (velocity @ velocity + gains.slow**2)  # [s]
    ahead -= np.clip(ahead, -gains.delay, gains.delay)
    return float(np.clip(1 + ahead / gains.catch_up, 0.0, gains.fastest))


def descent(time: float, span: float, height: float, landing_speed: float) -> float:
    """Return the speed of a foot that begins to descend at rest, and ends with the speed of landing [m/s].

    Parameters
    ----------
    time, span : float
        Since the begin of the descent, and until its end; later the foot goes on with the speed of landing [s].
    height : float
        [m].
    landing_speed : float
        [m/s].
    """
    part = min(time / span, 1.0)
    return 6 * height / span * part * (1 - part) + landing_speed * (3 * part**2 - 2 * part)


def quintic(part: float) -> float:
    """Return a rise from 0 to 1 whose first two derivatives are zero at both ends."""
    return part**3 * (10 - 15 * part + 6 * part**2)


def walk(robot: Biped, walker: Walker, seconds: float, push=lambda time: None, each=lambda robot: None) -> bool:
    """Simulate until the walk is done, the robot has fallen, or the time is over; return whether it stands.

    The time is that for the steps; after them the robot still stands for ``walker.gait.end`` [s].
    """
    while robot.data.time < seconds + walker.gait.end and not walker.done and not robot.fallen:
        senses = robot.senses()
        targets, torques = walker.cycle(senses)
        robot.step(targets, torques, push(senses.time))
        each(robot)
    return not robot.fallen
