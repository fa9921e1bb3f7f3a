"""The axis of a tube, its cylinder coordinates, and the range of complete sections."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.common.errors import EmptySection, InvalidPlan
from skin_calib_addon.geometry.grid.axis import (
    AXIS_SECTIONS,
    FULL_TURN_ANGLES,
    Axis,
    find_axis,
    frame_of,
    section_circles,
    stations_between,
    symmetry_notes,
    tube_frame,
)
from skin_calib_addon.geometry.mesh.cover import CoverSpec, Cut, cut_cover
from skin_calib_addon.geometry.mesh.triangle_mesh import weld
from skin_calib_addon.geometry.sampling.frames import link_direction, link_side
from skin_calib_addon.geometry.sampling.sections import cut_sections
from tests.shapes import (
    LENGTH,
    RADIUS,
    Z_AXIS,
    Motion,
    box,
    cone,
    cylinder,
    keep,
    round_tube,
    sheet,
    together,
    unevenly_divided,
    wrist,
)

seeds = st.integers(0, 2**32 - 1)


def z_frame(mesh):
    """Cylinder coordinates about the z axis."""
    return tube_frame(mesh, Z_AXIS)


@given(seed=seeds)
def test_axis_of_a_cylinder_is_its_own(seed):
    """Wherever the cylinder lies, to the rounding."""
    motion = Motion(seed, 1.5)
    frame = find_axis(motion.mesh(cylinder(around=24, along=12)))
    direction = motion.directions((0, 0, 1))
    assert_allclose(np.abs(frame.e3 @ direction), 1, rtol=1e-12)
    assert np.linalg.norm(np.cross(frame.e3, direction)) < 1e-9
    assert np.linalg.norm(np.cross(frame.point - motion.shift, direction)) < 1e-9


@given(seed=seeds, flip=st.booleans())
def test_axis_runs_towards_the_thinner_end(seed, flip):
    """The direction of a cone does not depend on how it lies or which end it was made from."""
    motion = Motion(seed)
    mesh = cone(0.03, 0.045, around=24, along=12) if flip else cone(0.045, 0.03, around=24, along=12)
    frame = find_axis(motion.mesh(mesh))
    assert_allclose(frame.e3, motion.directions((0, 0, -1 if flip else 1)), rtol=0, atol=1e-9)


def test_axis_joins_the_centres_of_its_own_sections():
    """Of a bent, tapered, irregular tube: the line through the circles of sections across it is the axis itself."""
    frame = find_axis(wrist())
    height = frame.stations(wrist().vertices)
    middle, limit = (height.min() + height.max()) / 2, np.ptp(height) / 4
    nodes, weights = np.polynomial.legendre.leggauss(AXIS_SECTIONS)
    sections = cut_sections(wrist(), frame.planes(middle + limit * nodes))
    centres = section_circles(sections, frame)[0]
    centre = weights @ centres / weights.sum()
    direction = np.linalg.svd(np.sqrt(weights)[:, None] * (centres - centre))[2][0]
    assert np.linalg.norm(np.cross(direction, frame.e3)) < 1e-6
    off = centre - frame.point
    assert np.linalg.norm(off - (off @ frame.e3) * frame.e3) < 1e-7


def zero_angle(mesh, axis=Z_AXIS):
    """Angle zero of a tube about z, from the x axis of its frame [degrees]."""
    return np.rad2deg(np.arctan2(*tube_frame(mesh, axis).e1[1::-1]))


def test_angle_zero_is_where_the_section_extends_farthest():
    """A ridge, and an ellipse with one thicker tip: at the ridge and at the tip, to a thousandth of a degree."""
    ridge = round_tube(lambda a, _: 0.03 + 0.004 * np.exp(8 * (np.cos(a - 1.0) - 1)))
    assert_allclose(zero_angle(ridge), np.rad2deg(1.0), atol=0.1)
    tips = round_tube(lambda a, _: 0.03 + 0.003 * np.cos(2 * (a - 2.0)) + 0.0005 * np.cos(a - 2.0), 360)
    assert_allclose(zero_angle(tips), np.rad2deg(2.0), atol=1e-3)


def test_angle_zero_of_a_round_tube_is_that_of_the_link_frame():
    """Noise does not decide: x for a tube along z, y along x, and little change for a little tilt."""
    mesh = cylinder()
    shaken = weld(mesh.vertices + np.random.default_rng(1).normal(0, 1e-9, mesh.vertices.shape), mesh.faces)
    for one in (mesh, shaken):
        frame = tube_frame(one, None)
        assert_allclose((frame.e1, frame.e3), ((1, 0, 0), (0, 0, 1)), atol=1e-3)
    for axis, side in (((1, 0, 0), (0, 1, 0)), ((0, 1, 0), (1, 0, 0)), ((1e-3, 1e-3, -1), (1, 0, 1e-3))):
        assert_allclose(link_direction(np.array(axis)), side, atol=3e-6)


def test_link_direction_is_smooth():
    """Across every line, the same for both senses; it jumps nowhere near an axis, a diagonal or a plane of them."""
    rng = np.random.default_rng(0)
    for axis in np.array(list(np.ndindex(3, 3, 3)))[1:] - 1.0:
        if not axis.any():
            continue
        near = axis + rng.normal(0, 1e-6, (20, 3))
        sides = np.array([link_direction(line) for line in near])
        assert np.ptp(sides, axis=0).max() < 1e-4
        assert_allclose(sides[0] @ near[0], 0, atol=1e-14)
        assert_allclose(link_direction(-axis), link_direction(axis), atol=1e-14)
        assert len({link_side(line) for line in near}) == 1 and link_side(-axis) == -link_side(axis)


def test_angle_zero_of_symmetric_tubes_has_no_ties():
    """Of two equal tips the one next to the link's x axis; of a mirrored pair of ridges always the same one."""
    ellipse = round_tube(lambda a, _: 0.03 + 0.003 * np.cos(2 * (a - 0.4)))
    assert_allclose(zero_angle(ellipse), np.rad2deg(0.4), atol=1e-2)
    for turn in np.linspace(0, 6, 7):
        pair = round_tube(
            lambda a, _, t=turn: 0.03 + sum(0.004 * np.exp(6 * (np.cos(a - t - s) - 1)) for s in (-0.8, 0.8))
        )
        off = (zero_angle(pair) - np.rad2deg(turn) + 180) % 360 - 180
        assert -60 < off < -30  # the first of both, counter-clockwise


def four_sided():
    """A tube with four ridges, on one side a little wider."""
    return round_tube(lambda a, _: 0.03 + 0.002 * np.cos(4 * a) + 0.001 * np.cos(a))


CHANGES = {
    "moved": lambda mesh, motion: motion.mesh(mesh),
    "subdivided": lambda mesh, motion: unevenly_divided(mesh),
    "shaken": lambda mesh, motion: weld(
        mesh.vertices + np.random.default_rng(2).normal(0, 1e-9, mesh.vertices.shape), mesh.faces
    ),
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("made", [wrist, four_sided])
def test_frame_and_stations_depend_on_the_shape_only(made, change):
    """Vertices that crowd on one side, noise of a nanometre and a motion move nothing by more than a micrometre."""
    mesh, motion = made(), Motion(4) if change == "moved" else Motion.none()
    other = CHANGES[change](mesh, motion)
    here, there = tube_frame(mesh, None), tube_frame(other, None)
    assert_allclose(there.e3, motion.directions(here.e3), atol=1e-6)
    assert_allclose(there.e1, motion.directions(here.e1), atol=2e-5)
    ends = [stations_between(m, f, None, FULL_TURN_ANGLES) for m, f in ((mesh, here), (other, there))]
    for end, again in zip(*ends):
        assert_allclose(there.point + again * there.e3, motion.points(here.point + end * here.e3), atol=1e-6)


def test_complete_sections_end_where_the_mesh_does():
    """A jagged end that moves by a tenth of a step moves the first station by as much, not by a step or nothing."""
    lows = []
    for rim in (0.0100, 0.01005, 0.0101):
        mesh = cylinder(along=41)
        low = mesh.vertices[:, 2] < 0.02
        height = np.where(low & (mesh.vertices[:, 1] > 0), np.maximum(mesh.vertices[:, 2], rim), mesh.vertices[:, 2])
        mesh = weld(np.column_stack((mesh.vertices[:, :2], height)), mesh.faces)
        open_ = keep(mesh, lambda c, rim=rim: ~((c[:, 2] < rim + 1e-5) & (c[:, 1] > 0)))
        lows.append(stations_between(open_, z_frame(open_), None, FULL_TURN_ANGLES)[0])
    assert_allclose(np.array(lows) - LENGTH / 384, (0.0100, 0.01005, 0.0101), rtol=0, atol=2e-6)


@given(seed=seeds)
def test_frame_coordinates_put_the_point_together(seed):
    """Station, both components across, and the three axes give back every point; rays turn from e1 to e2."""
    rng = np.random.default_rng(seed)
    frame = frame_of(rng.normal(size=3), rng.normal(size=3), rng.normal(size=3))
    points = rng.normal(size=(5, 3))
    x, y = frame.across(points - frame.point).T
    rebuilt = frame.point + x[:, None] * frame.e1 + y[:, None] * frame.e2 + frame.stations(points)[:, None] * frame.e3
    assert_allclose(rebuilt, points, rtol=0, atol=1e-13)
    assert_allclose(frame.rays(np.array((0, np.pi / 2))), (frame.e1, frame.e2), rtol=0, atol=1e-15)
    planes = frame.planes(np.array((-1.0, 2.0)))
    assert_allclose(frame.stations(planes.points), (-1, 2), rtol=1e-13)
    assert planes.are_parallel() and np.abs(planes.normals[0] - frame.e3).max() < 1e-15


def test_frame_towards_its_own_axis_takes_any_side():
    """A direction along the axis names no side; the frame is still orthonormal."""
    frame = frame_of(np.zeros(3), np.array((0, 0, 2.0)), np.array((0, 0, 1.0)))
    basis = np.array((frame.e1, frame.e2, frame.e3))
    assert_allclose(basis @ basis.T, np.eye(3), rtol=0, atol=1e-15)


def test_section_circles_of_a_polygon_have_its_centre():
    """Circles fitted to the sections of a shifted cylinder: centres exact, radii between those in and around it."""
    frame = z_frame(cylinder())
    mesh = weld(cylinder().vertices + (0.004, -0.003, 0), cylinder().faces)
    sections = cut_sections(mesh, frame.planes(np.array((0.02, 0.5, 0.06))))
    centres, radii, planes = section_circles(sections, frame)
    assert_allclose(centres, [(0.004, -0.003, 0.02), (0.004, -0.003, 0.06)], rtol=0, atol=1e-12)
    assert planes.tolist() == [0, 2]
    assert (radii <= RADIUS).all() and (radii >= RADIUS * np.cos(np.pi / 96) - 1e-15).all()


def test_stations_leave_the_margin_free():
    """With a margin: exactly from end to end less the margin, along an axis of any length and origin."""
    frame = tube_frame(cylinder(), Axis((0, 0, 0.3), (0, 0, -4)))
    low, high = stations_between(cylinder(), frame, 0.004, FULL_TURN_ANGLES)
    assert_allclose((low, high), (0.2 + 0.004, 0.3 - 0.004), rtol=1e-14)


def test_stations_extend_as_far_as_sections_are_complete():
    """Without a margin: the longest complete run; ragged ends and a slot are left out."""
    slotted = keep(cylinder(along=41), lambda c: ~((c[:, 2] > 0.070) & (c[:, 2] < 0.080) & (c[:, 0] > 0.02)))
    ragged = keep(slotted, lambda c: (c[:, 2] > 0.01) | (c[:, 1] > 0))
    low, high = stations_between(ragged, z_frame(ragged), None, FULL_TURN_ANGLES)
    assert_allclose((low, high), (0.01, 0.07), rtol=0, atol=LENGTH / 192)
    assert low >= 0.01 and high <= 0.07


@pytest.mark.parametrize("margin", [0.05, 0.05 - 1e-15, 0.06, 10.0])
def test_margin_that_leaves_nothing_is_refused(margin):
    """Half of the length, but for rounding, or more at each end; the numbers are in the message and on the error."""
    with pytest.raises(
        InvalidPlan, match=rf"margin of {margin * 1e3:g} mm .* of the 100\.0 mm along the axis"
    ) as caught:
        stations_between(cylinder(), z_frame(cylinder()), margin, FULL_TURN_ANGLES)
    assert caught.value.numbers == {"margin": margin}


def test_half_tube_has_no_complete_section():
    """All round there is nothing; the message says what else to use."""
    half = keep(cylinder(), lambda c: c[:, 0] > 0)
    with pytest.raises(
        EmptySection, match=r"No section .* is closed. The section with the smallest gap, .* is open at \d+ deg"
    ):
        stations_between(half, z_frame(half), None, FULL_TURN_ANGLES)


@pytest.mark.parametrize("width", [0.001, 0.0015, 0.0025])
def test_ring_narrower_than_a_cell_is_refused(width):
    """A half tube with a thin whole ring: rounding would decide which of its sections are complete."""
    half = keep(cylinder(along=401), lambda c: (c[:, 0] > 0) | (np.abs(c[:, 2] - 0.0501) < width / 2))
    with pytest.raises(
        EmptySection, match=r"The closed part of the tube is shorter than 3 mm. The section .* is open at \d+ deg"
    ):
        stations_between(half, z_frame(half), None, FULL_TURN_ANGLES)


def test_ring_wider_than_a_cell_is_a_tube():
    """Nothing more than a step is left out at its ends."""
    half = keep(cylinder(along=401), lambda c: (c[:, 0] > 0) | (np.abs(c[:, 2] - 0.0501) < 0.00225))
    low, high = stations_between(half, z_frame(half), None, FULL_TURN_ANGLES)
    assert 0.0045 - LENGTH / 192 - LENGTH / 400 < high - low < 0.0045


def test_mesh_without_a_middle_has_no_axis():
    """What has no sections has no axis; the message says what to do."""
    with pytest.raises(EmptySection, match="No axis was found: sections .* are empty. Give the axis in the plan"):
        find_axis(keep(cylinder(along=20), lambda centres: np.abs(centres[:, 2] - LENGTH / 2) > 0.4 * LENGTH))


def tray(thickness, covered):
    """A square plate of 100 mm with side walls, whose upper side is covered in part."""
    plate = keep(box((0, 0, 0), (0.1, 0.1, thickness)), lambda c: c[:, 2] < 0.99 * thickness)
    return together(plate, sheet(lambda x, y: 0 * x + thickness, (0.1 * covered, 0.1), (1, 1)))


@pytest.mark.parametrize(
    "thickness, covered, is_sheet",
    [(0.012, 1.0, True), (0.020, 1.0, False), (0.010, 0.65, True), (0.010, 0.35, False)],
)
def test_thin_mesh_with_two_sides_is_a_sheet(thickness, covered, is_sheet):
    """It is one if its thickness is below 15 % of the width, and each side has a quarter of the area."""
    mesh = tray(thickness, covered)
    if is_sheet:
        with pytest.raises(InvalidPlan, match="thin sheet"):
            find_axis(mesh)
    else:
        find_axis(mesh)


def test_face_that_a_cut_leaves_has_no_axis():
    """A cut in the plane of the end of a block keeps this end if it faces outward: the refusal names the cause."""
    spec = CoverSpec(cuts=(Cut((0, 0, 0), (0, 0, 1)), Cut((0, 0, 0.2), (0, 0, 1))))
    left = cut_cover(box((-0.03, -0.04, 0), (0.03, 0.04, 0.2)), spec)
    with pytest.raises(InvalidPlan, match="0.0 mm thick .* If a cut removes the rest of the link, reverse its normal"):
        find_axis(left)


def test_axis_of_arrays_is_that_of_tuples():
    """An axis is hashable, whatever sequences its coordinates came in; fits keep the frame of their last axes."""
    tuples, arrays = Axis((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), Axis(np.zeros(3), [0.0, 0.0, 1.0])
    mesh = cylinder(around=24, along=12)
    assert tuples == arrays and tube_frame(mesh, arrays) is tube_frame(mesh, tuples)


def test_sides_that_one_vertex_exchanges_are_named():
    """An elliptic tube of 0.2 % more on one side; equal sides, and sides that differ, need no note."""

    def notes(more):
        mesh = round_tube(lambda a, h: 0.03 + 0.005 * np.cos(2 * a) + more * np.maximum(np.cos(a), 0), 48, 8)
        return symmetry_notes(mesh, Z_AXIS)

    assert not notes(0.0) and not notes(2e-3)
    (note,) = notes(1e-5)
    assert note.severity == "note" and 0 < note.value < 1e-3 and "at 0 and 180 degrees" in note.message
