"""Scenes of a rigid sole on a layer of springs: forces of the taxels, contact and CoP, from no formula of the runtime.

Each taxel has 54 small pads. A pad at the height d below the ground carries ``STIFFNESS * d``; it does not pull. The
height and the two tilts of the sole follow from the load: they minimize the elastic energy.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from skin_calib_addon.calibration import LinkCalibration, MeshSource, Patch, TaxelArray
from skin_calib_addon.runtime import convex_hull

Array = np.ndarray
SIDE = 0.016308  # [m] of a hexagonal board
ROWS = (8, 9, 8, 9, 8)  # boards in each row of the sole
STIFFNESS = 4e3  # [N/m] of a pad; on flat ground it has no effect on the forces
PERIOD = 0.004  # [s] between frames


@dataclass(frozen=True, eq=False)
class Scene:
    """Truth of a sole, frame by frame, in the frame of the sole."""

    name: str
    times: Array  # (t,) [s]
    forces: Array  # (t, n) of the taxels [N]
    hulls: list[Array]  # (k, 2) of the pads in contact [m]
    cops: Array  # (t, 2) [m]


def sole() -> LinkCalibration:
    """Return the calibration of a sole of 42 boards; the response is the caller's."""
    positions, corners = boards()
    n = len(positions)
    ids = tuple(f"sole.{i}" for i in range(n))
    apart = np.linalg.norm(positions[:, None] - positions, axis=2)
    taxels = TaxelArray(
        ids,
        np.arange(n),
        np.column_stack((np.zeros(n, int), np.arange(n))),
        np.zeros((n, 2)),
        np.column_stack((positions, np.zeros(n))),
        np.tile((0.0, 0.0, -1.0), (n, 1)),
        np.tile((1.0, 0.0, 0.0), (n, 1)),
        np.concatenate((corners[:, ::-1], np.zeros((n, 6, 1))), axis=2),
        np.full(n, 1.5 * np.sqrt(3) * SIDE**2),
        tuple(tuple(ids[j] for j in np.flatnonzero((row > 0) & (row < 1.1 * np.sqrt(3) * SIDE))) for row in apart),
    )
    patch = Patch("sole", "imported", "sole", (1, n), (SIDE, SIDE), taxels)
    return LinkCalibration("left_sole", MeshSource("sole.stl", "0" * 64, 0, 0), (), (patch,))


def boards() -> tuple[Array, Array]:
    """Return the centres (n, 2) and corners (n, 6, 2) of the boards."""
    wide, tall = np.sqrt(3) * SIDE, 1.5 * SIDE
    centres = np.array(
        [((j - (count - 1) / 2) * wide, (i - 2) * tall) for i, count in enumerate(ROWS) for j in range(count)]
    )
    angle = np.deg2rad(30 + 60 * np.arange(6))
    return centres, centres[:, None] + SIDE * np.stack((np.cos(angle), np.sin(angle)), axis=1)


def pads() -> Array:
    """Return the centres (n, 54, 2) of the pads: each of the six triangles of a board has nine."""
    centres, corners = boards()
    weights = [
        np.array((3 * i + 1 + up, 3 * j + 1 + up)) / 9 for up in (0, 1) for i in range(3) for j in range(3 - i - up)
    ]
    first, second = corners - centres[:, None], np.roll(corners, -1, axis=1) - centres[:, None]
    a, b = np.array(weights).T
    spots = first[:, :, None] * a[:, None] + second[:, :, None] * b[:, None]
    return centres[:, None] + spots.reshape(len(centres), -1, 2)


PADS = pads()


def stand(name: str, ground: Array, loads: Array, points: Array, period: float = PERIOD) -> Scene:
    """Return the frames of a sole on a ground.

    Parameters
    ----------
    name : str
        Of the scene.
    ground : array, shape (n, 54)
        Height of the ground below each pad [m]; -inf where there is none.
    loads, points : array, shape (t,) and (t, 2)
        Force on the sole [N], and where it acts [m].
    period : float
        Between frames [s].
    """
    arms = np.column_stack((np.ones(PADS.size // 2), PADS.reshape(-1, 2)))
    heights, pose = ground.ravel(), np.array((ground.max() + 1e-4, 0.0, 0.0))
    forces, hulls, cops = [], [], []
    for load, point in zip(loads, points):
        pressed = np.zeros(len(arms))
        if load > 0:
            pose = equilibrium(arms, heights, load * np.array((1.0, *point)), pose)
            pressed = STIFFNESS * np.maximum(heights - arms @ pose, 0.0)
        touched = PADS.reshape(-1, 2)[pressed > 0]
        forces.append(pressed.reshape(len(PADS), -1).sum(axis=1))
        hulls.append(convex_hull(touched).corners)
        cops.append(pressed @ arms[:, 1:] / pressed.sum() if load > 0 else np.full(2, np.nan))
    return Scene(name, period * np.arange(len(loads)), np.array(forces), hulls, np.array(cops))


def equilibrium(arms: Array, heights: Array, load: Array, pose: Array) -> Array:
    """Return height [m] and slopes of the sole under a load (3,): the minimum of the energy, by damped Newton steps."""

    def energy(x: Array) -> float:
        return float(STIFFNESS / 2 * (np.maximum(heights - arms @ x, 0) ** 2).sum() + load @ x)

    for _ in range(200):
        deep = heights - arms @ pose
        active = deep > 0
        gradient = load - STIFFNESS * deep[active] @ arms[active]
        if np.abs(gradient).max() < 1e-7 * load[0]:
            break
        curvature = STIFFNESS * arms[active].T @ arms[active] + STIFFNESS * np.diag((1e-3, 1e-6, 1e-6))
        step, size, before = np.linalg.solve(curvature, gradient), 1.0, energy(pose)
        while energy(pose - size * step) > before - 1e-4 * size * gradient @ step and size > 1e-6:
            size /= 2
        pose = pose - size * step
    return pose


def walk(rng: np.random.Generator, frames: int, period: float, centre: Array, amplitude: Array) -> tuple[Array, Array]:
    """Return loads (t,) from 100 to 900 N and points (t, 2) that move smoothly about a centre."""
    t = period * np.arange(frames)
    phase, rate = rng.uniform(0, 7, (3, 3)), rng.uniform(0.2, 0.9, (3, 3))
    waves = np.sin(2 * np.pi * rate * t[:, None, None] + phase).mean(axis=2) * 1.7
    loads = 500 + 400 * np.clip(waves[:, 0], -1, 1)
    return loads, centre + amplitude * np.clip(waves[:, 1:], -1, 1)


def scenes(frames: int, period: float, seed: int) -> Iterator[Scene]:
    """Yield the sole on flat ground, on the edge of a step, on a beam and on pebbles."""
    rng = np.random.default_rng(seed)
    x, y = PADS[..., 0], PADS[..., 1]
    flat = np.zeros(x.shape)
    yield stand("flat", flat, *walk(rng, frames, period, np.zeros(2), np.array((0.07, 0.035))), period)
    for name, spread, centre in (("half", (0.03, 0.03), (-0.06, 0.0)), ("lateral", (0.06, 0.01), (0.0, 0.035))):
        turn, shift = rng.uniform(-0.3, 0.3), rng.uniform(-0.02, 0.02)
        side = (x if name == "half" else -y) * np.cos(turn) + (y if name == "half" else x) * np.sin(turn)
        ground = np.where(side < shift, 0.0, -np.inf)
        yield stand(name, ground, *walk(rng, frames, period, np.array(centre), np.array(spread)), period)
    turn = rng.uniform(-0.5, 0.5)
    beam = np.where(np.abs(x * np.cos(turn) + y * np.sin(turn)) < 0.06, 0.0, -np.inf)
    yield stand("beam", beam, *walk(rng, frames, period, np.zeros(2), np.array((0.03, 0.03))), period)
    stones = np.array([(-0.07, -0.03), (-0.05, 0.035), (0.07, 0.0)]) + rng.uniform(-0.012, 0.012, (3, 2))
    apart = np.linalg.norm(PADS[:, :, None] - stones, axis=3)
    pebbles = (np.sqrt(np.maximum(0.02**2 - apart**2, 0)) - 0.02).max(axis=2)
    pebbles = np.where(apart.min(axis=2) < 0.02, pebbles, -np.inf)
    centre = stones.mean(axis=0)
    yield stand("pebbles", pebbles, *walk(rng, frames, period, centre, np.array((0.015, 0.008))), period)


def steps(frames: int, period: float, seed: int) -> tuple[Scene, Scene]:
    """Return two soles on flat ground; the weight moves from one to the other and back, each carries 0 to 700 N."""
    rng = np.random.default_rng(seed)
    t = period * np.arange(frames)
    fraction = np.clip(0.5 + 0.6 * np.sin(2 * np.pi * 0.5 * t + rng.uniform(0, 7)), 0.0, 1.0)
    feet = []
    for k, weight in enumerate((fraction, 1 - fraction)):
        _, points = walk(rng, frames, period, np.zeros(2), np.array((0.06, 0.03)))
        feet.append(stand(("left", "right")[k], np.zeros(PADS.shape[:2]), 700 * weight, points, period))
    return feet[0], feet[1]
