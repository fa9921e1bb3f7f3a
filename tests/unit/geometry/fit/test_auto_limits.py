"""Tolerances that cannot be met: the achievable error is measured, the same for all of them, and its cause is named."""

import numpy as np
import pytest

from sample_scenes import shapes
from skin_calib_addon.common.errors import UnreachableTolerance
from skin_calib_addon.geometry import SectorGrid, fit_surface, fit_to_tolerance
from skin_calib_addon.geometry.fit.auto import net_size, rounded_up
from skin_calib_addon.geometry.fit.limits import limit_of
from skin_calib_addon.geometry.fit.proof import largest_distance
from skin_calib_addon.geometry.mesh.closest import MeshDistance
from tests.examples import slow
from tests.shapes import RADIUS, TURN, Z_AXIS, cone, cylinder, dome, together, welded, wrist


def lobed(swing):
    """A tube with five lobes that lean over where ``swing`` is above one."""

    def point(angle, height):
        phi, radius = angle + swing / 5 * np.sin(5 * angle), 0.035 + 0.004 * np.cos(5 * angle + 1.2)
        return np.column_stack((radius * np.cos(phi), radius * np.sin(phi), 0.1 * height))

    return welded(shapes.tube_mesh(point, 240, 6))


def stepped():
    """A tube of two radii with a sharp step halfway."""

    def point(angle, height):
        radius = np.where(height < 0.5, 0.035, 0.030)
        return np.column_stack((radius * np.cos(angle), radius * np.sin(angle), 0.1 * height))

    return welded(shapes.tube_mesh(point, 288, 41))


def dense_maximum(fit):
    """The largest distance on a grid that has nothing in common with the samples, edges included."""
    surface = fit.surface
    u, v = np.linspace(0, 1, 131), (np.arange(307) / 307 if surface.closed[1] else np.linspace(0, 1, 307))
    uv = np.column_stack((np.repeat(u, len(v)), np.tile(v, len(u))))
    return float(MeshDistance(fit.mesh)(surface.points(uv[fit.is_trusted(uv)]))[0].max())


@pytest.mark.parametrize(
    ("mesh", "tolerance", "where"),
    [
        (cylinder, 1e-4, {"axis": Z_AXIS, "margin": 0.0}),
        slow(cone, 5e-4, {"axis": Z_AXIS, "margin": 0.002}),
        (wrist, 5e-4, {"axis": Z_AXIS, "margin": 0.004}),
        slow(wrist, 1e-4, {"axis": Z_AXIS, "margin": 0.004}),
        slow(wrist, 3e-4, {"axis": Z_AXIS, "margin": 0.004, "sector": (-1.0, 1.5)}),
        (dome, 2e-4, {"normal": (0.0, 0.0, 1.0)}),
    ],
)
def test_largest_distance_holds_on_another_dense_grid(mesh, tolerance, where):
    """Between the samples and on the edges, too; or the named achievable value holds there."""
    mesh = mesh()
    try:
        fit = fit_to_tolerance(mesh, tolerance, "max", **where)
    except UnreachableTolerance as error:
        tolerance = error.numbers["achievable"]
        fit = fit_to_tolerance(mesh, tolerance, "max", **where)
    assert dense_maximum(fit) <= tolerance * 1.0005


def test_largest_distance_is_that_of_a_dense_grid():
    """It is no less than samples find, and no more than there is."""
    fit = fit_surface(wrist(), SectorGrid(6, 9, -1.0, 1.5, Z_AXIS, 0.003))
    found = largest_distance(fit, MeshDistance(fit.mesh))
    assert dense_maximum(fit) <= found * 1.0005
    assert found >= fit.errors.surface_to_mesh.max


@pytest.mark.parametrize(
    ("mesh", "tolerances", "where"),
    [
        (stepped, (2e-4, 1e-4, 2e-5), {"axis": Z_AXIS, "margin": 0.002}),
    ],
)
def test_achievable_error_is_the_same_for_all_tolerances_and_is_achieved(mesh, tolerances, where):
    """Once a tolerance is refused, smaller ones are, with the same value; asking for the value succeeds, twice."""
    mesh, achievable = mesh(), []
    for tolerance in tolerances:
        try:
            assert fit_to_tolerance(mesh, tolerance, **where).errors.surface_to_mesh.mean <= tolerance
            assert not achievable
        except UnreachableTolerance as error:
            achievable.append(error.numbers["achievable"])
            assert f"{achievable[-1] * 1e3:g} mm" in str(error) and achievable[-1] > tolerance
    if not achievable:
        return
    assert len(set(achievable)) == 1
    fits = [fit_to_tolerance(mesh, achievable[0], **where) for _ in range(2)]
    assert fits[0].errors.surface_to_mesh.mean <= achievable[0]
    assert net_size(fits[0]) == net_size(fits[1])


@pytest.mark.slow
def test_cause_is_a_fold_of_the_section():
    """Lobes that lean over, with the place."""
    with pytest.raises(
        UnreachableTolerance, match=r"because the section folds back behind itself at \(.*half-plane at"
    ):
        fit_to_tolerance(lobed(1.25), 1e-4, "max", axis=Z_AXIS, margin=0.002)


def test_cause_is_a_step():
    """Two radii: the place is on the step, and neither facets nor the axis are blamed."""
    with pytest.raises(UnreachableTolerance, match="because the mesh has steps or edges, the largest at") as caught:
        fit_to_tolerance(stepped(), 2e-5, "max", axis=Z_AXIS, margin=0.002)
    height = float(str(caught.value).split(") mm, near")[0].split(", ")[-1])
    assert 45 < height < 55


def test_cause_are_facets():
    """A tube of 96 sides."""
    with pytest.raises(UnreachableTolerance, match="because the mesh is faceted. Increase the tolerance, or refine"):
        fit_to_tolerance(cylinder(around=96), 1e-6, axis=Z_AXIS, margin=0.002)


@pytest.mark.slow
def test_cause_are_parts():
    """A cover of four loose shells about a shaft: no curve is the outer one."""
    shells = [
        welded(
            shapes.tube_mesh(
                lambda angle, height, i=i: np.column_stack(
                    (
                        RADIUS * np.cos(angle / 5 + i * TURN / 4),
                        RADIUS * np.sin(angle / 5 + i * TURN / 4),
                        0.1 * height,
                    )
                ),
                24,
                6,
            )
        )
        for i in range(4)
    ]
    mesh = together(cylinder(radius=0.02), *shells)
    with pytest.raises(UnreachableTolerance, match="because the outside of the sections consists of several parts"):
        fit_to_tolerance(mesh, 1e-4, axis=Z_AXIS, margin=0.002)


def test_cause_is_an_axis_that_was_misled():
    """An axis that was found, 60 degrees oblique to the surface: it is named, but not if the author gave it."""
    tilted = fit_surface(cylinder(), SectorGrid(5, 8, -0.3, 0.3, None, 0.002))
    cause, advice = limit_of(tilted, True, 1e-6)
    assert "axis" not in cause
    oblique = fit_surface(cone(0.06, 0.01, 0.02), SectorGrid(5, 8, -0.3, 0.3, Z_AXIS, 0.002))
    assert "axis that was found is oblique" in limit_of(oblique, True, 1e-6)[0]
    assert "axis that was found" not in limit_of(oblique, False, 1e-6)[0]
    assert advice


@pytest.mark.parametrize(("value", "expected"), [(0.0342, 0.035), (0.35, 0.35), (0.8801, 0.89), (9.91, 10), (16.0, 16)])
def test_achievable_error_is_rounded_up_to_two_digits(value, expected):
    """So that the value in the message is one that is met."""
    assert rounded_up(value) == expected
