"""The adaptive threshold of the paper (section 3.2) compared with the thresholds that the runtime learns.

    python benchmarks/adaptive.py [--frames N] [--seed N]

The paper filters the image of 6 x 22 readings of 8 bits with OpenCV's ``adaptiveThreshold``: a cell counts if its
reading exceeds the mean of a square block around it by a constant number of counts. The paper gives neither the block
nor the constant, so that the table has three of each. OpenCV repeats the border; so does this.

The readings have a noise of 2 counts, offsets up to 3 counts and a clipping at 0. The table has the fraction of cells
that count where all of them are loaded, and the fraction of frames at rest in which a cell counts.
"""

import argparse
from dataclasses import replace

import numpy as np
from cycle import Scene
from scipy.ndimage import uniform_filter

from skin_calib_addon.calibration import ResponseTable
from skin_calib_addon.runtime import Skin

Array = np.ndarray
ROWS, COLUMNS = 6, 22
FULL = 20.0  # [N] force of a cell at 255 counts
NOISE, OFFSET = 2.0, 3.0  # [counts]
BLOCKS = (3, 5, 11)  # [cells] side of the block
CONSTANTS = (2.0, 8.0, 16.0)  # [counts]


def counts(forces: Array) -> Array:
    """Return readings without noise of forces [N]."""
    return 255 * (1 - (1 - np.clip(forces / FULL, 0, 1)) ** 3)


def by_block(readings: Array, side: int, constant: float) -> Array:
    """Return which cells (frames, n) exceed the mean of their block by a constant number of counts."""
    images = readings.reshape(-1, ROWS, COLUMNS).astype(float)
    mean = np.rint(uniform_filter(images, (0, side, side), mode="nearest"))
    return (images > mean + constant).reshape(readings.shape)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="the adaptive threshold of the paper compared with learned ones")
    parser.add_argument("--frames", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng, n = np.random.default_rng(options.seed), ROWS * COLUMNS
    force, offsets = np.linspace(0, FULL, 200), rng.uniform(-OFFSET, OFFSET, n)

    def read(forces: Array) -> Array:
        noisy = counts(forces) + offsets + NOISE * rng.normal(size=forces.shape)
        return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)

    flat = Scene("sheet", ROWS, COLUMNS, np.zeros((1, n))).calibration
    skin = Skin(replace(flat, response=ResponseTable(tuple(counts(force)), tuple(force))))
    skin.tare(read(np.zeros((250, n))))
    rest = read(np.zeros((options.frames, n)))
    loaded = read(np.tile(rng.uniform(1, 4, (options.frames, 1)), n))
    print(f"{'method':26} {'loaded':>8} {'at rest':>8}")

    def line(name: str, pressed: Array, ghosts: Array) -> None:
        print(f"{name:26} {pressed.mean():8.1%} {ghosts.any(axis=1).mean():8.1%}", flush=True)

    line("learned", skin.batch(loaded).active, skin.batch(rest).active)  # the readings have no order
    for side in BLOCKS:
        for constant in CONSTANTS:
            line(f"block {side:2}, {constant:4.0f} counts", *(by_block(x, side, constant) for x in (loaded, rest)))


if __name__ == "__main__":
    main()
