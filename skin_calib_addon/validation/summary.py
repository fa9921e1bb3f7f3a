"""Summary of the touches of a patch in words."""

from collections.abc import Iterator

import numpy as np

from ..common.arrays import Array
from .placement import MIN_TOUCHES, Placement, odds_in_words
from .planning import next_touch
from .registration import MIN_SQUARED_DISTANCE, Motion


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
    if placement.patch.kind == "imported" and len(distances) >= MIN_TOUCHES:
        yield _displacement(placement)
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


def _displacement(placement: Placement) -> str:
    """Return the displacement of an imported skin, whose taxels have no order, as far as it is along the skin."""
    used = np.delete(np.arange(len(placement.rows)), placement.outliers)
    rows = placement.patch.taxels.axes_link[placement.rows[used]].reshape(-1, 3)
    values = placement.offsets[used, :2].ravel()
    moved = np.linalg.lstsq(rows, values, rcond=1e-3)[0]
    variance = float(((values - rows @ moved) ** 2).sum()) / (len(values) - 3)
    covariance = variance * np.linalg.pinv(rows.T @ rows, rcond=1e-6, hermitian=True)
    score = moved @ np.linalg.pinv(covariance, rcond=1e-6, hermitian=True) @ moved
    x, y, z = np.round(moved * 1e3, 2) + 0.0
    error = 1e3 * float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    verdict = "" if score > MIN_SQUARED_DISTANCE else ": not significant"
    return f"displaced by ({x:.2f}, {y:.2f}, {z:.2f}) +- {error:.2f} mm in the link frame{verdict}"


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
