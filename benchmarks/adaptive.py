"""The adaptive threshold of the paper (section 3.2) compared with the thresholds that the runtime learns.

    python benchmarks/adaptive.py [--frames N] [--seed N]

The paper filters the image of 6 x 22 readings of 8 bits with OpenCV's ``adaptiveThreshold``: a cell counts if its
reading exceeds the mean of a square block around it by a constant number of counts. The paper gives neither the block
nor the constant, so that the table has three of each. OpenCV repeats the border; so does this.

The readings have a noise of 2 counts, offsets up to 3 counts and a clipping at 0, as the simulated forearm of the
independent simulator has them. Its presses are used where they are present, otherwise a finger of the same size. For
each scene the table has the fraction of cells above the detection limit that count, the fraction of frames in which a
free cell counts, and the mean error of the force on the cells that count, relative to the true force.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from cycle import Scene
from scipy.ndimage import uniform_filter

from skin_calib_addon.calibration import ResponseTable
from skin_calib_addon.runtime import Skin

Array = np.ndarray
SHARED = Path(__file__).resolve().parents[1] / ".." / "shared" / "data" / "truth" / "forearm_single.npz"
ROWS, COLUMNS = 6, 22
FULL = 20.0  # [N] force of a cell at 255 counts
NOISE, OFFSET = 2.0, 3.0  # [counts]
BLOCKS = (3, 5, 11)  # [cells] side of the block
CONSTANTS = (2.0, 8.0, 16.0)  # [counts]


def counts(forces: Array) -> Array:
    """Return readings without noise of forces [N]."""
    return 255 * (1 - (1 - np.clip(forces / FULL, 0, 1)) ** 3)


def scenes(frames: int, rng: np.random.Generator) -> dict[str, Array]:
    """Return the forces (frames, n) of each scene [N]."""
    y, x = np.indices((ROWS, COLUMNS))
    centres = rng.uniform((0, 0), (ROWS - 1, COLUMNS - 1), (frames, 2))[:, :, None, None]
    radii = rng.choice((0.5, 0.8, 1.2), (frames, 1, 1))
    finger = rng.uniform(1, 8, (frames, 1, 1)) * np.maximum(
        1 - ((y - centres[:, 0]) ** 2 + (x - centres[:, 1]) ** 2) / (2 * radii) ** 2, 0
    )
    if SHARED.is_file():
        with np.load(SHARED) as file:
            finger = file["cell_force"][rng.permutation(len(file["cell_force"]))[:frames]]
    hand = rng.uniform(1, 4, (frames, 1, 1)) * ((y >= 1) & (y < 5) & (x >= 6) & (x < 14))
    all_cells = rng.uniform(1, 4, (frames, 1, 1)) * np.ones((ROWS, COLUMNS))
    found = {"rest": np.zeros((frames, ROWS, COLUMNS)), "finger": finger, "4 x 8 cells": hand, "all cells": all_cells}
    return {name: forces.reshape(-1, ROWS * COLUMNS) for name, forces in found.items()}


def by_block(readings: Array, side: int, constant: float) -> Array:
    """Return which cells (frames, n) exceed the mean of their block by a constant number of counts."""
    images = readings.reshape(-1, ROWS, COLUMNS).astype(float)
    mean = np.rint(uniform_filter(images, (0, side, side), mode="nearest"))
    return (images > mean + constant).reshape(readings.shape)


def row(active: Array, felt: Array, true: Array, limit: Array) -> str:
    """Return three figures of a method and a scene."""
    heavy, free = true > limit, true == 0
    found = f"{active[heavy].mean():7.1%}" if heavy.any() else "      -"
    ghosts = f"{(active & free).any(axis=1).mean():7.1%}" if free.any() else "      -"
    pressed = true.sum(axis=1) > 0
    errors = np.abs((active * felt).sum(axis=1) - true.sum(axis=1))[pressed] / true.sum(axis=1)[pressed]
    return f"{found} {ghosts} {f'{errors.mean():7.1%}' if pressed.any() else '      -'}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="the adaptive threshold of the paper compared with learned ones")
    parser.add_argument("--frames", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    force = np.linspace(0, FULL, 200)
    table = ResponseTable(tuple(counts(force)), tuple(force))
    flat = Scene("sheet", ROWS, COLUMNS, np.zeros((1, ROWS * COLUMNS))).calibration
    offsets = rng.uniform(-OFFSET, OFFSET, ROWS * COLUMNS)

    def read(forces: Array) -> Array:
        noisy = counts(forces) + offsets + NOISE * rng.normal(size=forces.shape)
        return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)

    rest = read(np.zeros((250, ROWS * COLUMNS)))
    cases = scenes(options.frames, rng)
    readings = {name: read(forces) for name, forces in cases.items()}
    skin = Skin(replace(flat, response=table))
    skin.tare(rest)
    limit = skin.noise.detection_limits
    print(f"median detection limit {np.median(limit):.2f} N; found, frames with ghosts, error of the force")
    print(f"{'method':26}" + "".join(f"{name:>26}" for name in cases))
    cells = []
    for name, forces in cases.items():
        result = skin.batch(readings[name])  # the presses have no order
        cells.append(row(result.active, result.forces, forces, limit))
    print(f"{'learned':26}" + "".join(f"{cell:>26}" for cell in cells), flush=True)
    for side in BLOCKS:
        for constant in CONSTANTS:
            cells = [
                row(by_block(readings[name], side, constant), table.newtons(readings[name]), forces, limit)
                for name, forces in cases.items()
            ]
            print(
                f"block {side:2}, {constant:4.0f} counts       " + "".join(f"{cell:>26}" for cell in cells), flush=True
            )


if __name__ == "__main__":
    main()
