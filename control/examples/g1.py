"""Keep the balance of a Unitree G1 under pushes with the ZMP of skin on its feet (thesis 4.3.1).

    python control/examples/g1.py [--urdf g1_29dof_rev_1_0.urdf] [--seeds 24]

The skin is proposed and fitted by ``skin-calib fit --propose`` and comes into the simulation by ``write_mjcf``. The
robot stands on its full soles, or on a beam under the middle half of them, of which the controller does not know. The
controller is that of eq. 4.27 to 4.29 with the gains of table 2. Its ZMP is felt by the skin, or by simulated
force/torque sensors in the ankles, or not at all. The largest push for 0.1 s that the robot survives is sought as in
``balance.py``.
"""

import argparse
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from balance import DIRECTIONS, LABELS, SEEDS, TABLE_2, draw, largest_push
from biped import (
    COUNTS,
    FORCE_NOISE,
    FULL_SCALE,
    GYRO_NOISE,
    NOISE,
    PERIOD,
    REST,
    TERRAIN_GROUP,
    TILT_NOISE,
    TIME_STEP,
    TORQUE_NOISE,
    mujoco,
    normal_forces,
    proximity_counts,
)
from estimator import ground_wrenches
from experiment import arguments, distances, film_both, report, run_all, spread
from legs import rotation
from shapes import RANGE, RANGE_COUNTS
from zmp_plan import Reference

from skin_calib_addon.calibration import LinkCalibration, Modality, ResponseTable, load_calibration
from skin_calib_addon.calibration.exchange.mjcf import write_mjcf
from skin_calib_addon.cli import main as skin_calib
from skin_calib_addon.runtime import Body, Plane, Skin, convex_hull, zero_moment_point
from skin_calib_addon.runtime.poses import pose_from_mujoco
from skin_calib_addon.runtime.wrench import about
from skin_control.walking import (
    GRAVITY,
    com_velocity_command,
    desired_zmp,
    divergent_component,
    pendulum_frequency,
)

URDF = Path(__file__).resolve().parents[3] / "shared/data/robots/g1_description/g1_29dof_rev_1_0.urdf"
SKIN = "hexagons:8mm"
FEET = ("left_ankle_roll_link", "right_ankle_roll_link")
LEG = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
BENT = {"hip_pitch": -0.3, "knee": 0.6, "ankle_pitch": -0.3}  # at the start [rad]
DOWN = 0.9  # cosine of the angle from straight down, up to which a cell belongs to the underside
STIFFNESS, DAMPING = 1000.0, 20.0  # of the servos [N m/rad, N m s/rad]
BOX_COLOUR, FLOOR_COLOUR = [0.75, 0.6, 0.4, 1], [0.78, 0.8, 0.82, 1]
FRICTION = [0.7, 0.005, 0.0001]  # of cells and floor: MuJoCo takes the larger one [1, m, m]
SOURCES = ("skin", "ankle", "none")
START, PUSH, END = 0.5, 0.1, 4.0  # begin of a push, its duration, and end of a run [s]
FIRST, RESOLUTION = 12.0, 3.0  # push with which the search begins, and interval with which it ends [N s]
UPRIGHT = 0.9  # cosine of the tilt of the pelvis up to which the robot stands
Array = np.ndarray


@dataclass(frozen=True)
class Case:
    """One search for the largest push."""

    urdf: Path
    folder: Path  # of the calibrations
    ground: str
    source: str
    seed: int
    period: float = PERIOD  # of the control [s]
    is_shown: bool = False  # with the meshes of the robot, for an animation

    @property
    def angle(self) -> float:
        """Direction of the push from straight ahead [rad]."""
        return 2 * np.pi * (self.seed % DIRECTIONS) / DIRECTIONS

    @property
    def direction(self) -> Array:
        """Of the push."""
        return np.array((np.cos(self.angle), np.sin(self.angle), 0.0))


@dataclass(frozen=True)
class Result:
    """What came out of a search."""

    survived: float  # largest push [N s]
    off: Array  # distances of the ZMP of the skin from the true one in the runs without a fall [m]
    apart: Array  # and from that of the ankles [m]


def urdf_of_g1(text: str, links: tuple[str, ...] = ()) -> Path:
    """Return the path of the URDF of a G1 that has these links, too; argparse reports what is none."""
    try:
        root = ET.parse(text).getroot()
    except OSError as error:
        raise argparse.ArgumentTypeError(f"cannot read {text}: {error.strerror}") from error
    except ET.ParseError as error:
        raise argparse.ArgumentTypeError(f"{text} is not an XML file: {error}") from error
    joints = [f"{side}_{name}_joint" for side in ("left", "right") for name in LEG]
    for kind, names in {"link": ("pelvis", *FEET, *links), "joint": joints}.items():
        missing = sorted(set(names) - {element.get("name") for element in root.iter(kind)})
        if missing:
            raise argparse.ArgumentTypeError(f"{text} is not the URDF of a G1: it has no {kind} {missing[0]!r}")
    return Path(text)


def with_g1(parser: argparse.ArgumentParser, links: tuple[str, ...] = ()) -> argparse.ArgumentParser:
    """Return a parser with the option for the robot, which must have these links besides pelvis and feet."""
    parser.add_argument(
        "--urdf", type=lambda text: urdf_of_g1(text, links), default=URDF, help="of the G1, with its meshes"
    )
    return parser


def propose(urdf: Path, folder: Path, links: tuple[str, ...] = FEET) -> None:
    """Propose and fit the skins of links; ends the program where there is no robot.

    Skins in the folder are replaced: they can be those of another robot, or of an earlier version of the program.
    """
    if not urdf.exists():
        print(f"skipped: the URDF of the G1 is not at {urdf}. Name it with --urdf.")
        raise SystemExit
    words = ["fit", str(urdf), "--propose", "--again", "-o", str(folder), "--skin", SKIN]
    if skin_calib([*words, *(word for link in links for word in ("--only", link))]):
        raise SystemExit("the skins could not be fitted; see above")


def skeleton(urdf: Path, is_shown: bool = False) -> mujoco.MjSpec:
    """Return the robot free to move, without shapes; if it is to be shown, with its meshes, which touch nothing."""
    tree = ET.parse(urdf)
    for link in tree.iter("link"):
        for shape in [*(() if is_shown else link.findall("visual")), *link.findall("collision")]:
            link.remove(shape)
    root = tree.getroot()
    for settings in root.findall("mujoco"):
        root.remove(settings)
    settings = {"fusestatic": "false", "discardvisual": "false", "strippath": "false", "meshdir": str(urdf.parent)}
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", settings)
    spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = geom.mass = 0
        geom.group = 1
    if is_shown:
        sky = {"type": mujoco.mjtTexture.mjTEXTURE_SKYBOX, "builtin": mujoco.mjtBuiltin.mjBUILTIN_GRADIENT}
        spec.add_texture(name="sky", **sky, rgb1=[0.95, 0.97, 1], rgb2=[0.7, 0.78, 0.9], width=64, height=64)
        spec.worldbody.add_light(pos=[1, -1.5, 3], dir=[-0.3, 0.5, -1], diffuse=[0.8] * 3)
    pelvis = spec.body("pelvis")
    if not pelvis.joints:
        pelvis.add_freejoint()
    for joint in spec.joints:
        if joint.type == mujoco.mjtJoint.mjJNT_HINGE:
            joint.armature = 0.03
    spec.option.timestep, spec.option.integrator = TIME_STEP, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 3
    return spec


def with_proximity(calibration: LinkCalibration, ids: Iterable[str]) -> LinkCalibration:
    """Return a calibration whose taxels with these ids measure distances, too."""
    response = ResponseTable((0.0, RANGE_COUNTS), (RANGE, 0.0))
    channels = {str(id): channel for channel, id in enumerate(ids)}
    return replace(calibration, modalities=(Modality("proximity", "m", response, channels),))


@cache
def nominal(urdf: Path) -> mujoco.MjModel:
    """Return what the controller knows: masses and lengths."""
    return skeleton(urdf).compile()


@dataclass(frozen=True)
class Box:
    """A part of the ground."""

    centre: tuple[float, float, float]  # [m]
    half: tuple[float, float, float]  # size [m]
    name: str = ""  # of a box that the experimenter can move


@dataclass(frozen=True)
class Terrain:
    """A floor and boxes."""

    floor: float = 0.0  # height [m]
    boxes: tuple[Box, ...] = ()

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Add the ground to a model."""
        ground = {"group": TERRAIN_GROUP, "friction": FRICTION, "contype": 2, "conaffinity": 1}
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 0.1], pos=[0, 0, self.floor], rgba=FLOOR_COLOUR, **ground
        )
        for box in self.boxes:
            body = spec.worldbody.add_body(name=box.name, pos=box.centre, mocap=bool(box.name))
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=box.half, rgba=BOX_COLOUR, **ground)


# Half sole: a beam under the middle half of both soles, which are 190 mm long with their cells.
GROUND = {"full sole": Terrain(), "half sole": Terrain(-0.06, (Box((0.047, 0.0, -0.03), (0.0475, 0.3, 0.03)),))}


def build(urdf: Path, folder: Path, terrain: Terrain = Terrain(), is_shown: bool = False) -> mujoco.MjModel:
    """Return the robot with servos, sensors, the skins of its feet and the ground."""
    spec = skeleton(urdf, is_shown)
    for joint in spec.joints:
        if joint.type == mujoco.mjtJoint.mjJNT_HINGE:
            servo = spec.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            servo.set_to_position(kp=STIFFNESS, kv=DAMPING)
    for foot in FEET:
        spec.body(foot).add_site(name=foot)
        for kind in (mujoco.mjtSensor.mjSENS_FORCE, mujoco.mjtSensor.mjSENS_TORQUE):
            name = f"{foot} {'force' if kind == mujoco.mjtSensor.mjSENS_FORCE else 'torque'}"
            spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=foot)
        skin = mujoco.MjSpec.from_string(write_mjcf(load_calibration(folder / f"{foot}.calibration.json")).decode())
        for sensor in list(skin.sensors):
            skin.delete(sensor)  # G1 sums the contacts of each cell
        for geom in list(skin.body(foot).geoms):
            if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
                skin.delete(geom)
            else:
                geom.solref, geom.friction = [0.008, 1], FRICTION
                geom.contype, geom.conaffinity = 1, 2  # cells touch the floor, not each other
        spec.body(foot).add_frame().attach_body(skin.body(foot), f"{foot}/", "")
    terrain.add_to(spec)
    return spec.compile()


def start(model: mujoco.MjModel, height: float) -> Array:
    """Return the angles and the position of the robot with bent knees; the ankles are at a height [m]."""
    data = mujoco.MjData(model)
    for side in ("left", "right"):
        for name, angle in BENT.items():
            data.joint(f"{side}_{name}_joint").qpos[:] = angle
    mujoco.mj_kinematics(model, data)
    data.qpos[2] += height - data.body(FEET[0]).xpos[2]
    return data.qpos.copy()


@dataclass(frozen=True)
class Senses:
    """What the controller gets in one cycle."""

    time: float  # [s]
    joints: Array  # angles [rad]
    velocities: Array  # [rad/s]
    turn: Array  # (3, 3) of the pelvis, by the inertial unit
    gyro: Array  # (3,) [rad/s]
    readings: dict[str, dict[str, Array]]  # of the skins by modality [N, count]
    ankles: dict[str, Array]  # (6,) wrench of each foot on its leg about the ankle, in the frame of the foot [N, N m]


class G1:
    """The simulated robot.

    Parameters
    ----------
    urdf, folder : path
        Of the robot, and of the calibrations of its feet.
    seed : int
        Of the noise.
    proximity : bool
        Whether the cells below the feet measure distances, too.
    terrain : Terrain
        The ground.
    period : float
        Of the control cycle [s], a multiple of ``TIME_STEP``.
    is_shown : bool
        Whether the model has the meshes of the robot.
    """

    foot_bodies = dict(zip(FEET, FEET))

    def __init__(
        self,
        urdf: Path,
        folder: Path,
        seed: int,
        proximity: bool = False,
        terrain: Terrain = Terrain(),
        period: float = PERIOD,
        is_shown: bool = False,
    ):
        self.period = period
        self.model = build(urdf, folder, terrain, is_shown)
        self.data, self.rng = mujoco.MjData(self.model), np.random.default_rng(seed)
        skins, self.cells, self.near = {}, {}, {}
        for foot in FEET:
            calibration = load_calibration(folder / f"{foot}.calibration.json")
            positions, normals, ids = (
                np.concatenate([getattr(patch.taxels, name) for patch in calibration.patches])
                for name in ("positions_link", "normals_link", "ids")
            )
            is_below = normals[:, 2] < -DOWN
            self.sole = float(positions[is_below, 2].min())  # height of the lowest cells [m]
            if proximity:
                calibration = with_proximity(calibration, ids[is_below])
                self.near[foot] = np.array([self.model.site(f"{foot}/{id}").id for id in ids[is_below]])
            # Skin around a foot has no plane of its own.
            skins[foot] = skin = Skin(calibration, ground=Plane.through((0, 0, self.sole), (0, 0, 1)))
            body = self.model.body(f"{foot}/{foot}").id
            self.cells[foot] = self.model.body_geomadr[body] + np.arange(len(skin.ids))
        self.body = Body(skins)
        self.late: tuple[dict[str, dict[str, Array]], dict[str, Array]] | None = None
        self.peaks: dict[str, float] = {}  # largest true force on each foot, as of Biped [N]
        for skin in skins.values():
            skin.tare(np.stack([self._noisy(np.zeros(skin.reading_length)) for _ in range(REST)]), accept=True)
        self.start = start(self.model, -self.sole)
        self.data.qpos[:] = self.start
        self.data.ctrl[:] = self.start[7:]
        mujoco.mj_forward(self.model, self.data)

    def senses(self) -> Senses:
        """Return what the sensors deliver; skins and ankles are one cycle late."""
        data, normal, readings = self.data, self.rng.normal, {}
        on_geoms = normal_forces(self.model, data)
        for foot, skin in self.body.skins.items():
            forces = np.zeros(skin.reading_length)
            forces[skin.channels] = on_geoms[self.cells[foot]]
            readings[foot] = {"force": self._noisy(forces)}
        for foot, sites in self.near.items():
            noise = normal(0, NOISE, len(sites))
            readings[foot]["proximity"] = proximity_counts(self.model, data, sites, f"{foot}/{foot}", noise)
        ankles = {}
        for foot in FEET:
            force, torque = (data.sensor(f"{foot} {kind}").data for kind in ("force", "torque"))
            ankles[foot] = np.concatenate((-force - normal(0, FORCE_NOISE, 3), -torque - normal(0, TORQUE_NOISE, 3)))
        now, self.late = self.late or (readings, ankles), (readings, ankles)
        turn = data.body("pelvis").xmat.reshape(3, 3)
        for axis in range(3):
            turn = turn @ rotation(axis, normal(0, TILT_NOISE))
        gyro = data.qvel[3:6] + normal(0, GYRO_NOISE, 3)
        return Senses(data.time, data.qpos[7:].copy(), data.qvel[6:].copy(), turn, gyro, *now)

    def step(self, targets: Array, torques: Array, push: Array | None = None) -> None:
        """Simulate one cycle with angles and additional torques of the servos, and a force (3,) on the pelvis [N]."""
        self.data.ctrl[:] = targets + torques / STIFFNESS
        self.data.xfrc_applied[self.model.body("pelvis").id, :3] = 0 if push is None else push
        for _ in range(round(self.period / TIME_STEP)):
            mujoco.mj_step(self.model, self.data)
            for foot in self.peaks:
                load = float(normal_forces(self.model, self.data)[self.cells[foot]].sum())
                self.peaks[foot] = max(self.peaks[foot], load)

    def _noisy(self, forces: Array) -> Array:
        step = FULL_SCALE / COUNTS  # of 12 bits [N]
        return step * np.round(1.0 / step + forces / step + self.rng.normal(0, NOISE, forces.shape)).clip(0, COUNTS)

    # The truth, for judging.

    @property
    def stands(self) -> bool:
        """Whether the pelvis is high and upright."""
        return bool(self.data.qpos[2] > 0.8 * self.start[2] and self.data.body("pelvis").xmat[8] > UPRIGHT)

    def true_zmp(self) -> Array:
        """Return the point (2,) of the floor about which its forces have no moment along it [m]."""
        total = np.zeros(6)
        for k, contact in enumerate(self.data.contact):
            force = np.zeros(6)
            mujoco.mj_contactForce(self.model, self.data, k, force)
            force = contact.frame.reshape(3, 3).T @ force[:3]
            if self.model.geom_group[contact.geom[1]] == TERRAIN_GROUP:  # the force is that on the second geom
                force = -force
            total += np.concatenate((force, np.cross(contact.pos, force)))
        return np.array((-total[4], total[3])) / total[2] if abs(total[2]) > 1 else np.full(2, np.nan)


class Balancer:
    """Keeps the balance on two feet that stand where they are.

    Parameters
    ----------
    robot : G1
        Its skins, its start and its period; nothing else of it is used.
    urdf : path
        Of the robot.
    source : str
        What feels the ZMP: ``"skin"``, ``"ankle"``, or ``"none"`` for no feedback of it.
    """

    def __init__(self, robot: G1, urdf: Path, source: str):
        self.model, self.body, self.source, self.period = nominal(urdf), robot.body, source, robot.period
        self.data, self.planned = mujoco.MjData(self.model), mujoco.MjData(self.model)
        self.feet = {foot: self.model.body(foot).id for foot in FEET}
        self.pelvis = self.model.body("pelvis").id
        self.planned.qpos[:] = robot.start
        self._kinematics(self.planned)
        self.anchors = {foot: self.planned.xpos[k].copy() for foot, k in self.feet.items()}
        self.mass = float(self.model.body_subtreemass[0])
        self.height = float(self.planned.subtree_com[0][2])
        self.omega = pendulum_frequency(self.height)
        self.soles = {
            foot: convex_hull(skin.positions[skin.normals[:, 2] < -DOWN, :2]) for foot, skin in self.body.skins.items()
        }
        self.stand_on(FEET)
        self.goal = self.polygon.centroid  # of the CoM
        self.reference = Reference(self.goal, self.goal)
        self.com = self.planned.subtree_com[0][:2].copy()
        self.tilts = {foot: np.zeros(2) for foot in FEET}
        legs = [self.model.joint(f"{side}_{name}_joint").dofadr[0] for side in ("left", "right") for name in LEG]
        self.free = [*range(6), *legs]  # what the feet, the CoM and the rotation of the pelvis determine

    def stand_on(self, feet: tuple[str, ...]) -> None:
        """Take these feet as standing on their anchors."""
        self.standing = feet
        corners = [self.soles[foot].corners + self.anchors[foot][:2] for foot in feet]
        self.polygon = convex_hull(np.concatenate(corners)).inset(TABLE_2.margin)

    def cycle(self, senses: Senses) -> tuple[Array, Array, Array, Array]:
        """Return targets and torques of the servos, and the ZMPs (2,) by the skins and by the ankles [m]."""
        com, velocity = self._estimate(senses)
        poses = {foot: pose_from_mujoco(self.data.xpos[k], self.data.xmat[k]) for foot, k in self.feet.items()}
        frame = self.frame = self.body.update(senses.readings, senses.time, poses)
        skin = np.full(2, np.nan) if frame.zmp is None else frame.zmp
        ankle, wrenches = self._by_ankles(senses)
        dcm = divergent_component(com[:2], velocity[:2], self.omega)
        wanted = self.polygon.closest(desired_zmp(self.reference.zmp, self.reference.dcm, dcm, TABLE_2.dcm, self.omega))
        zmp = {"skin": skin, "ankle": ankle, "none": wanted}[self.source]
        if np.isfinite(zmp).all():
            speed = com_velocity_command(zmp, wanted, self.com, self.goal, TABLE_2.zmp, TABLE_2.com)
            self.com = self.com + speed * self.period
        self._tilt(wanted, frame, wrenches)
        self._solve()
        return self.planned.qpos[7:].copy(), self._torques(wanted), skin, ankle

    def _kinematics(self, data: mujoco.MjData) -> None:
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_comPos(self.model, data)

    def _estimate(self, senses: Senses) -> tuple[Array, Array]:
        """Return position and velocity (3,) of the CoM; both feet stand on their anchors."""
        model, data = self.model, self.data
        data.qpos[:3] = 0
        mujoco.mju_mat2Quat(data.qpos[3:7], senses.turn.ravel())
        data.qpos[7:] = senses.joints
        self._kinematics(data)
        standing = [self.feet[foot] for foot in self.standing]
        data.qpos[:3] = np.mean([self.anchors[foot] - data.xpos[self.feet[foot]] for foot in self.standing], axis=0)
        self._kinematics(data)
        rates = np.concatenate((np.zeros(3), senses.gyro, senses.velocities))
        jacobian = np.zeros((3, model.nv))
        for k in standing:
            mujoco.mj_jacBody(model, data, jacobian, None, k)
            rates[:3] -= jacobian[:, 3:] @ rates[3:] / len(standing)
        mujoco.mj_jacSubtreeCom(model, data, jacobian, 0)
        return data.subtree_com[0].copy(), jacobian @ rates

    def _by_ankles(self, senses: Senses) -> tuple[Array, dict[str, Array]]:
        """Return the ZMP (2,), and the wrench (6,) of the ground on each foot about its ankle, in the world."""
        found = ground_wrenches(self.model, self.data, self.feet, senses.ankles)
        total = np.sum([about(wrench, -self.data.xpos[self.feet[foot]]) for foot, wrench in found.items()], axis=0)
        zmp = zero_moment_point(total) if total[2] > 1 else None
        return np.full(2, np.nan) if zmp is None else zmp, found

    def _tilt(self, wanted: Array, frame, wrenches: dict[str, Array]) -> None:
        """Turn the soles so that their CoPs go to the desired ZMP."""
        for foot in FEET:
            self.tilts[foot] = self.tilts[foot] * (1 - self.period / TABLE_2.leak)
            load, cop = 0.0, None
            if self.source == "skin" and foot in frame.links and frame.links[foot].cop is not None:
                load, cop = frame.links[foot].load, frame.links[foot].cop
            elif self.source == "ankle" and wrenches[foot][2] > 5:
                load, cop = wrenches[foot][2], zero_moment_point(wrenches[foot])
            if cop is None or foot not in self.standing:
                continue
            goal = self.soles[foot].inset(TABLE_2.margin).closest(wanted - self.anchors[foot][:2])
            moment = load * (goal - cop)
            self.tilts[foot] = self.tilts[foot] + TABLE_2.ankle * self.period * np.array((-moment[1], moment[0]))

    def _solve(self) -> None:
        """Move the planned posture by one Newton step to the CoM, upright, with the feet on their anchors."""
        model, data = self.model, self.planned
        rows, errors = [], []
        position, turning = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        for foot, k in self.feet.items():
            roll, pitch = self.tilts[foot]
            mujoco.mj_jacBody(model, data, position, turning, k)
            rows += [position.copy(), turning.copy()]
            turn = rotation(1, pitch) @ rotation(0, roll)
            errors += [self.anchors[foot] - data.xpos[k], _turn_between(data.xmat[k].reshape(3, 3), turn)]
        mujoco.mj_jacBody(model, data, None, turning, self.pelvis)
        rows.append(turning.copy())
        errors.append(_turn_between(data.xmat[self.pelvis].reshape(3, 3), np.eye(3)))
        mujoco.mj_jacSubtreeCom(model, data, position, 0)
        rows.append(position.copy())
        errors.append(np.array((*self.com, self.height)) - data.subtree_com[0])
        change = np.zeros(model.nv)
        change[self.free] = np.linalg.solve(np.concatenate(rows)[:, self.free], np.concatenate(errors))
        mujoco.mj_integratePos(model, data.qpos, change, 1.0)
        self._kinematics(data)

    def _torques(self, wanted: Array) -> Array:
        """Return the torques of the joints that hold the robot at rest with the ground's force at the desired ZMP."""
        bias, jacobian = np.zeros(self.model.nv), np.zeros((3, self.model.nv))
        self.data.qvel[:] = 0
        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_rne(self.model, self.data, 0, bias)
        points, parts = [self.anchors[foot][:2] + self.soles[foot].centroid for foot in self.standing], [1.0]
        if len(points) == 2:
            a, b = points
            part = float(np.clip((wanted - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1))
            parts = [1 - part, part]
        away = wanted - sum(part * point for part, point in zip(parts, points))
        for foot, fraction, place in zip(self.standing, parts, points):
            mujoco.mj_jac(self.model, self.data, jacobian, None, np.array((*(place + away), 0.0)), self.feet[foot])
            bias -= jacobian.T @ np.array((0, 0, fraction * self.mass * GRAVITY))
        return bias[6:]


def _turn_between(now: Array, wanted: Array) -> Array:
    """Return the rotation vector (3,) in the world that turns one small rotation into another [rad]."""
    off = wanted @ now.T
    return np.array((off[2, 1] - off[1, 2], off[0, 2] - off[2, 0], off[1, 0] - off[0, 1])) / 2


def push(case: Case, impulse: float, each: Callable[[G1], None] | None = None) -> tuple[bool, Array]:
    """Return whether the robot stands after a push [N s], and the ZMPs (n, 3, 2): by skin, by ankles, true [m].

    The true ones are as old as what the sensors deliver.
    """
    terrain = GROUND[case.ground]
    robot = G1(case.urdf, case.folder, case.seed, terrain=terrain, period=case.period, is_shown=case.is_shown)
    balancer, rows, late = Balancer(robot, case.urdf, case.source), [], np.full(2, np.nan)
    while robot.data.time < END and robot.stands:
        senses, true = robot.senses(), robot.true_zmp()
        *commands, skin, ankle = balancer.cycle(senses)
        pushes = START <= senses.time < START + PUSH - case.period / 2
        robot.step(*commands, case.direction * impulse / PUSH if pushes else None)
        rows.append((skin, ankle, late))
        late = true
        if each:
            each(robot)
    return robot.stands, np.array(rows[round(START / 2 / case.period) :])


def run(case: Case) -> Result:
    """Search for the largest push."""
    off, apart = [np.zeros(0)], [np.zeros(0)]

    def survives(impulse: float) -> bool:
        stands, zmps = push(case, impulse)
        if stands:
            off.append(np.linalg.norm(zmps[:, 0] - zmps[:, 2], axis=1))
            apart.append(np.linalg.norm(zmps[:, 0] - zmps[:, 1], axis=1))
        return stands

    survived = largest_push(survives, FIRST, RESOLUTION)
    return Result(survived, np.concatenate(off), np.concatenate(apart))


def main() -> None:
    """Run all cases; print a table; draw."""
    given = with_g1(arguments(__doc__, seeds=SEEDS)).parse_args()
    folder = given.out / "g1"
    propose(given.urdf, folder)
    kinds = [(ground, source) for ground in GROUND for source in SOURCES]
    cases = {kind: [Case(given.urdf, folder, *kind, seed) for seed in range(given.seeds)] for kind in kinds}
    results = run_all(run, cases, given)
    rows = []
    for (ground, source), runs in results.items():
        texts = []
        for name in ("apart", "off"):
            texts.append(distances(getattr(r, name) for r in runs))
        used = LABELS[source].removeprefix("ZMP by ")
        rows.append((ground, used, f"{spread([r.survived for r in runs], 1)}, steps of {RESOLUTION:g}", *texts))
    distance = "mean / 95 % / maximum [mm]"
    heads = ("largest push survived [N s]", f"skin to ankles, {distance}", f"skin to truth, {distance}")
    report(given, ("contact", "ZMP by", *heads), rows)
    draw(results, cases, given.out / "g1.png")
    if not given.no_animation:
        shown = [replace(cases[ground, "skin"][0], is_shown=True) for ground in GROUND]
        films = [
            lambda each, case=case: push(case, max(results[case.ground, "skin"][0].survived, 1.0), each)
            for case in shown
        ]
        film_both(films, given.out / "g1.gif", azimuth=90)


if __name__ == "__main__":
    main()
