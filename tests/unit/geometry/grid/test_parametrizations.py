"""Parametrizations: the planes and rays of a tube and of a face."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.geometry.grid.parametrizations import FaceParametrization, TubeParametrization, parametrized_lines
from skin_calib_addon.geometry.sampling.frames import frame_of
from tests.shapes import TURN, Motion

seeds = st.integers(0, 2**32 - 1)


def parametrizations(seed):
    """A closed tube, a sector and a face, anywhere."""
    motion = Motion(seed)
    axes = motion.rotation.T
    frame = frame_of(motion.shift, axes[2], axes[0])
    rng = np.random.default_rng(seed)
    start = float(rng.uniform(-3, 3))
    return (
        TubeParametrization(frame, (0.01, 0.09)),
        TubeParametrization(frame, (0.01, 0.09), (start, start + float(rng.uniform(0.3, 6)))),
        FaceParametrization(motion.shift, *axes, (-0.02, 0.07), (0.01, 0.05)),
    )


@given(seed=seeds)
def test_rays_of_parametrizations_lie_in_their_planes(seed):
    """Origins and unit directions, at every pair of s and t."""
    for parametrization in parametrizations(seed):
        s, t = np.linspace(*parametrization.span, 5), np.linspace(*parametrization.breadth, 9)
        origins, rays = parametrization.rays(s, t)
        planes = parametrization.planes(s)
        assert origins.shape == rays.shape == (5, 9, 3)
        off = (origins - planes.points[:, None]) * planes.normals[:, None]
        assert np.abs(off.sum(axis=2)).max() < 1e-15
        assert np.abs((rays * planes.normals[:, None]).sum(axis=2)).max() < 1e-15
        assert_allclose(np.linalg.norm(rays, axis=2), 1, rtol=1e-14)


@given(seed=seeds)
def test_parametrizations_are_oriented_outward(seed):
    """A step along s, crossed with a step along t, points along the ray."""
    for parametrization in parametrizations(seed):
        s, t = np.linspace(*parametrization.span, 5), np.linspace(*parametrization.breadth, 40)
        origins, rays = parametrization.rays(s, t)
        points = origins + 0.05 * rays
        outward = np.cross(points[1:, :-1] - points[:-1, :-1], points[:-1, 1:] - points[:-1, :-1])
        assert ((outward * rays[:-1, :-1]).sum(axis=2) > 0).all()


@given(seed=seeds)
def test_sector_parametrization_runs_from_its_last_angle_to_its_first(seed):
    """t = 0 is where the sector stops, and t at the far end where it starts: clockwise about the axis."""
    whole, sector, _ = parametrizations(seed)
    assert whole.closed and not sector.closed
    assert whole.breadth == (0.0, TURN)
    first, last = (sector.angles(np.array(sector.breadth)) - sector.sector[1]).tolist()
    assert first == 0.0 and abs(last + np.ptp(sector.sector)) < 1e-12
    assert_allclose(whole.rays(np.zeros(1), np.zeros(1))[1][0, 0], whole.frame.e1, atol=1e-15)


def test_parametrization_lines_are_named_for_the_author():
    """Half-planes by degrees from 0 to below 360, those a degree apart by names of their own; planes by number."""
    tube, face = (
        TubeParametrization(frame_of(np.zeros(3), np.array((0, 0, 1.0))), (0, 1)),
        FaceParametrization(*np.eye(4, 3), (0, 1), (0, 1)),
    )
    for t in (np.deg2rad((0.0, 0.02, 90.0, 359.0, 359.99)), TURN * np.arange(160) / 160, np.deg2rad(np.arange(60.0))):
        degrees = np.array(
            [float(name.removeprefix("half-plane at ").removesuffix(" degrees")) for name in tube.names(t)]
        )
        assert (degrees >= 0).all() and (degrees < 360).all()
        assert np.abs(np.exp(1j * np.deg2rad(degrees)) - np.exp(-1j * t)).max() < np.deg2rad(0.51)
    assert len({*tube.names(TURN * np.arange(160) / 160)}) == 160
    assert face.names(np.zeros(3)) == ("v-plane 0", "v-plane 1", "v-plane 2")
    assert parametrized_lines(tube, np.arange(4.0), np.arange(3.0)).closed
    assert not parametrized_lines(face, np.arange(4.0), np.arange(3.0)).closed
