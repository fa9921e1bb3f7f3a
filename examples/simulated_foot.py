"""A foot in a simulator, its skin authored by our own fit, its runtime compared with the simulator's contacts.

    python examples/simulated_foot.py [--frames N] [--picture PNG]

The sample sole is fitted and covered with a sheet of 10 mm cells and with hexagonal boards. In MuJoCo (pip install
mujoco) every cell carries small pads that stand on the mesh itself; a reading is the sum of the simulator's forces on a
cell's pads, at 12 bits with noise. A load of 200 to 600 N walks over the foot, with shear and yaw, on flat ground, on a
step under its rear half, on a beam of 12 cm, on three pebbles. The truth is every contact of the simulator: where it is
and what it carries, in all six components. No formula of the runtime is used for it.
"""

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from skin_calib_addon.calibration import LinkCalibration, Response
from skin_calib_addon.geometry.surface.distance import MeshDistance
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.plan import load_plan
from skin_calib_addon.plan.skins import BoardSkin
from skin_calib_addon.runtime import Frame, Skin, convex_hull
from skin_calib_addon.skin import HexLattice

SOLE = Path(__file__).resolve().parent.parent / "sample_scenes" / "sole.plan.json"
PAD = 0.001  # radius [m]
PAD_SPACING = 0.0034  # [m]
FULL_SCALE, COUNTS = 200.0, 4095  # of a cell at 12 bits [N]
NOISE = 1.0  # [counts]
STEP, SETTLE = 1e-3, 40  # [s], steps from frame to frame
GROUND = {
    "flat": '<geom type="plane" size="1 1 .1" {touch}/>',
    "rear half": '<geom type="box" size=".2 .2 .05" pos="-.2 0 -.05" {touch}/>',
    "beam 12 cm": '<geom type="box" size=".06 .3 .05" pos="0 0 -.05" {touch}/>',
    "pebbles": "".join(
        f'<geom type="sphere" size=".02" pos="{x} {y} -.02" {{touch}}/>'
        for x, y in ((-0.06, -0.02), (-0.05, 0.025), (0.07, 0.0))
    ),
}
# How far the load walks from the middle of what carries it, along and across [m].
REACH = {"flat": (0.07, 0.025), "rear half": (0.02, 0.02), "beam 12 cm": (0.03, 0.025), "pebbles": (0.015, 0.004)}
MIDDLE = {"flat": 0.0, "rear half": -0.045, "beam 12 cm": 0.0, "pebbles": 0.0}
Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Truth:
    """What the simulator knows of one frame, in the link frame."""

    cells: Array  # (n,) force on each taxel's pads along its inward normal [N]
    wrench: Array  # (6,) of all contacts about the link's origin
    points: Array  # (k, 2) where something touches [m]

    @property
    def cop(self) -> Array:
        """Where the contacts have no moment along the plane z = 0."""
        return np.array((-self.wrench[4], self.wrench[3])) / self.wrench[2]


def authored(hexagons: bool) -> tuple[LinkCalibration, MeshDistance]:
    """The sample sole's skin as our fit lays it, and its mesh."""
    plan = load_plan(SOLE)
    if hexagons:
        plan = replace(plan, skins=(BoardSkin("sole", HexLattice(0.0163, 0.0), "fill"),))
    result = calibrate(plan)
    return result.calibration, MeshDistance(result.cover)


def pads(calibration: LinkCalibration, mesh: MeshDistance) -> tuple[Array, Array]:
    """Places of the pads on the mesh (p, 3), and the taxel (p,) each belongs to."""
    places, owners = [], []
    taxels = calibration.patches[0].taxels
    for i, (position, corners) in enumerate(zip(taxels.positions_link, taxels.corners_link)):
        outline = convex_hull(corners[:, :2])
        size = np.ptp(outline.corners, axis=0).max()
        count = max(1, round(size / PAD_SPACING))
        step = size / count * (np.arange(count) + 0.5) - size / 2
        for x in step:
            for y in step:
                if outline.margin(position[:2] + (x, y)) > PAD / 2:
                    places.append((*(position[:2] + (x, y)), position[2]))
                    owners.append(i)
    return mesh(np.array(places))[2], np.array(owners)


class Foot:
    """The foot in the simulator."""

    def __init__(self, places: Array, owners: Array, count: int, ground: str):
        import mujoco

        self.mujoco, self.owners, self.count = mujoco, owners, count
        lowest = places[:, 2].min()
        spheres = "".join(
            f'<geom type="sphere" size="{PAD}" pos="{x:.9f} {y:.9f} {z + PAD:.9f}" mass="0" {TOUCHES}/>'
            for x, y, z in places.tolist()
        )
        self.model = mujoco.MjModel.from_xml_string(f"""
            <mujoco>
              <option timestep="{STEP}" cone="elliptic" gravity="0 0 -9.81"/>
              <size memory="400M"/>
              <worldbody>
                {GROUND[ground].format(touch='contype="0" conaffinity="1" friction=".7"')}
                <body name="foot" pos="0 0 {-lowest + 1e-4:.9f}">
                  <freejoint/>
                  <inertial pos="0 0 .03" mass="1.5" diaginertia=".004 .008 .01"/>
                  {spheres}
                </body>
              </worldbody>
            </mujoco>""")
        self.data = mujoco.MjData(self.model)
        self.model.dof_damping[:] = (60, 60, 60, 1, 1, 1)

    def under(self, force: Array, moment: Array, point: Array) -> Truth:
        """Let a load at a point of the foot (3,), in the foot's axes, come to rest, and tell the truth."""
        mujoco, model, data = self.mujoco, self.model, self.data
        for _ in range(SETTLE):
            turn = data.xmat[1].reshape(3, 3)
            arm = turn @ point + data.xpos[1] - data.xipos[1]
            data.xfrc_applied[1, :3] = turn @ force
            data.xfrc_applied[1, 3:] = turn @ moment + np.cross(arm, turn @ force)
            mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
        return self._truth()

    def _truth(self) -> Truth:
        mujoco, data = self.mujoco, self.data
        turn, origin = data.xmat[1].reshape(3, 3), data.xpos[1]
        cells, wrench, points = np.zeros(self.count), np.zeros(6), []
        first = self.model.ngeom - len(self.owners)
        felt = np.zeros(6)
        for k in range(data.ncon):
            contact = data.contact[k]
            mujoco.mj_contactForce(self.model, data, k, felt)
            if felt[0] <= 0:
                continue
            force = contact.frame.reshape(3, 3).T @ felt[:3]
            pad = max(contact.geom1, contact.geom2)
            force = turn.T @ (force if contact.geom2 == pad else -force)
            place = turn.T @ (contact.pos - origin)
            cells[self.owners[pad - first]] += max(force[2], 0.0)
            wrench += np.concatenate((force, np.cross(place, force)))
            points.append(place[:2])
        return Truth(cells, wrench, np.array(points).reshape(-1, 2))


TOUCHES = 'contype="1" conaffinity="0" friction=".7"'


@dataclass(frozen=True, eq=False)
class Run:
    """One skin on one ground: what the runtime told and what was true, frame by frame."""

    skin: str
    ground: str
    frames: list[Frame]
    truths: list[Truth]

    @property
    def off(self) -> Array:
        """How far each CoP is from the true one [m]."""
        return np.array([np.linalg.norm(f.cop - t.cop) for f, t in zip(self.frames, self.truths)])

    @property
    def load_off(self) -> Array:
        """Share by which each load is off the true one."""
        return np.array([abs(f.wrench[2] / t.wrench[2] - 1) for f, t in zip(self.frames, self.truths)])

    @property
    def guaranteed(self) -> tuple[int, int]:
        """How many guaranteed polygons lie in the true hull, of how many that have an area."""
        pairs = [(f.polygon.guaranteed, convex_hull(t.points)) for f, t in zip(self.frames, self.truths)]
        areas = [(p, true) for p, true in pairs if p.kind == "area"]
        return sum(all(true.margin(c) > -1e-9 for c in p.corners) for p, true in areas), len(areas)

    @property
    def held(self) -> int:
        """In how many frames the outer polygon holds the true CoP."""
        return sum(f.polygon.outer.contains(t.cop) for f, t in zip(self.frames, self.truths))


def runs(frames: int) -> list[Run]:
    """Both skins on every ground."""
    done = []
    for name, hexagons in (("sheet 10 mm", False), ("hexagons", True)):
        calibration, mesh = authored(hexagons)
        lsb = FULL_SCALE * (6 if hexagons else 1) / COUNTS
        places, owners = pads(calibration, mesh)
        count = len(calibration.patches[0].taxels.ids)
        for ground in GROUND:
            skin = Skin(replace(calibration, response=Response((0.0, lsb))), switch_on=6 * lsb, switch_off=4 * lsb)
            foot = Foot(places, owners, count, ground)
            done.append(Run(name, ground, *_rocked(skin, foot, ground, lsb, frames)))
    return done


def _rocked(skin: Skin, foot: Foot, ground: str, lsb: float, frames: int) -> tuple[list[Frame], list[Truth]]:
    rng, told, truths = np.random.default_rng(0), [], []
    (along, across), height = REACH[ground], skin.positions[:, 2].mean()
    for k in range(-5, frames):  # the foot comes down before the first frame
        phase = 2 * np.pi * k / frames
        load = 400 + 200 * np.sin(3 * phase)
        force = np.array((0.08 * load * np.sin(2 * phase), 0.08 * load * np.cos(phase), -load))
        point = np.array((MIDDLE[ground] + along * np.sin(phase), across * np.sin(2 * phase), height))
        truth = foot.under(force, np.array((0, 0, 0.5 * np.sin(phase))), point)
        if k >= 0:
            counts = np.clip(np.rint(truth.cells / lsb + rng.normal(0, NOISE, len(truth.cells))), 0, COUNTS)
            told.append(skin.update(counts.astype(np.uint16), k * STEP * SETTLE))
            truths.append(truth)
    return told, truths


def table(done: list[Run]) -> str:
    """What the runtime was worth on each ground."""
    lines = [
        "skin         ground       frames  load off     CoP off, mean  p95  [mm]  guaranteed inside  outer holds CoP"
    ]
    for run in done:
        off, (inside, areas) = 1e3 * run.off, run.guaranteed
        lines.append(
            f"{run.skin:12} {run.ground:12} {len(run.frames):6} {100 * run.load_off.mean():8.2f} % {off.mean():14.2f}"
            f" {np.percentile(off, 95):6.2f} {inside:14} of {areas:3} {run.held:12} of {len(run.frames)}"
        )
    return "\n".join(lines)


def draw(done: list[Run], path: Path) -> None:
    """A frame of every run: cells, true contacts, polygons, both CoPs."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15, 4.9), dpi=100, facecolor="white")
    FigureCanvasAgg(figure)
    for axes, run in zip(figure.subplots(2, len(GROUND)).ravel(), done):
        k = len(run.frames) // 5
        frame, truth = run.frames[k], run.truths[k]
        peak = max(frame.forces.max(), 1e-9)
        for force, corners in zip(frame.forces, 1e3 * frame.ground.corners):
            axes.fill(
                *corners.T, facecolor=(1, 1 - 0.7 * force / peak, 1 - force / peak), edgecolor="0.8", linewidth=0.4
            )
        axes.plot(*(1e3 * truth.points.T), ".", color="0.35", markersize=1.5, label="true contacts")
        for name, colour in (("outer", "#9aa7b8"), ("nominal", "#1552c0"), ("guaranteed", "#1a9a3a")):
            corners = 1e3 * getattr(frame.polygon, name).corners
            if len(corners):
                axes.plot(*np.concatenate((corners, corners[:1])).T, color=colour, linewidth=1.3, label=name)
        axes.plot(*(1e3 * truth.cop), "kx", markersize=8, label="true CoP")
        axes.plot(*(1e3 * frame.cop), "o", mfc="none", color="#d62728", markersize=8, label="CoP")
        axes.set(title=f"{run.skin}, {run.ground}: {1e3 * run.off.mean():.2f} mm", aspect="equal")
        axes.tick_params(labelsize=7)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=6, frameon=False)
    figure.tight_layout(rect=(0, 0.05, 1, 1))
    figure.savefig(path, metadata={"Software": None})


def main() -> None:
    """Simulate, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--picture", type=Path)
    options = parser.parse_args()
    done = runs(options.frames)
    print(table(done))
    if options.picture:
        draw(done, options.picture)


if __name__ == "__main__":
    main()
