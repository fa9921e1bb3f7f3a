"""A robot touches itself: simulated sessions with a known truth, and the real one of a Nao.

    python benchmarks/self_touch.py [--robot G1] [--seeds 5] [--touches 20,50,200] [--keep FOLDER] [--planned]

For the G1 and JVRC-1 of the data folder it proposes and fits skins of a few links; ``--keep`` keeps them. The zeros of
all joints are wrong by 0.5 degree, the tip of the right hand by 2 mm, each skin by 3 mm and 2 degrees. The hand touches
random points of the largest skin of each link, with 1 mm of noise per axis. A press loads the cells by a round spot;
gains differ by 15 %, readings have 8 bits. Kinematics and search for postures are of this file. With ``--planned``,
touches that the package proposes are compared with random ones. For the Nao it states the distance of 300 other touches.
"""

import argparse
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from robots import ROBOTS  # noqa: E402

from skin_calib_addon.calibration import LinkCalibration  # noqa: E402
from skin_calib_addon.calibration.robot_set import load_links  # noqa: E402
from skin_calib_addon.cli import main as skin_calib  # noqa: E402
from skin_calib_addon.pipeline.calibrate import surface_of  # noqa: E402
from skin_calib_addon.pipeline.self_touch import moved_skins  # noqa: E402
from skin_calib_addon.geometry.surface.footpoints import footpoints  # noqa: E402
from skin_calib_addon.robot.urdf import Robot, read_robot  # noqa: E402
from skin_calib_addon.validation.self_touch import SelfTouch, fit_self_touch  # noqa: E402
from skin_calib_addon.validation.self_touch_session import read_session  # noqa: E402

# Links with skin, the link of the hand, and the nominal tip in its frame [m].
SCENES = {
    "G1": (
        ("torso_link", "left_elbow_link", "left_hip_yaw_link", "right_hip_yaw_link", "left_knee_link"),
        ("right_rubber_hand", (0.12, 0.0, 0.0)),
    ),
    "JVRC-1": (
        ("WAIST_R_S", "L_ELBOW_P_S", "L_HIP_Y_S", "R_HIP_Y_S", "L_KNEE_S"),
        ("R_WRIST_Y_S", (0.0, 0.0, -0.15)),
    ),
}
OFFSET, TIP, SHIFT, TURN = np.deg2rad(0.5), 2e-3, 3e-3, np.deg2rad(2.0)  # standard deviations [rad, m, m, rad]
NOISE, GAINS, STEPS = 1e-3, 0.15, 255  # [m, 1, 1]
SPOTS = (6e-3, 10e-3)  # diameters [m]
MAX_TRIES = 300  # of a posture that touches
Array = np.ndarray


class Chain:
    """Kinematics of this file: from a URDF, by the definition of the format."""

    def __init__(self, urdf: Path):
        root = ET.parse(urdf).getroot()
        self.above, self.limits = {}, {}
        for joint in root.iter("joint"):
            if joint.find("child") is None:
                continue
            origin, axis, limit = (joint.find(tag) for tag in ("origin", "axis", "limit"))
            numbers = {
                name: np.array([float(x) for x in (node.get(name) if node is not None else None or "0 0 0").split()])
                for name, node in (("xyz", origin), ("rpy", origin))
            }
            along = np.array([float(x) for x in axis.get("xyz").split()]) if axis is not None else np.array((1.0, 0, 0))
            name, child = joint.get("name"), joint.find("child").get("link")
            turned = Rotation.from_euler("xyz", numbers["rpy"]).as_matrix()
            moves = joint.get("type") in ("revolute", "continuous")
            self.above[child] = name, joint.find("parent").get("link"), turned, numbers["xyz"], along, moves
            if moves:
                self.limits[name] = (float(limit.get("lower")), float(limit.get("upper")))

    def joints(self, link: str) -> list[str]:
        """Return the joints that move a link."""
        found = []
        while link in self.above:
            name, link, *_, moves = self.above[link]
            found += [name] if moves else []
        return found

    def pose(self, link: str, angles: dict[str, float]) -> tuple[Array, Array]:
        """Return rotation and position of a link."""
        rotation, position = np.eye(3), np.zeros(3)
        while link in self.above:
            name, link, turned, origin, axis, moves = self.above[link]
            own = turned @ Rotation.from_rotvec(angles[name] * axis).as_matrix() if moves else turned
            rotation, position = own @ rotation, origin + own @ position
        return rotation, position


class Truth:
    """What is really on a robot."""

    def __init__(self, urdf: Path, scene: tuple, skins: dict[str, LinkCalibration], seed: int):
        self.rng, self.chain = np.random.default_rng(seed), Chain(urdf)
        links, (self.hand, tip) = scene
        self.nominal = np.array(tip)
        self.tip = tip + self.rng.normal(0, TIP, 3)
        self.skins = {link: self._moved(skins[link]) for link in links}
        joints = {name for link in (*links, self.hand) for name in self.chain.joints(link)}
        self.offsets = {name: self.rng.normal(0, OFFSET) for name in sorted(joints)}
        self.names = list(self.offsets)

    def _moved(self, skin: LinkCalibration):
        """Return positions, normals, tangents of the largest skin of a link after a random motion on the surface."""
        patch = max(skin.patches, key=lambda patch: len(patch.taxels.ids))
        taxels, (surface,) = patch.taxels, [surface_of(s) for s in skin.surfaces if s.name == patch.surface]
        shift, turn = self.rng.normal(0, SHIFT, 2), self.rng.normal(0, TURN)
        points, axes, steps = taxels.positions_link.copy(), taxels.axes_link.copy(), 10
        from skin_calib_addon.validation.flat import flat_places

        arms = flat_places(patch, taxels.index)
        arms = arms - arms.mean(axis=0)
        height = ((points - surface.points(taxels.uv)) * taxels.normals_link).sum(axis=1)
        for _ in range(steps):
            step = (shift + turn * np.column_stack((-arms[:, 1], arms[:, 0]))) / steps
            uv, _ = footpoints(surface, points + np.einsum("nk,nkc->nc", step, axes))
            normals = surface.normals(uv)
            points = surface.points(uv) + height[:, None] * normals
            along = axes[:, 0] - (axes[:, 0] * normals).sum(axis=1)[:, None] * normals
            along /= np.linalg.norm(along, axis=1)[:, None]
            axes = np.stack((along, np.cross(normals, along)), axis=1)
        c, s = np.cos(turn), np.sin(turn)
        axes = np.stack((c * axes[:, 0] + s * axes[:, 1], c * axes[:, 1] - s * axes[:, 0]), axis=1)
        return patch, points, np.cross(axes[:, 0], axes[:, 1]), axes

    def touch(self, link: str | None = None, row: int | None = None, start: dict[str, float] | None = None):
        """Return measured angles, link, contact and nearest taxel of one touch; of a random point, or of a taxel from a posture."""
        at = link or list(self.skins)[self.rng.integers(len(self.skins))]
        patch, points, normals, axes = self.skins[at]
        felt, body = self.chain.joints(at), self.chain.joints(self.hand)
        moving = [name for name in self.names if (name in felt) != (name in body)]
        low, high = np.array([self.chain.limits[name] for name in moving]).T
        for _ in range(MAX_TRIES):
            k = self.rng.integers(len(points)) if row is None else row
            flat = self.rng.uniform(-0.5, 0.5, 2) * np.sqrt(patch.taxels.areas[k])
            contact = points[k] + flat @ axes[k]
            target = contact + self.rng.normal(0, NOISE, 3)
            angles = {name: self.rng.uniform(*self.chain.limits[name]) for name in self.names} | (start or {})
            first = np.clip([angles[name] for name in moving], low + 1e-6, high - 1e-6)

            def hand(values, at=at, angles=angles, of=self.tip):
                now = angles | dict(zip(moving, values))
                (r, p), (s, q) = self.chain.pose(at, now), self.chain.pose(self.hand, now)
                return r.T @ (s @ of + q - p)

            found = least_squares(
                lambda values, target=target: 1e3 * (hand(values) - target), first, bounds=(low, high), max_nfev=30
            ).x
            from_hand = hand(found, of=0.5 * self.tip) - contact
            is_outside = from_hand @ normals[k] > 0.2 * np.linalg.norm(from_hand)
            if np.linalg.norm(hand(found) - target) < 1e-4 and (is_outside or start):
                now = angles | dict(zip(moving, found))
                return {name: now[name] - self.offsets[name] for name in self.names}, at, contact, k
        raise RuntimeError(f"no posture of {self.hand} touches {at}")

    def readings(self, link: str, contact: Array, k: int, diameter: float) -> Array:
        """Return the readings of a press: Hertz's pressure in a round spot."""
        patch, points, _, axes = self.skins[link]
        i = np.arange(300) + 0.5
        radius, angle = np.sqrt(i / 300), i * np.pi * (1 + 5**0.5)
        spot = contact + diameter / 2 * radius[:, None] * (np.column_stack((np.cos(angle), np.sin(angle))) @ axes[k])
        distance, cells = cKDTree(points).query(spot)
        inside = distance < np.sqrt(patch.taxels.areas[k]) * 0.62
        loads = np.bincount(cells[inside], np.sqrt(1 - radius[inside] ** 2), len(points)) / np.sqrt(1 - radius**2).sum()
        gains = 1 + GAINS * np.random.default_rng(len(points)).standard_normal(len(points))
        return np.clip(np.rint(loads * gains * STEPS * 0.8), 0, STEPS)

    def table(self, touches: Sequence, diameter: float) -> str:
        """Return a session, with spots of a diameter [m]."""
        ids = [f"{link}/{name}" for link, (patch, *_) in self.skins.items() for name in patch.taxels.ids]
        first = dict(zip(self.skins, np.cumsum([0, *(len(s[1]) for s in self.skins.values())])))
        x, y, z = self.nominal * 1e3
        lines = [f"# tip: hand {self.hand} {x} {y} {z} mm", ",".join((*(f"{n} [rad]" for n in self.names), *ids))]
        for angles, link, contact, k in touches:
            row, felt = np.zeros(len(ids)), self.readings(link, contact, k, diameter)
            row[first[link] : first[link] + len(felt)] = felt
            lines.append(",".join([*(f"{angles[name]:.7f}" for name in self.names), *(f"{x:g}" for x in row)]))
        return "\n".join(lines) + "\n"


def proposed(name: str, folder: Path) -> dict[str, LinkCalibration]:
    """Return the skins of a robot that the package proposes."""
    if not (folder / "robot.json").exists():
        words = ["fit", str(ROBOTS[name]), "--propose", "-o", str(folder)]
        assert skin_calib(words + [w for link in SCENES[name][0] for w in ("--only", link)]) == 0
    return load_links(folder)[0]


def compared(truth: Truth, found: SelfTouch, skins: dict[str, LinkCalibration]) -> dict[str, Array]:
    """Return errors [m, rad], and standard errors, of taxels (per axis) and joints."""
    after = moved_skins(found, skins)
    errors, sigmas = [], []
    for link, (patch, points, *_) in truth.skins.items():
        k = [p for _, p in found.model.session.patches].index(patch)
        if not (found.model.felt.patches == k).any():
            continue
        (now,) = [p for p in after[link].patches if p.name == patch.name]
        axes = now.taxels.axes_link
        errors.append(np.einsum("nkc,nc->nk", axes, points - now.taxels.positions_link))
        sigmas.append(np.sqrt(np.einsum("nkc,ncd,nkd->nk", axes, found.displacements(k)[1], axes)))
    unknowns = [(k, u) for k, u in enumerate(found.model.unknowns) if u.kind == "joint"]
    joints = np.array([truth.offsets[u.owner] - found.values[k] for k, u in unknowns])
    return {"taxels": np.concatenate(errors), "sigma": np.concatenate(sigmas), "joints": joints,
            "joint sigma": found.errors[[k for k, _ in unknowns]]}  # fmt: skip


def of_robot(name: str, options: argparse.Namespace) -> None:
    """Print the figures of a robot."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = (options.keep or Path(temporary)) / name
        skins, robot = proposed(name, folder), read_robot(ROBOTS[name])
        counts = [int(text) for text in options.touches.split(",")]
        results: dict[tuple[int, float], list] = {(count, spot): [] for count in counts for spot in SPOTS}
        for seed in range(options.seed, options.seed + options.seeds):
            truth = Truth(ROBOTS[name], SCENES[name], skins, seed)
            touches = [truth.touch() for _ in range(max(counts))]
            for (count, spot), parts in results.items():
                found = fitted(truth, touches[:count], spot, robot, skins)
                parts.append(compared(truth, found, skins))
        for (count, spot), parts in results.items():
            print(f"{name}, {count} touches, spots of {spot * 1e3:g} mm, {options.seeds} sessions: {summary(parts)}", flush=True)


def fitted(truth: Truth, touches: Sequence, spot: float, robot: Robot, skins: dict[str, LinkCalibration]) -> SelfTouch:
    """Return what the package states about a session."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "session.csv"
        path.write_text(truth.table(touches, spot))
        return fit_self_touch(robot, read_session(path, robot, skins))


def summary(parts: list[dict[str, Array]]) -> str:
    """Return errors and coverage in words."""
    taxels, sigma, joints, joint_sigma = (np.concatenate([part[key] for part in parts]) for key in parts[0])
    z, q = np.abs(taxels) / sigma, np.abs(joints) / joint_sigma
    return (
        f"taxels {np.sqrt((taxels**2).mean()) * 1e3:.2f} mm per axis, joints "
        f"{np.rad2deg(np.sqrt((joints**2).mean())):.2f} degrees; within one, two standard errors: taxels "
        f"{100 * (z < 1).mean():.0f}, {100 * (z < 2).mean():.0f} %, joints {100 * (q < 1).mean():.0f}, {100 * (q < 2).mean():.0f} %"
    )


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--robot", action="append", choices=(*SCENES, "Nao"))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--touches", default="20,50,200")
    parser.add_argument("--keep", type=Path, help="folder for plans and calibrations")
    parser.add_argument("--planned", action="store_true", help="planned touches and random ones")
    options = parser.parse_args()
    for name in options.robot or SCENES:
        of_robot(name, options)


if __name__ == "__main__":
    main()
