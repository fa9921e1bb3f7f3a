"""Overlaps of boards in space, and largest sets without them."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.skin import HexLattice
from skin_calib_addon.skin.boards.overlap import largest_apart, overlapping

BOARD = HexLattice(0.01, 0.0)
UP, ALONG = np.array((0, 0, 1.0)), np.array((1.0, 0, 0))


def pair(distance, heading, tilt=0.0, half=0.0, lattice=BOARD):
    """Return the overlaps of two boards on a circular bend: a distance apart, each tilted away from the other."""
    ahead = np.array((np.cos(heading), np.sin(heading), 0))
    normals = np.stack([np.cos(tilt) * UP + sign * np.sin(tilt) * ahead for sign in (-1, 1)])
    tangents = ALONG - (normals @ ALONG)[:, None] * normals
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    positions = np.stack((-ahead, ahead)) * distance / 2
    return overlapping(positions, normals, tangents, lattice, half)


@given(depth=st.floats(-0.002, 0.002), heading=st.sampled_from([0.0, np.pi / 3, np.pi]))
def test_flat_boards_overlap_by_what_the_pitch_lacks(depth, heading):
    """Side to side, the depth is the difference from the pitch; boards that touch do not overlap."""
    pairs, depths, axes = pair(BOARD.pitch - depth, heading)
    assert len(pairs) == (depth > 1e-5)
    if len(pairs):
        assert_allclose(depths, depth, atol=1e-12)
        assert_allclose(np.abs(axes[0] @ (np.cos(heading), np.sin(heading), 0)), 1, atol=1e-9)


@pytest.mark.parametrize("half", [0.0, 0.001])
@pytest.mark.parametrize("tilt", [0.05, 0.2])
def test_thick_boards_on_a_ridge_overlap_with_their_lower_faces(tilt, half):
    """Their sides meet where the planes of the lower faces do: apart by the pitch times cos + 2 half sin."""
    touch = BOARD.pitch * np.cos(tilt) + 2 * half * np.sin(tilt)
    assert len(pair(touch + 1e-6, 0.0, tilt, half)[0]) == 0
    assert_allclose(pair(touch - 1e-4, 0.0, tilt, half)[1], 1e-4, atol=1e-9)
    assert_allclose(pair(touch - 1e-4, 0.0, -tilt, half)[1], 1e-4, atol=1e-9)  # a trough


def test_trimmed_boards_have_the_width_of_the_pitch():
    """Boards of the thesis are closer together than their outlines."""
    trimmed = HexLattice(0.01, -0.001)
    assert len(pair(trimmed.pitch, 0.0, lattice=trimmed)[0]) == 0
    assert_allclose(pair(trimmed.pitch - 5e-4, 0.0, lattice=trimmed)[1], 5e-4, atol=1e-12)


def test_boards_on_two_sides_of_a_thin_part_do_not_overlap():
    """Back to back, they overlap only if the part is thinner than they are."""
    normals, tangents = np.stack((UP, -UP)), np.stack((ALONG, ALONG))
    for gap, overlaps in ((0.003, 0), (0.0015, 1)):
        positions = np.array(((0, 0, gap / 2), (0.002, 0.001, -gap / 2)))
        assert len(overlapping(positions, normals, tangents, BOARD, 0.001)[0]) == overlaps


@given(seed=st.integers(0, 2**32 - 1))
def test_largest_set_is_that_of_all_subsets(seed):
    """No larger subset without a conflict exists, and the set has none."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 9))
    conflicts = np.array([p for p in combinations(range(count), 2) if rng.random() < 0.4], int).reshape(-1, 2)
    kept = largest_apart(count, conflicts)
    assert not kept[conflicts].all(axis=1).any()
    sets = [np.isin(np.arange(count), s) for k in range(count + 1) for s in combinations(range(count), k)]
    assert kept.sum() == max(s.sum() for s in sets if not s[conflicts].all(axis=1).any())


def test_of_equal_sets_the_first_boards_are_kept():
    """Of two boards the first one stays; of a ring of four, the first and the third."""
    assert largest_apart(3, np.array([(0, 1)])).tolist() == [True, False, True]
    assert largest_apart(4, np.array([(0, 1), (1, 2), (2, 3), (0, 3)])).tolist() == [True, False, True, False]
