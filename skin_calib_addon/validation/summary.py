"""Summary of the touches of a patch in words."""

from collections.abc import Iterator

import numpy as np

from ..common.arrays import Array
from .placement import Placement, odds_in_words
from .planning import next_touch
from .registration import Motion


def summarize(placement: Placement) -> Iterator[str]:
    """Yield lines: distances, heights, order, the motion that explains them, the residuals, and what to touch next."""
    if len(placement.rows) == 0:
        return
    distances = placement.distances * 1e3
    mean, rms, largest = distances.mean(), _rms(distances), distances.max()
    yield (
        f"{len(distances)} touches, distance along the skin: mean {mean:.2f}, rms {rms:.2f}, max {largest:.2f} mm; "
        f"rms {placement.expected_rms * 1e3:.2f} mm is expected from the size of the cells"
    )
    if len(placement.heights):
        heights = placement.heights * 1e3
        yield f"height above the taxels: mean {heights.mean():.2f}, standard deviation {np.std(heights):.2f} mm"
    if placement.motion is not None and placement.is_explained:  # a displacement says nothing in a wrong order
        yield from _after_motion(placement, placement.motion)
    if (following := next_touch(placement)) is not None:
        yield (
            f"touch {placement.patch.taxels.ids[following.row]} next: the largest standard error of a taxel is "
            f"{following.before * 1e3:.2f} mm, and {following.after * 1e3:.2f} mm with it"
        )


def _after_motion(placement: Placement, motion: Motion) -> Iterator[str]:
    """Yield lines about the motion that explains the touches."""
    if placement.wiring.is_certain:
        yield f"channels in the planned order, odds {odds_in_words(placement.wiring.odds)}"
    yield _motion(motion)
    residuals = np.delete(placement.residuals, placement.outliers)
    without = f", without {len(placement.outliers)} far from their taxels" if len(placement.outliers) else ""
    yield f"rms {_rms(residuals) * 1e3:.2f} mm after this correction{without}"


def _motion(motion: Motion) -> str:
    (x, y), (dx, dy) = np.round(motion.shift * 1e3, 2) + 0.0, motion.shift_error * 1e3  # no minus zero
    turned = ""
    if np.isfinite(motion.turn_error):
        turn = np.round(np.rad2deg(motion.turn), 2) + 0.0
        turned = f", turned {turn:.2f} +- {np.rad2deg(motion.turn_error):.2f} degrees"
    verdict = "" if motion.is_certain else ": not significant"
    return f"shifted {x:.2f} +- {dx:.2f} mm along the rows, {y:.2f} +- {dy:.2f} mm across{turned}{verdict}"


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
