"""Compare the runtime with the contacts of a simulator, for a foot with a skin of our own fit.

    python examples/simulated_foot.py [--frames N] [--picture PNG]

The sample sole is fitted and covered with a sheet of 10 mm cells, and with hexagonal boards. In MuJoCo (pip install
mujoco) every cell has small pads on the mesh. A reading is the sum of the simulated forces on the pads of a cell, with
12 bits and noise. A load of 200 to 600 N, with shear and yaw moment, moves over the foot: on flat ground, on a step
under its rear half, on a beam of 12.6 cm, on three pebbles. The truth is every contact of the simulator, with its
position and all six components. It uses no formula of the runtime.
"""

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from skin_calib_addon.calibration import LinkCalibration, Response
from skin_calib_addon.geometry.mesh.distance import closest
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.plan import load_plan
from skin_calib_addon.plan.skins import BoardSkin
from skin_calib_addon.runtime import Frame, Skin, convex_hull
from skin_calib_addon.skin import HexLattice

SOLE = Path(__file__).resolve().parent.parent / "sample_scenes" / "sole.plan.json"
PAD_RADIUS = 0.001  # [m]
PAD_SPACING = 0.0034  # [m]
FULL_SCALE = 200.0  # force of a cell at the highest count [N]
COUNTS = 4095  # highest count of 12 bits
NOISE = 1.0  # standard deviation [counts]
TIME_STEP = 1e-3  # of the simulation [s]
STEPS_PER_FRAME = 40
GROUND = {
    "flat": '<geom type="plane" size="1 1 .1" {options}/>',
    "rear half": '<geom type="box" size=".2 .2 .05" pos="-.2 0 -.05" {options}/>',
    # With other widths, pads next to an edge of the beam hold it by friction and are pulled, which no skin measures.
    "beam 12.6 cm": '<geom type="box" size=".063 .3 .05" pos="0 0 -.05" {options}/>',
    "pebbles": "".join(
        f'<geom type="sphere" size=".02" pos="{x} {y} -.02" {{options}}/>'
        for x, y in ((-0.06, -0.02), (-0.05, 0.025), (0.07, 0.0))
    ),
}
# Amplitude of the load's motion about the centre of the contact, along and across [m].
AMPLITUDE = {"flat": (0.07, 0.025), "rear half": (0.02, 0.02), "beam 12.6 cm": (0.03, 0.025), "pebbles": (0.015, 0.004)}
CENTRE = {"flat": 0.0, "rear half": -0.045, "beam 12.6 cm": 0.0, "pebbles": 0.0}
Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Truth:
    """The simulator's state of one frame, in the link frame."""

    cells: Array  # (n,) force on each taxel's pads along its inward normal [N]
    wrench: Array  # (6,) of all contacts about the link's origin
    points: Array  # (k, 2) where something touches [m]

    @property
    def cop(self) -> Array:
        """Point of the plane z = 0 about which the contacts have no moment along the plane."""
        return np.array((-self.wrench[4], self.wrench[3])) / self.wrench[2]


def authored_skin(hexagons: bool) -> tuple[LinkCalibration, TriangleMesh]:
    """Return the skin of the sample sole from our fit, and its mesh."""
    plan = load_plan(SOLE)
    if hexagons:
        plan = replace(plan, skins=(BoardSkin("sole", HexLattice(0.0163, 0.0), "fill"),))
    result = calibrate(plan)
    return result.calibration, result.cover


def pads(calibration: LinkCalibration, mesh: TriangleMesh) -> tuple[Array, Array]:
    """Return the positions of the pads on the mesh (p, 3), and the taxel (p,) of each."""
    positions, owners = [], []
    taxels = calibration.patches[0].taxels
    for i, (position, corners) in enumerate(zip(taxels.positions_link, taxels.corners_link)):
        outline = convex_hull(corners[:, :2])
        size = np.ptp(outline.corners, axis=0).max()
        count = max(1, round(size / PAD_SPACING))
        step = size / count * (np.arange(count) + 0.5) - size / 2
        for x in step:
            for y in step:
                if outline.margin(position[:2] + (x, y)) > PAD_RADIUS / 2:
                    positions.append((*(position[:2] + (x, y)), position[2]))
                    owners.append(i)
    return closest(mesh, np.array(positions))[2], np.array(owners)


class Foot:
    """The foot in the simulator."""

    def __init__(self, positions: Array, owners: Array, count: int, ground: str):
        import mujoco

        self.mujoco, self.owners, self.count = mujoco, owners, count
        lowest = positions[:, 2].min()
        centres = positions + (0.0, 0.0, PAD_RADIUS)
        spheres = "".join(
            f'<geom type="sphere" size="{PAD_RADIUS}" pos="{x:.9f} {y:.9f} {z:.9f}" mass="0" {PAD_OPTIONS}/>'
            for x, y, z in centres.tolist()
        )
        self.model = mujoco.MjModel.from_xml_string(f"""
            <mujoco>
              <option timestep="{TIME_STEP}" cone="elliptic" gravity="0 0 -9.81"/>
              <size memory="400M"/>
              <worldbody>
                {GROUND[ground].format(options='contype="0" conaffinity="1" friction=".7"')}
                <body name="foot" pos="0 0 {-lowest + 1e-4:.9f}">
                  <freejoint/>
                  <inertial pos="0 0 .03" mass="1.5" diaginertia=".004 .008 .01"/>
                  {spheres}
                </body>
              </worldbody>
            </mujoco>""")
        self.data = mujoco.MjData(self.model)
        self.model.dof_damping[:] = (60, 60, 60, 1, 1, 1)

    def apply(self, force: Array, moment: Array, point: Array) -> Truth:
        """Apply a load at a point of the foot (3,), in its axes, simulate some steps, and return the truth."""
        mujoco, model, data = self.mujoco, self.model, self.data
        for _ in range(STEPS_PER_FRAME):
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
            position = turn.T @ (contact.pos - origin)
            cells[self.owners[pad - first]] += max(force[2], 0.0)
            wrench += np.concatenate((force, np.cross(position, force)))
            points.append(position[:2])
        return Truth(cells, wrench, np.array(points).reshape(-1, 2))


PAD_OPTIONS = 'contype="1" conaffinity="0" friction=".7"'


@dataclass(frozen=True, eq=False)
class Run:
    """One skin on one ground: the results of the runtime and the truth, frame by frame."""

    skin: str
    ground: str
    frames: list[Frame]
    truths: list[Truth]

    @property
    def cop_errors(self) -> Array:
        """Distance of each CoP from the true one [m]."""
        return np.array([np.linalg.norm(f.cop - t.cop) for f, t in zip(self.frames, self.truths)])

    @property
    def load_errors(self) -> Array:
        """Relative error of each load."""
        return np.array([abs(f.wrench[2] / t.wrench[2] - 1) for f, t in zip(self.frames, self.truths)])

    @property
    def guaranteed(self) -> tuple[int, int]:
        """Number of guaranteed polygons in the true hull, and number of those with an area."""
        pairs = [(f.polygon.guaranteed, convex_hull(t.points)) for f, t in zip(self.frames, self.truths)]
        areas = [(p, true) for p, true in pairs if p.kind == "area"]
        return sum(all(true.margin(c) > -1e-9 for c in p.corners) for p, true in areas), len(areas)

    @property
    def outer_contains_cop(self) -> int:
        """Number of frames in which the outer polygon contains the true CoP."""
        return sum(f.polygon.outer.contains(t.cop) for f, t in zip(self.frames, self.truths))


def runs(frames: int) -> list[Run]:
    """Simulate both skins on every ground."""
    done = []
    for name, hexagons in (("sheet 10 mm", False), ("hexagons", True)):
        calibration, mesh = authored_skin(hexagons)
        lsb = FULL_SCALE * (6 if hexagons else 1) / COUNTS
        positions, owners = pads(calibration, mesh)
        count = len(calibration.patches[0].taxels.ids)
        for ground in GROUND:
            skin = Skin(replace(calibration, response=Response((0.0, lsb))), switch_on=6 * lsb, switch_off=4 * lsb)
            foot = Foot(positions, owners, count, ground)
            done.append(Run(name, ground, *_rocked(skin, foot, ground, lsb, frames)))
    return done


def _rocked(skin: Skin, foot: Foot, ground: str, lsb: float, frames: int) -> tuple[list[Frame], list[Truth]]:
    rng, results, truths = np.random.default_rng(0), [], []
    (along, across), height = AMPLITUDE[ground], skin.positions[:, 2].mean()
    for k in range(-5, frames):  # the foot lands before the first frame
        phase = 2 * np.pi * k / frames
        load = 400 + 200 * np.sin(3 * phase)
        force = np.array((0.08 * load * np.sin(2 * phase), 0.08 * load * np.cos(phase), -load))
        point = np.array((CENTRE[ground] + along * np.sin(phase), across * np.sin(2 * phase), height))
        truth = foot.apply(force, np.array((0, 0, 0.5 * np.sin(phase))), point)
        if k >= 0:
            counts = np.clip(np.rint(truth.cells / lsb + rng.normal(0, NOISE, len(truth.cells))), 0, COUNTS)
            results.append(skin.update(counts.astype(np.uint16), k * TIME_STEP * STEPS_PER_FRAME))
            truths.append(truth)
    return results, truths


def table(done: list[Run]) -> str:
    """Return the table of errors on each ground."""
    lines = [
        "skin         ground       frames  load off     CoP off, mean  p95  [mm]  guaranteed inside  outer holds CoP"
    ]
    for run in done:
        errors, load, (inside, areas) = 1e3 * run.cop_errors, 100 * run.load_errors.mean(), run.guaranteed
        count = len(run.frames)
        lines.append(
            f"{run.skin:12} {run.ground:12} {count:6} {load:8.2f} % {errors.mean():14.2f}"
            f" {np.percentile(errors, 95):6.2f} {inside:14} of {areas:3} {run.outer_contains_cop:12} of {count}"
        )
    return "\n".join(lines)


def draw(done: list[Run], path: Path) -> None:
    """Draw a frame of every run: cells, true contacts, polygons, both CoPs."""
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
        axes.set(title=f"{run.skin}, {run.ground}: {1e3 * run.cop_errors.mean():.2f} mm", aspect="equal")
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
