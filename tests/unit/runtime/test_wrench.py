"""Moving wrenches, and observed components."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.runtime import wrench
from tests.samples import sheet
from tests.soles import skin_of, sole_patch

UP = np.array([0, 0, 1.0])
vectors = st.lists(st.floats(-10, 10), min_size=3, max_size=3).map(np.array)


def pose_of(axis, shift):
    """Return a pose with a rotation vector and a translation."""
    angle = np.linalg.norm(axis)
    x, y, z = axis / angle if angle else UP
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    pose = np.eye(4)
    pose[:3, :3] += np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    pose[:3, 3] = shift
    return pose


@given(force=vectors, point=vectors, axis=vectors, shift=vectors)
def test_moved_wrench_is_that_of_the_moved_force(force, point, axis, shift):
    """A moved, turned or carried wrench equals that of the moved force."""
    pose = pose_of(axis, shift)
    here = np.concatenate((force, np.cross(point, force)))
    moved, pushed = pose[:3, :3] @ point + shift, pose[:3, :3] @ force
    assert_allclose(wrench.carried(here, pose), np.concatenate((pushed, np.cross(moved, pushed))), atol=1e-9)
    assert_allclose(wrench.about(here, shift)[3:], np.cross(point - shift, force), atol=1e-9)
    assert_allclose(wrench.turned(here, pose[:3, :3])[3:], pose[:3, :3] @ here[3:], atol=1e-9)


@given(force=vectors, moment=vectors)
def test_line_of_action_gives_the_wrench_back(force, moment):
    """The nearest point and the free moment give the wrench back.

    A wrench without force has no line (paper eq. 6 to 9).
    """
    line = wrench.line_of_action(np.concatenate((force, moment)))
    if line is None:
        assert np.linalg.norm(force) == 0
        return
    if np.linalg.norm(force) < 1e-3:
        return
    point, free = line
    assert abs(point @ force) < 1e-6 * (1 + np.abs(point).max() * np.abs(force).max())
    again = np.cross(point, force) + free * force / np.linalg.norm(force)
    assert_allclose(again, moment, atol=1e-8)


def test_flat_sole_feels_three_of_six_components():
    """Lateral forces and the moment about the normal are not observed; eq. 4.23 of the thesis claims all six."""
    sole = skin_of(sole_patch())
    assert sole.observable.tolist() == [False, False, True, True, True, False] and sole.rank == 3
    forces = np.random.default_rng(0).uniform(0, 50, 42)
    assert (sole.update(forces, 0.0).wrench[[0, 1, 5]] == 0).all()
    tube = skin_of(sheet(4, 22, 0.01))
    assert tube.observable.tolist() == [True, True, False, True, True, False] and tube.rank == 4
    both = skin_of(sole_patch(), sheet(4, 22, 0.01))
    assert both.rank == 5 and both.observable.tolist() == [True, True, True, True, True, False]


@pytest.mark.parametrize("name", ["about", "carried"])
def test_unknown_wrench_stays_unknown(name):
    """A moved NaN wrench is NaN, not zero."""
    unknown = np.full(6, np.nan)
    assert np.isnan(getattr(wrench, name)(unknown, np.eye(4) if name == "carried" else np.ones(3))).all()
