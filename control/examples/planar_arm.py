"""Intentional contact: a planar arm pushes what stops it, and yields to a hard contact (thesis 3.4.2, figure 24).

    python control/examples/planar_arm.py [--seeds 20]

Seven links with skin all around them lie on a table. Force and proximity of 560 taxels are all that the controller
knows of the obstacle, which stands where the arm must be. From t = 11 s on, a force of 50 N drives the obstacle against
the arm for 0.7 s. Four controllers: without skin; avoidance only (fixed priorities); table 1 of the thesis as
printed; and that of the runtime.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from biped import NOISE, REST, force_counts, mujoco
from experiment import FRAME_TIME, Camera, arguments, count, report, run_all, spread
from PIL import Image
from planar_skin import FULL_SCALE, LINK_LENGTH, PLAN, RANGE, RANGE_COUNTS
from planar_skin import RADIUS as RADIUS_OF_LINK
from planar_skin import main as make_skin

from skin_calib_addon.calibration import LinkCalibration
from skin_calib_addon.calibration.exchange.mjcf import write_mjcf
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.plan import load_plan
from skin_calib_addon.runtime import Body, BodyFrame, Skin
from skin_calib_addon.runtime.poses import pose_from_mujoco
from skin_control.reflexes import IntentionalContact, Stage, blended
from skin_control.tasks import attraction, contact_torques, prioritized
from skin_control.virtual import proximity_wrench

JOINTS = 7
LINKS = tuple(f"link{k}" for k in range(JOINTS))
PAD_RADIUS = 0.013  # of the sphere below each taxel [m]
FOAM = 0.02  # time constant of a contact with the soft skin [s]
TIME_STEP, PERIOD = 2e-3, 4e-3  # of the simulation and of the control [s]
DURATION = 13.0  # of a run [s]
PUSH_TIME, PUSH_END, PUSH_FORCE = 11.0, 11.7, 50.0  # of the force on the obstacle [s, s, N]
START = np.array((-0.35, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1))  # [rad]
GOAL, TURN = np.array((0.95, 1.3)), 0.95  # of the tip [m], of the last link [rad]
OBSTACLE, RADIUS = np.array((0.66, 0.57)), 0.1  # where it stands, its radius [m]
SLOW, MAX_FORCE, PATIENCE = 0.04, 20.0, 0.3  # eps_v [m/s], eps_c [N], [s]
SPEED_TIME = 0.5  # of the mean of the tip's velocity, in which oscillations cancel [s]
STIFFNESS = 200.0  # k_p [N/m]
DAMPING = 40.0  # k_v [N s/m]
MAX_SPEED = {Stage.AVOID: 0.3, Stage.PUSH: 0.15, Stage.YIELD: 0.15}  # V_max [m/s]; k_v V_max is the largest force
TOUCH_SPEED = 0.05  # while the arm comes near what it will push [m/s]
TURN_STIFFNESS, TURN_DAMPING = 4.0, 2.0  # [N m/rad, N m s/rad]
REPULSION = 2e4  # of the proximity per area [N/m^3]
JOINT_DAMPING = 2.0  # in all directions, which only takes energy [N m s/rad]
REACTION = 40.0  # largest force of the reaction to a contact [N]
MIN_FORCE = 0.5  # below which a mean wrench is nothing [N]
FELT_TIME = 0.03  # of the mean of the felt wrenches [s]
NEAR_RANGE = 0.03  # of the repulsion while the arm pushes [m]
BLEND_RATE = 10.0  # delta_t [1/s]
AT_GOAL = 0.02  # distance at which the goal counts as met [m]
POLICIES = ("without skin", "avoid only", "as printed", "runtime")
NAMES = dict(zip(POLICIES, ("without skin", "avoidance only", "table 1 as printed", "`IntentionalContact`")))
COLOURS = {Stage.AVOID: "#dfe8f5", Stage.PUSH: "#fbe8c8", Stage.YIELD: "#f5c9c9"}
Array = np.ndarray


@cache
def calibration() -> LinkCalibration:
    """Return the calibration of a link, the same for all."""
    if not PLAN.exists():
        make_skin()
    return calibrate(load_plan(PLAN)).calibration


def _xml(obstacle: Array | None, friction: float) -> str:
    links = "".join(
        f'<body name="{name}" pos="{0 if k == 0 else LINK_LENGTH} 0 0"><joint axis="0 0 1" damping="1" armature=".02"/>'
        f'<geom class="body" type="capsule" fromto=".02 0 0 {LINK_LENGTH - 0.02} 0 0" size=".03" mass=".8"/>'
        f'<geom class="body" type="cylinder" size=".032 .04" mass=".2"/>'
        for k, name in enumerate(LINKS)
    )
    disc = "" if obstacle is None else (
        f'<body name="obstacle" pos="{obstacle[0]} {obstacle[1]} 0">'
        f'<joint type="slide" axis="1 0 0" frictionloss="{friction}" damping="80"/>'
        f'<joint type="slide" axis="0 1 0" frictionloss="{friction}" damping="80"/>'
        f'<geom type="cylinder" size="{RADIUS} .06" mass="2" contype="0" conaffinity="2" rgba=".8 .45 .2 1"/></body>'
    )  # fmt: skip
    return f"""
  <mujoco>
   <compiler angle="radian"/>
   <option timestep="{TIME_STEP}" gravity="0 0 0" integrator="implicitfast" cone="elliptic"/>
   <visual><global offwidth="960" offheight="720"/></visual>
   <asset><texture name="sky" type="skybox" builtin="flat" rgb1=".95 .97 1" width="8" height="8"/></asset>
   <default><default class="body"><geom contype="0" conaffinity="0" rgba=".32 .38 .48 1"/></default></default>
   <worldbody>
    <light pos="0 -1 4" dir="0.1 .3 -1" diffuse=".9 .9 .9"/>
    <geom class="body" type="plane" size="3 3 .1" pos="0 0 -.08" rgba=".85 .86 .88 1"/>
    <geom class="body" type="cylinder" size=".03 .004" pos="{GOAL[0]} {GOAL[1]} -.07" rgba=".2 .7 .3 1"/>
    {links}<site name="tip" pos="{LINK_LENGTH} 0 0"/>{"</body>" * JOINTS}{disc}
   </worldbody>
  </mujoco>"""


class PlanarArm:
    """The simulated arm with its obstacle; :meth:`senses` is what a controller gets.

    Parameters
    ----------
    seed : int
        Of the noise, of the place of the obstacle (3 cm) and of its friction (2 to 4 N along x and along y).
    """

    def __init__(self, seed: int):
        self.rng = np.random.default_rng(seed)
        place = OBSTACLE + self.rng.uniform(-0.03, 0.03, 2)
        spec = mujoco.MjSpec.from_string(_xml(place, self.rng.uniform(2, 4)))
        for link in LINKS:
            skin = mujoco.MjSpec.from_string(write_mjcf(calibration()).decode())
            for sensor in [s for s in skin.sensors if s.type == mujoco.mjtSensor.mjSENS_TACTILE]:
                skin.delete(sensor)
            for geom in list(skin.body("planar_link").geoms):
                if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
                    skin.delete(geom)
                else:  # a sphere instead of a thin box, through which the obstacle would pass
                    place = np.linalg.norm(geom.pos[1:])
                    inward = (RADIUS_OF_LINK - PAD_RADIUS) / place
                    geom.type, geom.size = mujoco.mjtGeom.mjGEOM_SPHERE, [PAD_RADIUS, 0, 0]
                    geom.pos = [geom.pos[0], *(geom.pos[1:] * inward)]
                    geom.contype, geom.conaffinity, geom.rgba, geom.group = 2, 0, [0.1, 0.6, 0.3, 1], 1
                    geom.solref = [FOAM, 1]
            spec.body(link).add_frame().attach_body(skin.body("planar_link"), f"{link}/", "")
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.body = Body({link: Skin(calibration()) for link in LINKS})
        ids = next(iter(self.body.skins.values())).ids
        self._touch = {k: np.array([self.model.sensor(f"{k}/{id}").adr[0] for id in ids]) for k in LINKS}
        self._sites = {k: np.array([self.model.site(f"{k}/{id}").id for id in ids]) for k in LINKS}
        for skin in self.body.skins.values():
            skin.tare(np.stack([self._counts(np.zeros(len(ids))) for _ in range(REST)]), accept=True)
        self.peak = 0.0  # largest true contact force in the last cycle [N]
        self.data.qpos[:JOINTS] = START
        mujoco.mj_forward(self.model, self.data)

    def step(self, torques: Array) -> None:
        """Simulate one control cycle."""
        self.data.qfrc_applied[:JOINTS] = torques
        push = np.zeros(2)
        if PUSH_TIME <= self.data.time < PUSH_END:
            towards = self.data.body("link3").xipos[:2] - self.data.body("obstacle").xpos[:2]
            push = PUSH_FORCE * towards / np.linalg.norm(towards)
        self.data.xfrc_applied[self.model.body("obstacle").id, :2] = push
        self.peak = 0.0
        for _ in range(round(PERIOD / TIME_STEP)):
            mujoco.mj_step(self.model, self.data)
            self.peak = max(self.peak, self.true_contact())

    def senses(self) -> tuple[float, Array, Array, dict[str, dict[str, Array]]]:
        """Return time, joint angles, joint velocities, and the readings of all skins."""
        data = self.data
        readings = {}
        for link in LINKS:
            channels = self.body.skins[link].channels
            force, near = np.zeros(len(channels)), np.zeros(len(channels))
            force[channels] = data.sensordata[self._touch[link]]
            near[channels] = self._nearness(self._sites[link])
            readings[link] = {"force": self._counts(force), "proximity": near}
        return data.time, data.qpos[:JOINTS].copy(), data.qvel[:JOINTS].copy(), readings

    def _counts(self, force: Array) -> Array:
        return force_counts(force, FULL_SCALE, self.rng.normal(0, NOISE, force.shape))

    def _nearness(self, sites: Array) -> Array:
        """Return readings of the proximity sensors: their rays end at the obstacle, a tall upright cylinder."""
        outward = self.data.site_xmat[sites].reshape(-1, 3, 3)[:, :2, 2]
        apart = self.data.site_xpos[sites, :2] - self.data.body("obstacle").xpos[:2]
        a, b = (outward**2).sum(axis=1), (outward * apart).sum(axis=1)
        root = b * b - a * ((apart**2).sum(axis=1) - RADIUS**2)
        with np.errstate(invalid="ignore", divide="ignore"):
            distance = np.maximum((-b - np.sqrt(root)) / a, 0.0)
            hit = (root > 0) & (b < 0) & (distance <= RANGE)
        noisy = np.rint(RANGE_COUNTS * (1 - distance / RANGE) + self.rng.normal(0, NOISE, len(sites)))
        return np.where(hit, np.clip(noisy, 0, RANGE_COUNTS), 0.0)

    def true_contact(self) -> float:
        """Return the true normal force between arm and obstacle [N]."""
        rows = self.data.contact.efc_address
        return float(self.data.efc_force[rows[rows >= 0]].sum())


class Printed:
    """Table 1 of the thesis as printed; it has no memory but its stage."""

    def __init__(self) -> None:
        self.stage, self.since = Stage.AVOID, -np.inf

    def update(self, time: float, speed: float, is_at_goal: bool, near: float, contact: float) -> Stage:
        """Return the stage."""
        stage = self.stage
        if contact >= MAX_FORCE:
            stage = Stage.YIELD
        elif near > 0 and speed <= SLOW:
            stage = Stage.PUSH
        elif contact == 0 and speed > SLOW:
            stage = Stage.AVOID
        if stage is not self.stage:
            self.stage, self.since = stage, time
        return stage


class Controller:
    """Joint torques from angles, velocities and readings.

    Parameters
    ----------
    body : Body
        The skins.
    policy : str
        One of ``POLICIES``.
    """

    def __init__(self, body: Body, policy: str):
        self.body, self.policy = body, policy
        self.stages = {"as printed": Printed, "runtime": lambda: IntentionalContact(SLOW, MAX_FORCE, PATIENCE)}.get(
            policy, lambda: None
        )()
        self.model = mujoco.MjModel.from_xml_string(_xml(None, 0))  # of the arm alone, without skin
        self.data = mujoco.MjData(self.model)
        self.torques = self.before = np.zeros(JOINTS)
        self.progress, self.speed, self.near, self.contact = np.zeros(2), 0.0, 0.0, 0.0
        self.felt = dict.fromkeys(LINKS, np.zeros(6))  # mean of the last cycles
        self.stage = Stage.AVOID

    def __call__(self, time: float, q: Array, qd: Array, readings: dict[str, dict[str, Array]]) -> Array:
        """Return the torques (7,) [N m]."""
        model, data = self.model, self.data
        data.qpos[:], data.qvel[:] = q, qd
        mujoco.mj_forward(model, data)
        inertia, tip = np.zeros((JOINTS, JOINTS)), np.zeros((6, JOINTS))
        mujoco.mj_fullM(model, data, inertia)
        mujoco.mj_jacSite(model, data, tip[:3], tip[3:], model.site("tip").id)
        hand, turn = tip[:2], tip[5:]
        x, velocity = data.site("tip").xpos[:2], hand @ qd
        angle = np.array((q.sum(),))
        twist = attraction(angle, turn @ qd, np.array((TURN,)), TURN_STIFFNESS, TURN_DAMPING, 1.0)
        limit = MAX_SPEED[self.stage]
        if self.policy == "runtime" and self.stage is Stage.PUSH and self.contact == 0:
            limit = TOUCH_SPEED
        pull = attraction(x, velocity, GOAL, STIFFNESS, DAMPING, limit)
        goal = [(hand.T @ pull, hand), (turn.T @ twist, turn)]
        damping = -JOINT_DAMPING * qd
        if self.policy == "without skin":
            self.torques = prioritized(goal, inertia) + damping
            return self.torques
        bodies = {link: data.body(link) for link in LINKS}
        poses = {link: pose_from_mujoco(body.xpos, body.xmat) for link, body in bodies.items()}
        frame = self.body.update(readings, time, poses)
        unknown = np.full(6, np.nan)
        wrenches = {link: frame.links[link].wrench if link in frame.links else unknown for link in LINKS}
        for link, wrench in wrenches.items():  # the mean of what is not known decreases
            self.felt[link] = self.felt[link] + PERIOD / FELT_TIME * (np.nan_to_num(wrench) - self.felt[link])
        felt = {
            link: wrench * min(1.0, REACTION / np.linalg.norm(wrench[:3]))
            for link, wrench in self.felt.items()
            if np.linalg.norm(wrench[:3]) > MIN_FORCE
        }
        virtual = self._repulsion(frame, RANGE)
        self.contact = max(float(np.linalg.norm(w[:3])) for w in self.felt.values())
        self.contact *= self.contact > MIN_FORCE
        self.near = max((float(np.linalg.norm(w[:3])) for w in virtual.values()), default=0.0)
        self.progress += PERIOD / SPEED_TIME * (velocity - self.progress)
        self.speed = float(np.linalg.norm(self.progress))
        if self.stages is not None:
            is_at_goal = bool(np.linalg.norm(GOAL - x) < AT_GOAL)
            contact = self.contact if np.isfinite([*wrenches.values()]).all() else np.nan
            self.stage = self.stages.update(time, self.speed, is_at_goal, self.near, contact)
            if self.stages.since == time:
                self.before = self.torques
        if self.stage is not Stage.AVOID:
            virtual = self._repulsion(frame, NEAR_RANGE)
        avoid, react = (self._task(wrenches, poses) for wrenches in (virtual, felt))
        order = {Stage.AVOID: [avoid, *goal, react], Stage.PUSH: [*goal, react, avoid],
                 Stage.YIELD: [react, *goal, avoid]}[self.stage]  # fmt: skip
        torques = prioritized(order, inertia) + damping
        if self.stages is not None and np.isfinite(self.stages.since):
            elapsed = time - self.stages.since
            if self.policy == "as printed":  # eq. 3.46, which begins in the middle
                old = (1 - np.tanh(BLEND_RATE * elapsed)) / 2
                torques = old * self.before + (1 - old) * torques
            else:
                torques = blended(self.before, torques, elapsed, BLEND_RATE)
        self.torques = torques
        return torques

    def _repulsion(self, frame: BodyFrame, detection_range: float) -> dict[str, Array]:
        return {
            link: proximity_wrench(
                self.body.skins[link].geometry, f.modalities["proximity"], detection_range, REPULSION
            )
            for link, f in frame.links.items()
        }

    def _task(self, wrenches: dict[str, Array], poses: dict[str, Array]) -> tuple[Array, Array]:
        rows = contact_torques(wrenches, poses, self._jacobian, JOINTS)
        return rows.sum(axis=0), rows

    def _jacobian(self, link: str) -> Array:
        jacobian = np.zeros((6, JOINTS))
        body = self.model.body(link).id
        mujoco.mj_jac(self.model, self.data, jacobian[:3], jacobian[3:], self.data.xpos[body], body)
        return jacobian


@dataclass(frozen=True)
class Result:
    """One run, by control cycle.

    Rows of ``log``: time [s], speed of the tip [m/s], forces of proximity and of the felt contact, largest true contact
    force [N], norm of the torques [N m], distance from the goal [m], largest change of a torque [N m].
    """

    log: Array
    stages: tuple[Stage, ...]

    @property
    def arrival(self) -> float:
        """Time at which the tip is at the goal, before the external force [s]; NaN if never."""
        rows = (self.log[:, 6] < AT_GOAL) & (self.log[:, 0] < PUSH_TIME)
        return float(self.log[rows.argmax(), 0]) if rows.any() else np.nan

    def peak(self, start: float, end: float) -> float:
        """Return the largest true contact force in a time [N]."""
        return float(self.log[(self.log[:, 0] >= start) & (self.log[:, 0] < end), 4].max())

    def hard(self, limit: float) -> float:
        """Return for how long the true contact force exceeds a limit [s]."""
        return float((self.log[:, 4] > limit).sum() * PERIOD)

    @property
    def changes_before_touch(self) -> int:
        """Number of changes of the stage before the first contact."""
        touches = self.log[:, 4] > 0
        end = int(touches.argmax()) if touches.any() else len(self.stages)
        return sum(a is not b for a, b in zip(self.stages[:end], self.stages[1:end]))

    @property
    def changes(self) -> int:
        """Number of changes of the stage."""
        return sum(a is not b for a, b in zip(self.stages, self.stages[1:]))

    @property
    def jump(self) -> float:
        """Largest change of the torques at a change of the stage [N m]."""
        k = [k for k, (a, b) in enumerate(zip(self.stages, self.stages[1:]), 1) if a is not b]
        return float(self.log[k, 7].max()) if k else 0.0


def run(case: tuple[str, int], each: Callable[[PlanarArm], None] | None = None, duration: float = DURATION) -> Result:
    """Return what happens with a policy and a seed."""
    policy, seed = case
    arm = PlanarArm(seed)
    controller, log, stages = Controller(arm.body, policy), [], []
    before = np.zeros(JOINTS)
    while arm.data.time < duration:
        torques = controller(*arm.senses())
        arm.step(torques)
        distance = np.linalg.norm(arm.data.site("tip").xpos[:2] - GOAL)
        log.append((arm.data.time, controller.speed, controller.near, controller.contact, arm.peak,
                    np.linalg.norm(torques), distance, np.abs(torques - before).max()))  # fmt: skip
        before = torques
        stages.append(controller.stage)
        if each:
            each(arm)
    return Result(np.array(log), tuple(stages))


class View(Camera):
    """From above."""

    def __init__(self, arm: PlanarArm):
        super().__init__(arm)
        self.view.lookat[:] = (0.65, 0.55, 0)
        self.view.azimuth, self.view.elevation, self.view.distance = 90, -80, 2.3
        light = arm.model.vis.headlight
        light.ambient[:], light.diffuse[:] = 0.1, 0.4  # from above there is no shade, and the floor is bright

    def __call__(self, robot: PlanarArm) -> None:
        """Take a frame if it is time for one."""
        if robot.data.time >= self.next:
            self.next += 2 * FRAME_TIME
            self.renderer.update_scene(robot.data, self.view, self.options)
            self.frames.append(Image.fromarray(self.renderer.render()))


def draw(result: Result, path) -> None:
    """Draw stages, speed, proximity force, contact force and torques, as figure 25 of the thesis."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    time = result.log[:, 0]
    panels = (
        (1, "speed of the tip [m/s]", SLOW, r"$\epsilon_v$"), (2, "proximity force [N]", None, ""),
        (4, "contact force [N]", MAX_FORCE, r"$\epsilon_c$"), (5, r"$\|\tau\|$ [N m]", None, ""),
        (6, "distance to the goal [m]", None, ""),
    )  # fmt: skip
    figure, axes = plt.subplots(len(panels), 1, figsize=(7.5, 8.5), sharex=True, layout="constrained")
    edges = [0, *(k for k in range(1, len(time)) if result.stages[k] is not result.stages[k - 1]), len(time)]
    for ax, (column, label, limit, name) in zip(axes, panels):
        for a, b in zip(edges, edges[1:]):
            ax.axvspan(time[a], time[b - 1], color=COLOURS[result.stages[a]], lw=0)
        ax.plot(time, result.log[:, column], color="#27405e", lw=1)
        if limit is not None:
            ax.axhline(limit, color="#c44e52", lw=0.9, ls="--")
            ax.text(time[-1], limit, f" {name}", color="#c44e52", va="bottom", ha="right")
        ax.set_ylabel(label, fontsize=8)
        ax.set_ylim(bottom=0)
    axes[0].set_title("blue: avoid · yellow: push · red: yield", fontsize=9)
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(0, time[-1])
    figure.savefig(path, dpi=110)


def main() -> None:
    """Run all cases; print a table; draw."""
    given = arguments(__doc__).parse_args()
    results, rows = run_all(run, {p: [(p, seed) for seed in range(given.seeds)] for p in POLICIES}, given), []
    for policy, runs in results.items():
        rows.append(
            (
                NAMES[policy],
                count(np.isfinite(r.arrival) for r in runs),
                spread((r.arrival for r in runs), 1),
                spread((r.peak(0, PUSH_TIME) for r in runs), 1),
                spread((r.peak(PUSH_TIME, PUSH_END + 1) for r in runs), 1),
                spread((r.hard(MAX_FORCE) for r in runs), 2),
                spread(r.changes_before_touch for r in runs),
                spread((r.jump for r in runs), 1),
            )
        )
    heads = (
        "controller",
        f"at goal before {PUSH_TIME:g} s",
        "time [s]",
        "largest force before [N]",
        "largest force of the push [N]",
        f"above {MAX_FORCE:g} N [s]",
        "changes of the stage before it touches",
        "largest step of a torque at a change [N m]",
    )
    report(given, heads, rows)
    draw(results[POLICIES[-1]][0], given.out / "planar_arm.png")
    if not given.no_animation:
        arm = PlanarArm(0)
        view = View(arm)
        run(("runtime", 0), view)
        view.save(given.out / "planar_arm.gif")


if __name__ == "__main__":
    main()
