"""Tolerances that cannot be met: the achievable error is measured, the same for all of them, and its cause is named."""

import re
from pathlib import Path

import numpy as np
import pytest

from skin_calib_addon.common.arrays import pairs_of, unit
from skin_calib_addon.common.errors import PoorFit, UnreachableTolerance
from skin_calib_addon.geometry import (
    AutoGrid,
    Axis,
    CoverSpec,
    TubeGrid,
    cut_cover,
    fit_surface,
    fit_to_tolerance,
    load_mesh,
)
from skin_calib_addon.geometry.fit.auto import fit_grid, rounded_up
from skin_calib_addon.geometry.fit.diagnosis import FOLDED_AREA
from skin_calib_addon.geometry.fit.limits import better_axis
from skin_calib_addon.geometry.grid.grids import Sector, Tube
from skin_calib_addon.geometry.mesh.distance import closest
from skin_calib_addon.geometry.mesh.triangle_mesh import weld
from tests.examples import slow
from tests.shapes import (
    RADIUS,
    TURN,
    Z_AXIS,
    Motion,
    cone,
    cylinder,
    dome,
    lobed,
    revolved,
    round_tube,
    swept,
    together,
    wrist,
)

DATA = (Path(__file__).parents[4] / ".." / "shared" / "data").resolve()
FOLDERS = DATA / "meshes", DATA / "robots" / "g1_description" / "meshes"
LINKS = (
    "hrp4c_r_elbow_p.stl",
    "hrp4c_r_wrist_y.stl",
    "hrp4c_r_wrist_y_cover_only.stl",
    "icub27_l_forearm.stl",
    "jvrc1_r_elbow_p.stl",
    "talos_arm_5_forearm_collision.stl",
    "talos_tibia_light.stl",
    "left_elbow_link.STL",
    "left_hip_pitch_link.STL",
    "left_shoulder_pitch_link.STL",
    "left_shoulder_yaw_link.STL",
    "left_wrist_pitch_link.STL",
)


def closed_cone(apex, height, sides, rings):
    """A cone about z from rings of triangles, with a tip of this angle [degrees] and a base."""
    level = np.arange(rings + 1) / rings
    radius = height * np.tan(np.radians(apex) / 2)
    return revolved(np.vstack(((0, 0), np.column_stack((radius * (1 - level), height * level)))), sides)


def stepped():
    """A tube of two radii with a sharp step halfway."""
    return round_tube(lambda a, h: np.where(h < 0.5, 0.035, 0.030), 288, 41)


def dense_maximum(fit):
    """The largest distance on a grid that has nothing in common with the samples, edges included."""
    surface = fit.surface
    u, v = np.linspace(0, 1, 131), (np.arange(307) / 307 if surface.closed[1] else np.linspace(0, 1, 307))
    uv = pairs_of(u, v)
    return float(closest(fit.mesh, surface.points(uv[fit.is_trusted(uv)]))[0].max())


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


@pytest.mark.slow
def test_cause_is_a_fold_of_the_section():
    """Lobes that lean over, with the place."""
    with pytest.raises(
        UnreachableTolerance, match=r"because the section folds back behind itself at \(.*half-plane at"
    ):
        fit_to_tolerance(lobed(1.25), 1e-4, "max", axis=Z_AXIS, margin=0.002)


@pytest.mark.slow
def test_cause_is_a_step():
    """Two radii: the place is on the step, and neither facets nor the axis are blamed."""
    low, high = (np.linspace(*ends, 21) for ends in ((0, 0.049995), (0.050005, 0.1)))  # a step of 10 um
    mesh = revolved(np.column_stack((np.repeat((0.035, 0.030), 21), np.r_[low, high])), 96)
    with pytest.raises(UnreachableTolerance, match="because the mesh has steps or edges, the largest at") as caught:
        fit_to_tolerance(mesh, 1e-4, "max", axis=Z_AXIS, margin=0.002)
    height = float(str(caught.value).split(") mm, near")[0].split(", ")[-1])
    assert 49 < height < 51
    assert caught.value.numbers["achievable"] > 4e-4


@pytest.mark.slow
def test_cause_are_parts():
    """A cover of four loose shells about a shaft: no curve is the outer one."""
    angle = TURN * np.arange(24) / 24 / 5
    shells = [
        swept(RADIUS * np.column_stack((np.cos(angle + i * TURN / 4), np.sin(angle + i * TURN / 4))), 6)
        for i in range(4)
    ]
    mesh = together(cylinder(radius=0.02), *shells)
    with pytest.raises(UnreachableTolerance, match="because the outside of the sections consists of several parts"):
        fit_to_tolerance(mesh, 1e-4, axis=Z_AXIS, margin=0.002)


def test_better_axis_is_found_far_from_the_origin():
    """A link whose frame is 0.3 m from it: the axis of the message goes through the link."""
    link, shift = closed_cone(40, 0.05, 24, 4), np.array((0.3, -0.2, 0.1))
    moved = weld(link.vertices + shift, link.faces)
    wrong = fit_surface(moved, TubeGrid(6, 12, Axis(tuple(shift + (0, 0, 0.0124)), (1.0, 0.0, 0.0))))
    _, advice = better_axis(wrong, Tube(), "mean", 5e-4)
    assert re.search(r"through \(300, -200, 1\d\d(\.\d)?\) mm along \(0, 0, -?1\)", advice), advice


@pytest.mark.slow
@pytest.mark.parametrize(
    ("apex", "sides", "rings", "turned"), [(40, 24, 10, None), slow(40, 24, 1, 3), slow(45, 64, 4, 5)]
)
def test_closed_cone_names_its_axis(apex, sides, rings, turned):
    """The axis that is found is across the cone; the one of the message succeeds."""
    motion = Motion.none() if turned is None else Motion(turned)
    mesh = motion.mesh(closed_cone(apex, 0.05, sides, rings))
    with pytest.raises(UnreachableTolerance, match="because the axis that was found is wrong. Give the axis") as caught:
        fit_to_tolerance(mesh, 5e-4)
    point, direction = (
        tuple(float(x) for x in numbers.split(", "))
        for numbers in re.findall(r"\(([-\d., e]+)\)", str(caught.value))[:2]
    )
    assert abs(np.dot(unit(direction), motion.axis(Z_AXIS).direction)) > 0.999
    given = fit_to_tolerance(mesh, 5e-4, axis=Axis(tuple(np.divide(point, 1e3)), direction))
    assert given.errors.surface_to_mesh.mean <= 5e-4
    assert fit_to_tolerance(mesh, 5e-4, axis=motion.axis(Z_AXIS)).errors.surface_to_mesh.mean <= 5e-4


def test_axis_is_not_blamed_without_a_better_one():
    """An axis of the author, a sector, and an axis that was found and is the best."""
    across = Axis((0.0, 0.0, 0.0124), (1.0, 0.0, 0.0))
    wrong = fit_surface(closed_cone(40, 0.05, 24, 4), TubeGrid(6, 12, across))
    assert better_axis(wrong, Tube(), "mean", 5e-4) is not None
    assert better_axis(wrong, Tube(across), "mean", 5e-4) is None
    assert better_axis(wrong, Sector(start=-1.0, stop=1.0), "mean", 5e-4) is None
    fit = fit_surface(wrist(), TubeGrid(10, 20))
    assert better_axis(fit, Tube(), "mean", fit.errors.surface_to_mesh.mean) is None


@pytest.mark.slow
def test_a_place_too_far_from_the_mesh_is_named_instead_of_an_error_that_is_refused():
    """A narrow fin: the mean is within the tolerance, but the end of the fin is 0.1 mm off, and 0.05 mm are allowed."""
    mesh = round_tube(lambda a, h: 0.035 + 0.015 * ((np.abs(a - 1.0) < 0.02) & (h > 0.5)), 288, 41)
    with pytest.raises(PoorFit, match=r"limit 0.05 mm\) off the mesh at \(") as caught:
        fit_grid(mesh, AutoGrid(1e-5, axis=Z_AXIS, margin=0.002), (3, 3), max_deviation=5e-5)
    assert caught.value.numbers["distance"] > 5e-5
    angle = np.arctan2(caught.value.numbers["place"].point[1], caught.value.numbers["place"].point[0])
    assert abs(angle - 1.0) < 0.05


def law(mesh, measure, tolerances=(5e-4, 2e-4, 1e-4), **where):
    """Fit with each tolerance, and with each value that a refusal names: the answers agree with each other."""
    met, named = [], []
    for tolerance in tolerances:
        try:
            fit = fit_to_tolerance(mesh, tolerance, measure, **where)
        except UnreachableTolerance as error:
            assert error.numbers.get("achievable", np.inf) > tolerance
            named.append(error.numbers.get("achievable", np.inf))
        except PoorFit:
            named.append(np.inf)
        else:
            met.append(tolerance)
            assert fit.smallest_area >= FOLDED_AREA
            found = dense_maximum(fit) if measure == "max" else fit.errors.surface_to_mesh.mean
            assert found <= tolerance * 1.002
    assert len(set(named)) <= 1 and met == list(tolerances[: len(met)])
    if named and np.isfinite(named[0]):
        assert fit_to_tolerance(mesh, named[0], measure, **where).smallest_area >= FOLDED_AREA
        assert all(tolerance < named[0] for tolerance in tolerances[len(met) :])


@pytest.mark.nightly
@pytest.mark.parametrize("measure", ["mean", "max"])
@pytest.mark.parametrize("name", LINKS)
def test_answers_for_real_links_agree(name, measure):
    """A refusal names a value that succeeds, the same for each tolerance; what is met is met on another dense grid."""
    path = next((folder / name for folder in FOLDERS if (folder / name).exists()), None)
    if path is None:
        pytest.skip("no such mesh here")
    law(cut_cover(load_mesh(path), CoverSpec()), measure)


@pytest.mark.slow
def test_largest_distance_of_a_smaller_tolerance_does_not_contradict_a_larger_one():
    """An error that does not decrease with each larger net."""
    law(stepped(), "max", (2e-3, 1e-3, 5e-4, 2e-4), axis=Z_AXIS, margin=0.002)


@pytest.mark.parametrize(("value", "expected"), [(0.0342, 0.035), (0.35, 0.35), (0.8801, 0.89), (9.91, 10), (16.0, 16)])
def test_achievable_error_is_rounded_up_to_two_digits(value, expected):
    """So that the value in the message is one that is met."""
    assert rounded_up(value) == expected
