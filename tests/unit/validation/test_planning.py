"""The next touch: where it lowers the largest standard error, and what it is worth."""

import numpy as np
import pytest

from skin_calib_addon.validation import next_touch, placements, summarize
from skin_calib_addon.validation.flat import flat_places
from skin_calib_addon.validation.registration import moves_of
from tests.samples import boards, sheet, small_calibration
from tests.unit.validation.test_touches import CALIBRATION, SHEET, on_sheet, touched

FLAT = flat_places(SHEET, SHEET.taxels.index)
MOVES = moves_of(FLAT)


def compared(rows, rng):
    """Return the touches of `SHEET` at random points of some cells."""
    rows = np.array(rows, int)
    points = FLAT[rows] + rng.uniform(-0.5, 0.5, (len(rows), 2)) * 0.01
    return placements(CALIBRATION, touched(CALIBRATION, rows, on_sheet(*points.T)))[0]


def largest(placement):
    """Return the largest standard error of a taxel [m]."""
    variances = np.linalg.eigvalsh(MOVES @ placement.posterior.covariance @ MOVES.transpose(0, 2, 1))
    return np.sqrt(variances.max())


def test_planned_touches_are_worth_more_than_random_ones():
    """In 5 sets of 12 touches they have smaller standard errors, and no cell is touched twice."""
    planned, random = [], []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        rows = [int(rng.integers(len(FLAT)))]
        while len(rows) < 12:
            rows.append(next_touch(compared(rows, rng)).row)
        assert len(set(rows)) == 12
        planned.append(largest(compared(rows, rng)))
        random.append(largest(compared(rng.integers(0, len(FLAT), 12), rng)))
    assert np.mean(planned) < 0.8 * np.mean(random)


def test_next_touch_is_at_the_other_end():
    """After touches of the first columns it is in the last one; its standard errors are those before and after."""
    rng = np.random.default_rng(0)
    placement = compared(np.flatnonzero(SHEET.taxels.index[:, 1] < 2), rng)
    found = next_touch(placement)
    assert SHEET.taxels.index[found.row][1] == SHEET.taxels.index[:, 1].max()
    assert found.before == pytest.approx(largest(placement), rel=0.02) and found.after < 0.8 * found.before
    assert f"touch {SHEET.taxels.ids[found.row]} next: the largest standard error" in list(summarize(placement))[-1]


def test_a_small_patch_has_a_next_touch_and_imported_taxels_have_none():
    """Also if all cells were touched, or only one of a single row."""
    for patch in (boards(2), sheet(1, 3, 0.01)):
        calibration = small_calibration(patches=(patch,))
        for rows in ([0], list(range(len(patch.taxels.ids))) * 3):
            touches = touched(calibration, np.array(rows), patch.taxels.positions_link[rows])
            (placement,) = placements(calibration, touches)
            assert 0 < next_touch(placement).after < next_touch(placement).before
    object.__setattr__(placement.patch, "kind", "imported")
    assert next_touch(placement) is None
