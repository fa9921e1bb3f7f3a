"""A small humanoid with skin on its soles and one forearm, simulated by MuJoCo, and what its sensors deliver.

Twelve joints in the legs, seven in one arm. The shapes are primitive; the skins are calibrations of our own fits, and
come into the model by ``write_mjcf``, as of ``skin-calib export --to mjcf``. The pad below each taxel becomes a sphere,
and the reading of the taxel is the sum of the normal forces on it. The exported touch sensors are not read here: those
of the soles are deleted. Only ``arm.py`` reads those of the forearm. A controller gets a :class:`Senses` in each cycle:
joints, inertial unit and the readings of the skins, with 12 bits, noise and latency. It never sees the simulator.
"""

import os
from collections import deque
from dataclasses import dataclass
from functools import cache

os.environ.setdefault("MUJOCO_GL", "egl")  # draws without a display
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")  # matrices are small, and runs with other seeds go side by side

import numpy as np  # noqa: E402

try:
    import mujoco
except ModuleNotFoundError as error:
    raise SystemExit(f"{error}. Install it with: pip install -e . -e './control[experiments]'") from error

from shapes import ANKLE_HEIGHT, COUNTS, FULL_SCALE, HERE, RANGE, RANGE_COUNTS  # noqa: E402
from shapes import main as make_shapes  # noqa: E402

from skin_calib_addon.calibration import LinkCalibration  # noqa: E402
from skin_calib_addon.calibration.exchange.mjcf import write_mjcf  # noqa: E402
from skin_calib_addon.pipeline import calibrate  # noqa: E402
from skin_calib_addon.plan import load_plan  # noqa: E402
from skin_calib_addon.runtime import Body, Skin  # noqa: E402

FEET = ("left", "right")
SOLES = ("left_foot", "right_foot")
LINKS = {"left_foot": "sole", "right_foot": "sole", "forearm": "forearm"}
SIDE = {"left": 1.0, "right": -1.0}
HIP_WIDTH, HIP_DROP = 0.09, 0.06  # of a hip from the middle, below the pelvis [m]
THIGH = SHANK = 0.36  # [m]
PAD_RADIUS = 0.004  # of the sphere below each taxel of a sole [m]
FOREARM_PAD = 0.006  # radius of the sphere below each taxel of the forearm [m]
FOAM = 0.01  # time constant of a contact with the forearm's skin [s]
STIFFNESS, DAMPING = 2000.0, 40.0  # of the servos [N m/rad, N m s/rad]
TIME_STEP = 1e-3  # of the simulation [s]
PERIOD = 4e-3  # of the control cycle, in which the skins are read once [s]
OFFSET = 40  # reading of a free taxel [count]
NOISE = 2.0  # standard deviation [count]
LATENCY = 1  # cycles that readings are late
REST = 250  # frames at rest from which the noise is learned
GYRO_NOISE, TILT_NOISE = 0.005, 0.0005  # standard deviations [rad/s, rad]
FORCE_NOISE, TORQUE_NOISE = 1.0, 0.05  # standard deviations of the force/torque sensors in the ankles [N, N m]
RECESS = 0.005  # of the start of a proximity sensor's ray in the sole [m]
TERRAIN_GROUP = 3  # of the geoms that proximity sensors see
ARM = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "forearm_yaw", "wrist_pitch", "wrist_roll")
LEG = ("hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll")
AXES = {"yaw": "0 0 1", "roll": "1 0 0", "pitch": "0 1 0"}
Array = np.ndarray


def _joint(name: str, axis: str, low: float, high: float) -> str:
    return f'<joint name="{name}" axis="{AXES[axis]}" range="{low} {high}"/>'


def _leg(side: str) -> str:
    y = SIDE[side] * HIP_WIDTH
    return f"""
    <body name="{side}_hip_yaw" pos="0 {y} {-HIP_DROP}">
     {_joint(f"{side}_hip_yaw", "yaw", -1, 1)}<geom class="body" type="sphere" size=".04" mass=".6"/>
     <body name="{side}_hip_roll">
      {_joint(f"{side}_hip_roll", "roll", -0.8, 0.8)}<geom class="body" type="sphere" size=".035" mass=".6"/>
      <body name="{side}_thigh">
       {_joint(f"{side}_hip_pitch", "pitch", -1.9, 1)}
       <geom class="body" type="capsule" fromto="0 0 -.04 0 0 {0.03 - THIGH}" size=".045" mass="3"/>
       <body name="{side}_shank" pos="0 0 {-THIGH}">
        {_joint(f"{side}_knee", "pitch", 0, 2.4)}
        <geom class="body" type="capsule" fromto="0 0 -.03 0 0 {0.04 - SHANK}" size=".036" mass="2"/>
        <body name="{side}_ankle" pos="0 0 {-SHANK}">
         {_joint(f"{side}_ankle_pitch", "pitch", -1.2, 1)}<geom class="body" type="sphere" size=".025" mass=".3"/>
         <body name="{side}_foot">
          {_joint(f"{side}_ankle_roll", "roll", -0.7, 0.7)}
          <geom class="body" type="box" size=".09 .04 .015" pos=".02 0 {0.022 - ANKLE_HEIGHT}" mass=".8"/>
          <site name="{side}_ankle"/>
         </body>
        </body>
       </body>
      </body>
     </body>
    </body>"""


def _arm() -> str:
    return f"""
    <body name="shoulder" pos="0 .17 .33">
     {_joint("shoulder_pitch", "pitch", -2.5, 2.5)}<geom class="body" type="sphere" size=".045" mass=".4"/>
     <body name="shoulder_roll">
      {_joint("shoulder_roll", "roll", -0.3, 2.5)}<geom class="body" type="sphere" size=".04" mass=".3"/>
      <body name="upper_arm">
       {_joint("shoulder_yaw", "yaw", -2, 2)}
       <geom class="body" type="capsule" fromto="0 0 -.04 0 0 -.2" size=".035" mass="1"/>
       <body name="forearm" pos="0 0 -.24">
        {_joint("elbow", "pitch", -2.3, 0.1)}
        <geom class="body" type="capsule" fromto="0 0 -.02 0 0 -.22" size=".026" mass=".7"/>
        <body name="wrist" pos="0 0 -.25">
         {_joint("forearm_yaw", "yaw", -2, 2)}<geom class="body" type="sphere" size=".026" mass=".1"/>
         <body name="hand_pitch">
          {_joint("wrist_pitch", "pitch", -1, 1)}<geom class="body" type="sphere" size=".025" mass=".1"/>
          <body name="hand">
           {_joint("wrist_roll", "roll", -1, 1)}
           <geom class="body" type="ellipsoid" size=".02 .04 .06" pos="0 0 -.06" mass=".3"/>
           <site name="hand" pos="0 0 -.1"/>
          </body>
         </body>
        </body>
       </body>
      </body>
     </body>
    </body>"""


def _robot(terrain: str, friction: float) -> str:
    """Return the model without skins."""
    joints = [f"{side}_{name}" for side in FEET for name in LEG] + list(ARM)
    servos = [
        f'<position name="{name}" joint="{name}" kp="{kp}" kv="{kp * DAMPING / STIFFNESS}"/>'
        for name in joints
        for kp in (STIFFNESS if name not in ARM else 200.0,)
    ]
    return f"""
  <mujoco model="biped">
   <compiler angle="radian"/>
   <option timestep="{TIME_STEP}" integrator="implicitfast" cone="elliptic" impratio="3" jacobian="sparse"/>
   <statistic center="0 0 .6" extent="1.6"/>
   <visual><global offwidth="960" offheight="720"/><quality shadowsize="2048"/></visual>
   <asset>
    <texture name="sky" type="skybox" builtin="gradient" rgb1=".95 .97 1" rgb2=".7 .78 .9" width="64" height="64"/>
    <texture name="tiles" type="2d" builtin="checker" rgb1=".78 .8 .82" rgb2=".7 .72 .75" width="128" height="128"/>
    <material name="tiles" texture="tiles" texrepeat="10 10"/>
   </asset>
   <default>
    <joint armature=".05" limited="true"/>
    <default class="body"><geom contype="0" conaffinity="0" rgba=".32 .38 .48 1" group="1"/></default>
    <default class="terrain">
     <geom friction="{friction}" group="{TERRAIN_GROUP}" rgba=".75 .6 .4 1" condim="3" solref=".008 1"/>
    </default>
   </default>
   <worldbody>
    <light pos="1 -1.5 3" dir="-.3 .5 -1" diffuse=".8 .8 .8"/><light pos="-2 2 3" dir=".5 -.5 -1" diffuse=".3 .3 .3"/>
    {terrain}
    <body name="pelvis" pos="0 0 {START_HEIGHT}">
     <freejoint name="base"/>
     <geom class="body" type="box" size=".06 .11 .05" mass="5"/>
     <geom class="body" type="box" size=".07 .12 .14" pos="0 0 .21" mass="11"/>
     <geom class="body" type="sphere" size=".07" pos="0 0 .45" mass="1.5"/>
     <site name="imu"/>
     {_leg("left")}{_leg("right")}{_arm()}
    </body>
   </worldbody>
   <actuator>{"".join(servos)}</actuator>
   <sensor>
    <framequat name="orientation" objtype="site" objname="imu"/><gyro name="gyro" site="imu"/>
    <force name="left_force" site="left_ankle"/><torque name="left_torque" site="left_ankle"/>
    <force name="right_force" site="right_ankle"/><torque name="right_torque" site="right_ankle"/>
   </sensor>
  </mujoco>"""


KNEE = 0.5  # bent at the start [rad]
LEG_LENGTH = float(2 * THIGH * np.cos(KNEE / 2))
START_HEIGHT = HIP_DROP + LEG_LENGTH + ANKLE_HEIGHT
FLAT = '<geom class="terrain" type="plane" size="10 10 .1" material="tiles" rgba="1 1 1 1"/>'


@cache
def skins() -> dict[str, LinkCalibration]:
    """Return the calibrations of sole and forearm, from the plans in ``robot/``."""
    if not (HERE / "sole.plan.json").exists():
        make_shapes()
    return {name: calibrate(load_plan(HERE / f"{name}.plan.json")).calibration for name in ("sole", "forearm")}


def nominal() -> mujoco.MjModel:
    """Return the model that a controller knows: masses and lengths, without skins and terrain."""
    return mujoco.MjModel.from_xml_string(_robot("", 1.0))


def build(terrain: str = FLAT, friction: float = 0.7, covered: tuple[str, ...] = SOLES) -> mujoco.MjModel:
    """Return the model of robot and terrain.

    Parameters
    ----------
    terrain : str
        Geoms of MJCF with ``class="terrain"``.
    friction : float
        Between soles and terrain.
    covered : tuple of str
        Bodies with a skin.
    """
    spec = mujoco.MjSpec.from_string(_robot(terrain, friction))
    for body in covered:
        link = LINKS[body]
        skin = mujoco.MjSpec.from_string(write_mjcf(skins()[link]).decode())
        for sensor in list(skin.sensors):
            # Biped sums the contacts of the pads itself: 170 touch sensors take a fifth of the time of a simulation.
            if sensor.type == mujoco.mjtSensor.mjSENS_TACTILE or link == "sole":
                skin.delete(sensor)
        if link == "forearm":
            round_pads(skin, skins()[link], friction)
        for geom in list(skin.body(link).geoms) if link == "sole" else []:
            if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
                skin.delete(geom)
            else:  # a sphere has one contact with the ground where a box has four
                geom.type, geom.size = mujoco.mjtGeom.mjGEOM_SPHERE, [PAD_RADIUS, 0, 0]
                geom.pos = [*geom.pos[:2], -ANKLE_HEIGHT + PAD_RADIUS]
                geom.priority, geom.condim, geom.friction = 0, 3, [friction, 0.005, 0.0001]
                geom.rgba = [0.1, 0.6, 0.3, 1]
        spec.body(body).add_frame().attach_body(skin.body(link), f"{body}/", "")
    return spec.compile()


def normal_forces(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Return the sum of the normal forces on each geom [N]."""
    rows, forces = data.contact.efc_address, data.efc_force
    normal = np.where(rows >= 0, forces[rows], 0.0) if len(forces) else np.zeros(len(rows))
    return np.bincount(data.contact.geom.ravel(), np.repeat(normal, 2), model.ngeom)


def force_counts(force: Array, full_scale: float, noise: Array) -> Array:
    """Return the readings (n,) of taxels with 12 bits [count], for forces (n,) [N] and noise (n,) [count].

    The highest count is that of the force ``full_scale`` [N].
    """
    return np.clip(np.rint(OFFSET + force * COUNTS / full_scale + noise), 0, COUNTS)


def proximity_counts(model: mujoco.MjModel, data: mujoco.MjData, sites: Array, body: str, noise: Array) -> Array:
    """Return the readings (n,) of proximity sensors at sites of a body [count]; zero if no terrain is in range.

    A pressed sensor is a little below the surface, where a ray would start in the ground. It starts in the sole, whose
    own pads it does not see.
    """
    group, found = np.zeros(6, np.uint8), np.zeros(1, np.int32)
    group[TERRAIN_GROUP] = 1
    outward = data.site_xmat[sites].reshape(-1, 3, 3)[:, :, 2]
    rays, own = zip(data.site_xpos[sites] - RECESS * outward, outward), model.body(body).id
    distances = np.array([mujoco.mj_ray(model, data, *ray, group, 1, own, found) for ray in rays])
    distances = np.where(distances >= 0, np.maximum(distances - RECESS, 0.0), distances)
    counts = RANGE_COUNTS * (1 - distances / RANGE) + noise
    in_range = (distances >= 0) & (distances <= RANGE)
    return np.where(in_range, np.clip(np.rint(counts), 0, RANGE_COUNTS), 0.0)


def round_pads(skin: mujoco.MjSpec, calibration: LinkCalibration, friction: float) -> None:
    """Replace the cells of an exported skin of an arm by spheres below the taxels: small things pass a thin box."""
    taxels = [patch.taxels for patch in calibration.patches]
    pads = (p - FOREARM_PAD * n for t in taxels for p, n in zip(t.positions_link, t.normals_link))
    for geom in list(skin.body(calibration.link).geoms):
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
            skin.delete(geom)
        else:
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_SPHERE, [FOREARM_PAD, 0, 0]
            geom.pos = next(pads)
            geom.solref, geom.group, geom.rgba = [FOAM, 1], 1, [0.1, 0.6, 0.3, 1]
            geom.priority, geom.condim, geom.friction = 1, 3, [friction, 0.005, 0.0001]


@dataclass(frozen=True)
class Faults:
    """What is wrong with the sensors."""

    sensitivity: float = 0.0  # standard deviation of the sensitivity of a cell, relative to the calibration
    since: float = 0.0  # time from which on the following is wrong [s]
    noise: float = NOISE  # standard deviation of a reading [count]
    latency: int = LATENCY  # cycles that the readings of skins and of ankles are late
    dead: tuple[int, ...] = ()  # taxels of the left sole that read zero
    lost: str | None = None  # the body whose readings do not arrive
    is_frozen: bool = False  # whether all readings of the left sole stay the same


@dataclass(frozen=True)
class Senses:
    """What a controller gets in one cycle."""

    time: float  # [s]
    joints: Array  # (19,) angles [rad]
    velocities: Array  # (19,) [rad/s]
    rotation: Array  # (3, 3) of the pelvis in the world, by the inertial unit
    gyro: Array  # (3,) of the pelvis, in its frame [rad/s]
    readings: dict[str, dict[str, Array]]  # of the skins by body and modality [count]
    ankles: dict[str, Array]  # (6,) wrench of each foot on its leg about the ankle, in the foot's frame [N, N m]


class Biped:
    """The simulated robot.

    Parameters
    ----------
    terrain : str
        As for :func:`build`.
    seed : int
        Of the noise of all sensors.
    faults : Faults
        Of the sensors.
    friction : float
        As for :func:`build`.
    covered : tuple of str
        The skins that are read: those of ``left_foot``, ``right_foot`` and ``forearm``.
    proximity : bool
        Whether their proximity sensors are read, too.
    period : float
        Of the control cycle [s], a multiple of ``TIME_STEP``.
    """

    foot_bodies = {foot: f"{foot}_foot" for foot in FEET}

    def __init__(
        self,
        terrain: str = FLAT,
        seed: int = 0,
        faults: Faults = Faults(),
        friction: float = 0.7,
        covered: tuple[str, ...] = SOLES,
        proximity: bool = True,
        period: float = PERIOD,
    ):
        self.period = period
        self.model = build(terrain, friction, covered)
        self.data = mujoco.MjData(self.model)
        self.faults, self.rng = faults, np.random.default_rng(seed)
        self.body = Body({name: Skin(skins()[LINKS[name]]) for name in covered})
        # The geoms of each skin, which are the pads below its taxels.
        self._pads = {name: self._geoms_of(f"{name}/{LINKS[name]}") for name in covered}
        self._near = {name: self._sensors_of_proximity(name) for name in covered if proximity}
        self._late: deque[tuple[dict[str, dict[str, Array]], dict[str, Array]]] = deque(maxlen=faults.latency + 1)
        self._kept: dict[str, Array] | None = None  # reading at which the left sole froze
        for skin in self.body.skins.values():
            skin.tare(np.stack([self._counts(np.zeros(skin.reading_length)) for _ in range(REST)]), accept=True)
        self._sensitivities = {
            name: 1 + self.rng.normal(0, faults.sensitivity, skin.reading_length).clip(-0.9, None)
            for name, skin in self.body.skins.items()
        }
        hips = -KNEE / 2
        # Largest true force on each foot since the caller set it to zero [N]; only of the feet that the caller enters.
        self.peaks: dict[str, float] = {}
        self.start = np.array([0, 0, hips, KNEE, hips, 0] * 2 + [0.2, 0.15, 0, -0.5, 0, 0, 0])
        self.data.qpos[7:] = self.start
        self.data.ctrl[:] = self.start
        mujoco.mj_forward(self.model, self.data)

    def step(self, targets: Array, torques: Array, push: Array | None = None) -> None:
        """Simulate one control cycle.

        Parameters
        ----------
        targets : array, shape (19,)
            Angles of the servos [rad].
        torques : array, shape (19,)
            Added to those of the servos [N m].
        push : array, shape (3,), optional
            Force on the torso [N].
        """
        gains = self.model.actuator_gainprm[:, 0]
        self.data.ctrl[:] = targets + torques / gains
        self.data.xfrc_applied[self.model.body("pelvis").id, :3] = 0 if push is None else push
        for _ in range(round(self.period / TIME_STEP)):
            mujoco.mj_step(self.model, self.data)
            for foot in self.peaks:
                load = normal_forces(self.model, self.data)[self._pads[f"{foot}_foot"]].sum()
                self.peaks[foot] = max(self.peaks[foot], float(load))

    def senses(self) -> Senses:
        """Return what the sensors deliver now."""
        data = self.data
        forces = normal_forces(self.model, self.data)
        self._late.append(({name: self._reading(name, forces) for name in self._pads}, self._ankles()))
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, data.sensor("orientation").data)
        tilt = self.rng.normal(0, TILT_NOISE, 3)
        error = np.array([[1, -tilt[2], tilt[1]], [tilt[2], 1, -tilt[0]], [-tilt[1], tilt[0], 1]])
        q, _ = np.linalg.qr(rotation.reshape(3, 3) @ error)
        rotation = q * np.sign(np.sum(q * rotation.reshape(3, 3), axis=0))
        gyro = data.sensor("gyro").data + self.rng.normal(0, GYRO_NOISE, 3)
        late = self.faults.latency if self._is_faulty else LATENCY
        readings, ankles = self._late[max(len(self._late) - 1 - late, 0)]
        if self._is_faulty:
            readings = {name: values for name, values in readings.items() if self.faults.lost != name}
        return Senses(data.time, data.qpos[7:].copy(), data.qvel[6:].copy(), rotation, gyro, readings, ankles)

    @property
    def _is_faulty(self) -> bool:
        return bool(self.data.time >= self.faults.since)

    @property
    def _noise(self) -> float:
        """Return the standard deviation of a reading now [count]."""
        return self.faults.noise if self._is_faulty else NOISE

    def _ankles(self) -> dict[str, Array]:
        wrenches = {}
        for foot in FEET:
            force, torque = (self.data.sensor(f"{foot}_{kind}").data for kind in ("force", "torque"))
            noise = (self.rng.normal(0, FORCE_NOISE, 3), self.rng.normal(0, TORQUE_NOISE, 3))
            wrenches[foot] = np.concatenate((-force - noise[0], -torque - noise[1]))
        return wrenches

    def _reading(self, name: str, forces: Array) -> dict[str, Array]:
        skin = self.body.skins[name]
        force = np.zeros(skin.reading_length)
        force[skin.channels] = forces[self._pads[name]]
        reading = {"force": self._counts(force * self._sensitivities[name])}
        if name in self._near:
            reading["proximity"] = self._proximity(name)
        if name == "left_foot" and self._is_faulty:
            reading["force"][skin.channels[list(self.faults.dead)]] = 0
            if self.faults.is_frozen:
                reading = self._kept = self._kept or reading
        return reading

    def _counts(self, force: Array) -> Array:
        return force_counts(force, FULL_SCALE, self.rng.normal(0, self._noise, force.shape))

    def _sensors_of_proximity(self, name: str) -> tuple[Array, Array]:
        """Return channels and sites of the proximity sensors."""
        channels = next(m.channels for m in skins()[LINKS[name]].modalities if m.name == "proximity")
        return np.array(list(channels.values())), np.array([self.model.site(f"{name}/{id}").id for id in channels])

    def _proximity(self, name: str) -> Array:
        """Return the readings of the proximity sensors [count]; zero if nothing is in range."""
        channels, sites = self._near[name]
        readings = np.zeros(channels.max() + 1)
        noise = self.rng.normal(0, self._noise, len(sites))
        readings[channels] = proximity_counts(self.model, self.data, sites, f"{name}/{LINKS[name]}", noise)
        return readings

    def _geoms_of(self, body: str) -> slice:
        """Return the geoms of a body of the model."""
        k = self.model.body(body).id
        return slice(self.model.body_geomadr[k], self.model.body_geomadr[k] + self.model.body_geomnum[k])

    # The truth, which is for judging a controller, not for one.

    def true_zmp(self) -> Array:
        """Return the point (2,) of the plane z = 0 about which the contacts of both feet have no moment along it."""
        total = self._contact_wrench("left") + self._contact_wrench("right")
        return np.array((-total[4], total[3])) / total[2] if total[2] > 1 else np.full(2, np.nan)

    def _contact_wrench(self, foot: str) -> Array:
        """Return the wrench (6,) of the ground on a foot, about the origin of the world."""
        contacts, sole = self.data.contact, self.model.body(f"{foot}_foot/sole").id
        owners, rows = self.model.geom_bodyid[contacts.geom], contacts.efc_address
        signs = (owners[:, 1] == sole).astype(float) - (owners[:, 0] == sole)
        used = (signs != 0) & (rows >= 0)
        along = self.data.efc_force[rows[used, None] + np.arange(3)]  # normal and two tangential forces of each contact
        forces = signs[used, None] * np.einsum("kij,ki->kj", contacts.frame[used].reshape(-1, 3, 3), along)
        return np.concatenate((forces.sum(axis=0), np.cross(contacts.pos[used], forces).sum(axis=0)))

    @property
    def fallen(self) -> bool:
        """Whether the pelvis is low or tilted."""
        tilt = self.data.body("pelvis").xmat[8]
        return bool(self.data.qpos[2] < 0.6 * START_HEIGHT or tilt < 0.6)
