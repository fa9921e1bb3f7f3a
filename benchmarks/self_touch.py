"""A robot touches itself: simulated sessions with a known truth, and the real one of a Nao.

    python benchmarks/self_touch.py [--robot G1] [--seeds 5] [--touches 20,50,200] [--keep FOLDER] [--planned]

For the G1 and JVRC-1 of the data folder it proposes and fits skins of a few links; ``--keep`` keeps them. The zeros of
all joints are wrong by 0.5 degree, the tip of the right hand by 2 mm, each skin by 3 mm and 2 degrees. The hand touches
random points of the largest skin of each link, with 1 mm of noise per axis. A press loads the cells by a round spot;
gains differ by 15 %, readings have 8 bits. Kinematics and search for postures are of this file. With ``--planned``,
touches that the package proposes are compared with random ones. For the Nao it states the distance of 300 touches that
were not used.
"""

import argparse
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.io import loadmat
from scipy.optimize import least_squares
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from robots import ROBOTS  # noqa: E402

from skin_calib_addon.calibration import LinkCalibration, MeshSource, Patch, TaxelArray  # noqa: E402
from skin_calib_addon.calibration.robot_set import load_links  # noqa: E402
from skin_calib_addon.cli import main as skin_calib  # noqa: E402
from skin_calib_addon.geometry.surface.footpoints import footpoints  # noqa: E402
from skin_calib_addon.pipeline.calibrate import surface_of  # noqa: E402
from skin_calib_addon.pipeline.self_touch import moved_skins  # noqa: E402
from skin_calib_addon.robot.urdf import Robot, read_robot  # noqa: E402
from skin_calib_addon.validation.flat import flat_places  # noqa: E402
from skin_calib_addon.validation.next_self_touch import next_touches  # noqa: E402
from skin_calib_addon.validation.self_touch import PRIORS, SelfTouch, fit_self_touch  # noqa: E402
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


def numbers(node: ET.Element | None, key: str, default: str) -> Array:
    """Return the numbers of an attribute."""
    return np.array([float(x) for x in (default if node is None else node.get(key, default)).split()])


class Chain:
    """Kinematics of this file: from a URDF, by the definition of the format."""

    def __init__(self, urdf: Path):
        root = ET.parse(urdf).getroot()
        self.above, self.limits = {}, {}
        for joint in root.iter("joint"):
            if joint.find("child") is None:
                continue
            origin, axis, limit = (joint.find(tag) for tag in ("origin", "axis", "limit"))
            at, angles = (numbers(origin, key, "0 0 0") for key in ("xyz", "rpy"))
            along = numbers(axis, "xyz", "1 0 0")
            name, child = joint.get("name"), joint.find("child").get("link")
            turned = Rotation.from_euler("xyz", angles).as_matrix()
            moves = joint.get("type") in ("revolute", "continuous")
            self.above[child] = name, joint.find("parent").get("link"), turned, at, along, moves
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
        self.motions: dict[str, Array] = {}  # shift and rotation of each skin [m, m, rad]
        self.skins = {link: self._moved(skins[link]) for link in links}
        joints = {name for link in (*links, self.hand) for name in self.chain.joints(link)}
        self.offsets = {name: self.rng.normal(0, OFFSET) for name in sorted(joints)}
        self.names = list(self.offsets)

    def _moved(self, skin: LinkCalibration):
        """Return positions, normals, tangents of the largest skin of a link after a random motion on the surface."""
        patch = max(skin.patches, key=lambda patch: len(patch.taxels.ids))
        taxels, (surface,) = patch.taxels, [surface_of(s) for s in skin.surfaces if s.name == patch.surface]
        shift, turn = self.rng.normal(0, SHIFT, 2), self.rng.normal(0, TURN)
        self.motions[skin.link] = np.append(shift, turn)
        points, axes, steps = taxels.positions_link.copy(), taxels.axes_link.copy(), 10
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
        """Return measured angles, link, contact and nearest taxel of a touch: random, or of a taxel from a posture."""
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
    """Return the largest skin of each link that the package proposes."""
    if not (folder / "robot.json").exists():
        words = ["fit", str(ROBOTS[name]), "--propose", "-o", str(folder)]
        assert skin_calib(words + [w for link in SCENES[name][0] for w in ("--only", link)]) == 0
    skins = load_links(folder)[0]
    largest = {link: max(skin.patches, key=lambda patch: len(patch.taxels.ids)) for link, skin in skins.items()}
    return {link: replace(skins[link], patches=(patch,)) for link, patch in largest.items()}


def compared(truth: Truth, found: SelfTouch, skins: dict[str, LinkCalibration]) -> dict[str, Array]:
    """Return errors [m, rad], and standard errors, of taxels (per axis) and joints."""
    after = moved_skins(found, skins)
    errors, sigmas, least, best = [], [], [], bound(truth, found)
    for link, (patch, points, *_) in truth.skins.items():
        k = [p for _, p in found.model.session.patches].index(patch)
        if not (found.model.felt.patches == k).any():
            continue
        (now,) = [p for p in after[link].patches if p.name == patch.name]
        axes = now.taxels.axes_link
        errors.append(np.einsum("nkc,nc->nk", axes, points - now.taxels.positions_link))
        for of_taxels, one in ((sigmas, found), (least, best)):
            of_taxels.append(np.sqrt(np.einsum("nkc,ncd,nkd->nk", axes, one.displacements(k)[1], axes)))
    rows = [k for k, unknown in enumerate(found.model.unknowns) if unknown.kind == "joint"]
    return {
        "taxels": np.concatenate(errors),
        "sigma": np.concatenate(sigmas),
        "joints": np.array([truth.offsets[found.model.unknowns[k].owner] - found.values[k] for k in rows]),
        "joint sigma": found.errors[rows],
        "learnt": found.learnt[rows],
        "bound": np.concatenate(least),
        "joint bound": best.errors[rows],
    }


def bound(truth: Truth, found: SelfTouch) -> SelfTouch:
    """Return the truth, with the least covariance of an estimate that knows the distributions of the errors.

    It is the Bayesian Cramer-Rao bound: the inverse of the information of the touches at the truth, and of the
    distributions. Residuals of a class are normal, with their standard deviation at the truth.
    """
    model, usual = found.model, PRIORS | {"joint": OFFSET, "tip": TIP, "shift": SHIFT, "turn": TURN}
    values = np.zeros(len(model.unknowns))
    for k, (kind, owner, axis) in enumerate(model.unknowns):
        if kind == "joint":
            values[k] = truth.offsets[owner]
        elif kind == "tip":
            values[k] = (truth.tip - truth.nominal)[axis]
        elif kind in ("shift", "turn"):
            values[k] = truth.motions[model.session.patches[owner][0]][2 if kind == "turn" else axis]
        elif kind == "spot":
            values[k] = found.values[k]
    residuals, slopes = model.linearized(values)
    scales = np.array([rms((residuals / model.sigmas)[model.classes == c]) for c in range(3)])
    A = (slopes / (model.sigmas * scales[model.classes])[..., None]).reshape(-1, len(values))
    precision = A.T @ A + np.diag([usual[unknown.kind] ** -2 for unknown in model.unknowns])
    return replace(found, values=values, covariance=np.linalg.inv(precision))


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
            print(
                f"{name}, {count} touches, spots of {spot * 1e3:g} mm, {options.seeds} sessions: {summary(parts)}",
                flush=True,
            )


def planned(name: str, options: argparse.Namespace) -> None:
    """Print the errors after ten random touches and more of them: random ones, or those of the package."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = (options.keep or Path(temporary)) / name
        skins, robot, spot = proposed(name, folder), read_robot(ROBOTS[name]), SPOTS[-1]
        results: dict[str, list] = {}
        for seed in range(options.seed, options.seed + options.seeds):
            truth = Truth(ROBOTS[name], SCENES[name], skins, seed)
            touches = [truth.touch() for _ in range(50)]
            for count in range(10, 51, 5):
                found = fitted(truth, touches[:count], spot, robot, skins)
                results.setdefault(f"{count} random", []).append(compared(truth, found, skins))
            chosen = touches[:10]
            while len(chosen) < 50:
                found = fitted(truth, chosen, spot, robot, skins)
                for touch in next_touches(found, 5, seed=len(chosen)):
                    row = truth.skins[touch.link][0].taxels.ids.index(touch.taxel)
                    chosen.append(truth.touch(touch.link, row, touch.positions))
                found = fitted(truth, chosen, spot, robot, skins)
                text = f"10 random, {len(chosen) - 10} planned"
                results.setdefault(text, []).append(compared(truth, found, skins))
        for text, parts in sorted(results.items()):
            print(f"{name}, {text}, {options.seeds} sessions: {summary(parts)}", flush=True)


def fitted(truth: Truth, touches: Sequence, spot: float, robot: Robot, skins: dict[str, LinkCalibration]) -> SelfTouch:
    """Return what the package states about a session."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "session.csv"
        path.write_text(truth.table(touches, spot))
        return fit_self_touch(robot, read_session(path, robot, skins))


def summary(parts: list[dict[str, Array]]) -> str:
    """Return errors and coverage in words."""
    taxels, sigma, joints, joint_sigma, learnt, *bounds = (
        np.concatenate([part[key] for part in parts]) for key in parts[0]
    )
    (z, q), known = (np.abs(taxels) / sigma, np.abs(joints) / joint_sigma), joints[learnt > 0.5]
    inside = [f"{100 * (x < 1).mean():.0f}, {100 * (x < 2).mean():.0f} %" for x in (z, q)]
    return (
        f"taxels {rms(taxels) * 1e3:.2f} mm per axis (bound {rms(bounds[0]) * 1e3:.2f}), joints "
        f"{np.rad2deg(rms(joints)):.2f} degrees (bound {np.rad2deg(rms(bounds[1])):.2f}), those that the "
        f"touches determine ({len(known)} of {len(joints)}) {np.rad2deg(rms(known)):.2f}; within one, two standard "
        f"errors: taxels {inside[0]}, joints {inside[1]}"
    )


def rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))


# The Nao: joints of the right arm, and rows (a, d, alpha, theta) from the torso to the finger [m, rad]; the first has
# no joint.
NAO = ROOT.parent / "shared" / "data" / "touch" / "nao"
ARM = ("RShoulderPitch", "RShoulderRoll", "RElbowYaw", "RElbowRoll", "RWristYaw")
ROWS = (
    (0, 0.1, -np.pi / 2, 0),
    (0, -0.098, np.pi / 2, 0),
    (0, 0, np.pi / 2, np.pi / 2),
    (-0.015, 0.105, -np.pi / 2, 0),
    (0, 0, np.pi / 2, 0),
    (0, 0.1137, -np.pi / 2, np.pi),
)
MOUNT, MOUNTED = (0.0646, 0.0006, 0.0468), (-0.0012, 0.0427, 0.0005)  # position, rotation vector [m, rad]
TRIANGLES = (*range(6), *range(8, 19), *range(24, 32))
PLACES = [place for place in range(12) if place not in (6, 10)]  # of taxels in a triangle


def nao_urdf() -> str:
    """Return the right arm as a URDF: the rows without their first rotation are the origins of the joints."""
    parts, above = ['<link name="torso"/>'], "torso"
    for k, (a, d, alpha, theta) in enumerate(ROWS):
        turn, tilt = Rotation.from_euler("z", theta), Rotation.from_euler("x", alpha)
        x, y, z = turn.apply((a, 0, 0)) + (0, 0, d)
        roll, pitch, yaw = (turn * tilt).as_euler("xyz")
        origin = f'<origin xyz="{x} {y} {z}" rpy="{roll} {pitch} {yaw}"/><parent link="{above}"/>'
        parts.append(f'<link name="l{k}"/><joint name="fixed{k}" type="fixed">{origin}<child link="l{k}"/></joint>')
        above = f"l{k}"
        if k < len(ARM):
            joint = f'<axis xyz="0 0 1"/><parent link="{above}"/><child link="m{k}"/>'
            parts.append(f'<link name="m{k}"/><joint name="{ARM[k]}" type="continuous">{joint}</joint>')
            above = f"m{k}"
    return '<robot name="nao">' + "".join(parts) + "</robot>"


def nao_skin() -> LinkCalibration:
    """Return the taxels of both halves of the torso in the frame of the torso."""
    rows = np.loadtxt(NAO / "torso.txt")
    patches = []
    for half, name in enumerate(("left", "right")):
        mine = [k for k, triangle in enumerate(TRIANGLES) if (triangle >= 16) == bool(half)]
        local = [rows[28 + 10 * k : 38 + 10 * k] + rows[3 + k] + rows[1 + half] for k in mine]
        points = Rotation.from_rotvec(MOUNTED).apply(np.concatenate(local)) + MOUNT
        _, near = cKDTree(points).query(points, k=8)
        arms = points[near] - points[near].mean(axis=1, keepdims=True)
        normals = np.linalg.svd(arms)[2][:, 2]
        normals *= np.sign((normals * (points * (1, 1, 0))).sum(axis=1))[:, None]  # out of the torso
        tangents = np.cross((0.0, 0.0, 1.0), normals)
        tangents /= np.linalg.norm(tangents, axis=1)[:, None]
        across, count = np.cross(normals, tangents), len(points)
        pitch = float(np.median(np.linalg.norm(points[near[:, 1]] - points, axis=1)))
        signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        taxels = TaxelArray(
            ids=tuple(f"t{12 * TRIANGLES[k] + place}" for k in mine for place in PLACES),
            channels=np.array([12 * TRIANGLES[k] + place for k in mine for place in PLACES]),
            index=np.column_stack((np.arange(count), np.zeros(count, int))),
            uv=np.zeros((count, 2)),
            positions_link=points,
            normals_link=normals,
            tangents_link=tangents,
            corners_link=np.stack([points + pitch / 2 * (a * tangents + b * across) for a, b in signs], axis=1),
            areas=np.full(count, pitch**2),
            neighbours=((),) * count,
        )
        patches.append(Patch(name, "imported", "", (count, 1), (pitch, pitch), taxels))
    return LinkCalibration("torso", MeshSource("torso.stl", "0" * 64, 0, 0), (), tuple(patches))


def nao_tables() -> tuple[list[str], list[str]]:
    """Return the lines above the touches, and a line for each touch."""
    touches = loadmat(NAO / "torso_rightFinger.mat", struct_as_record=False, squeeze_me=True)["torso"]
    lines = [
        ",".join((" ".join(f"t{k}" for k in np.atleast_1d(touch.activatedTaxels)),
                  *(f"{getattr(touch.angles, name):.6f}" for name in ARM)))
        for touch in touches
    ]  # fmt: skip
    return ["# tip: finger l5 0 0 60 mm", ",".join(("taxel", *ARM))], lines


def nao_medians(count: int, seed: int, folder: Path) -> tuple[float, float]:
    """Return the median distance [m] of 300 touches before and after a fit of others."""
    (folder / "nao.urdf").write_text(nao_urdf())
    robot, skins, (head, lines) = read_robot(folder / "nao.urdf"), {"torso": nao_skin()}, nao_tables()
    order, sessions = np.random.default_rng(seed).permutation(len(lines)), []
    for rows in (order[:300], order[300 : 300 + count]):
        (folder / "nao.csv").write_text("\n".join((*head, *(lines[k] for k in rows))) + "\n")
        sessions.append(read_session(folder / "nao.csv", robot, skins))
    found = fit_self_touch(robot, sessions[1])
    nominal = replace(found, values=np.zeros(len(found.values)))
    before, after = (np.median(one.distances(sessions[0])) for one in (nominal, found))
    return float(before), float(after)


def of_nao(options: argparse.Namespace) -> None:
    """Print the distances of touches of the Nao that were not used."""
    if not NAO.is_dir():
        print(f"Nao: {NAO} is not there; skipped")
        return
    with tempfile.TemporaryDirectory() as folder:
        for count in (20, 50, 200):
            found = np.array([nao_medians(count, options.seed + k, Path(folder)) for k in range(options.seeds)]) * 1e3
            low, high = found[:, 1].min(), found[:, 1].max()
            print(f"Nao, {count} touches, {options.seeds} draws: median {found[:, 0].mean():.1f} mm before, "
                  f"{found[:, 1].mean():.2f} mm after ({low:.2f} to {high:.2f})", flush=True)  # fmt: skip


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
    for name in options.robot or (*SCENES, "Nao"):
        if name == "Nao":
            of_nao(options)
        else:
            (planned if options.planned else of_robot)(name, options)


if __name__ == "__main__":
    main()
