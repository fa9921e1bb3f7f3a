"""Single vertices that stand off from the surface around them."""

import re

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from skin_calib_addon.common.errors import EmptySection
from skin_calib_addon.geometry import Axis, TubeGrid, fit_surface, fit_to_tolerance, weld
from skin_calib_addon.geometry.mesh.defects import diagnose
from skin_calib_addon.geometry.mesh.outliers import flattened, stray_part, without_outliers
from skin_calib_addon.geometry.surface.footpoints import footpoints
from tests.shapes import LENGTH, Z_AXIS, box, cone, cylinder, sheet, together, with_hole, wrist

CODE = "outlier-vertices"


def with_spikes(mesh, count, height, seed=0):
    """Return a mesh with vertices that are moved away from the axis by a height [m], and these vertices."""
    rng = np.random.default_rng(seed)
    z = mesh.vertices[:, 2]
    inner = np.flatnonzero((z > 0.1 * z.max()) & (z < 0.9 * z.max()))
    chosen = np.empty(0, int)
    while len(chosen) < count:  # not next to each other
        i = rng.choice(inner)
        ring = np.unique(mesh.faces[(mesh.faces == i).any(axis=1)])
        far = np.isin(mesh.faces, ring).any(axis=1)
        if not np.isin(mesh.faces[far], chosen).any():
            chosen = np.append(chosen, i)
    vertices = mesh.vertices.copy()
    out = vertices[chosen] * (1, 1, 0)
    vertices[chosen] += height * out / np.linalg.norm(out, axis=1, keepdims=True)
    return weld(vertices, mesh.faces), vertices[chosen]


@pytest.mark.parametrize(
    ("count", "height", "spacing"),
    [(1, 0.002, "uniform"), (1, 0.05, "uniform"), (20, -0.01, "auto")],
)
def test_surface_does_not_depend_on_outliers(count, height, spacing):
    """The surface is within 0.05 mm of the one without them, and the warning has the highest and the number."""
    grid = TubeGrid(10, 24, Z_AXIS, 0.004, spacing)
    spiked, places = with_spikes(wrist(), count, height)
    clean, fit = fit_surface(wrist(), grid), fit_surface(spiked, grid)
    u, v = (x.ravel() for x in np.meshgrid(np.linspace(0, 1, 40), np.arange(90) / 90))
    uv = np.column_stack((u, v))
    assert footpoints(clean.surface, fit.surface.points(uv))[1].max() < 5e-5
    (warning,) = (w for w in fit.warnings if w.code == CODE)
    assert np.linalg.norm(places - warning.where.point, axis=1).min() < 1e-9
    assert warning.value == pytest.approx(abs(height), rel=0.2)
    assert warning.message.startswith("One vertex" if count == 1 else f"{count} vertices")
    assert not any(w.code == CODE for w in clean.warnings)


def test_smallest_surface_does_not_depend_on_outliers():
    """A fit within a tolerance has the same net as without, and the warning."""
    spiked, _ = with_spikes(wrist(), 3, 0.01)
    clean, fit = fit_to_tolerance(wrist(), 2e-4, axis=Z_AXIS), fit_to_tolerance(spiked, 2e-4, axis=Z_AXIS)
    assert fit.offsets.shape == clean.offsets.shape
    assert np.abs(fit.offsets - clean.offsets).max() < 1e-4
    assert [w.code for w in fit.warnings].count(CODE) == 1


def test_only_the_outliers_are_moved():
    """All other vertices stay to the bit, and a mesh without outliers is returned as it is."""
    spiked, places = with_spikes(wrist(), 10, 0.01)
    vertices, heights = flattened(spiked)
    moved = np.flatnonzero(heights)
    assert len(moved) == 10
    assert_array_equal(np.sort(spiked.vertices[moved], axis=0), np.sort(places, axis=0))
    rest = np.setdiff1d(np.arange(len(vertices)), moved)
    assert_array_equal(vertices[rest], spiked.vertices[rest])
    assert without_outliers(wrist())[0] is wrist()


@pytest.mark.parametrize("heights", [(0.012, 0.002), (-0.02, 0.004)])
def test_two_outliers_next_to_each_other_are_found(heights):
    """All neighbours of the higher one but the other are low; without it the other is single."""
    mesh = sheet(lambda x, y: 0 * x, (0.2, 0.16), (20, 16))
    middle = int(np.argmin(np.linalg.norm(mesh.vertices - (0.1, 0.08, 0), axis=1)))
    ring = np.setdiff1d(mesh.faces[(mesh.faces == middle).any(axis=1)], middle)
    vertices = mesh.vertices.copy()
    vertices[[middle, ring[0]], 2] = heights
    moved, found = flattened(weld(vertices, mesh.faces))
    assert np.count_nonzero(found) == 2
    assert np.abs(moved[:, 2]).max() < 1e-3


def ribbed():
    """Return a tube with steps of 3 mm, ribs of 2 mm, and an edge along it."""
    tube = cylinder(around=60, along=60)
    x, y, z = tube.vertices.T
    angle = np.arctan2(y, x)
    height = 0.003 * (z > 0.6 * LENGTH) + 0.002 * (np.sin(6 * angle) > 0.9) + 0.004 * (np.abs(angle) < 0.02)
    return weld(tube.vertices * (1 + height / 0.035)[:, None] * (1, 1, 0) + tube.vertices * (0, 0, 1), tube.faces)


def pyramid():
    """Return a tetrahedron: each vertex is a tip."""
    return weld(
        np.array(((0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1))), ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
    )


FEATURES = {
    "box": lambda: box((0, 0, 0), (0.1, 0.05, 0.02)),
    "two boxes": lambda: together(box((0, 0, 0), (0.1, 0.1, 0.1)), box((0.04, 0.04, 0.1), (0.06, 0.06, 0.13))),
    "tetrahedron": pyramid,
    "ribs": ribbed,
    "cone": cone,
    "coarse tube": lambda: cylinder(around=8, along=4),
    "hole": lambda: with_hole(wrist(), (0.03, 0.0, 0.04), 0.008),
}


@pytest.mark.parametrize("name", FEATURES)
def test_features_are_no_outliers(name):
    """Corners, steps, ribs, edges and rims have neighbours of the same height."""
    assert not flattened(FEATURES[name]())[1].any()


def test_noise_of_a_scan_is_no_outlier():
    """A tenth of a millimetre of noise has the same size everywhere."""
    tube = cylinder(around=120, along=80)
    noise = np.random.default_rng(0).normal(scale=4e-4, size=tube.vertices.shape)
    assert not flattened(weld(tube.vertices + noise, tube.faces))[1].any()


def test_check_of_the_mesh_names_outliers():
    """The finding has the place of the highest one."""
    spiked, places = with_spikes(wrist(), 1, 0.01)
    (finding,) = (w for w in diagnose(spiked.vertices, spiked.faces).findings() if w.code == CODE)
    assert np.linalg.norm(places[0] - finding.where.point) < 1e-9
    assert not any(w.code == CODE for w in diagnose(wrist().vertices, wrist().faces).findings())


def facet_at(*corner):
    """Return a facet of 4 mm."""
    return weld(np.array(corner) + np.array(((0, 0, 0), (0.004, 0, 0), (0, 0.004, 0))), [[0, 1, 2]])


@pytest.mark.parametrize(
    ("corner", "grid", "message"),
    [
        ((0, 0, 0.9), TubeGrid(6, 12), "No axis was found: .* are empty. A loose part of 1 face"),
        ((0.5, 0.5, 0.9), TubeGrid(6, 12), "No axis was found: .* are empty. A loose part of 1 face"),
        ((0, 0, 0.17), TubeGrid(6, 12, margin=0.004), "does not intersect the mesh. .* A loose part of 1 face"),
        ((0, 0, 0.9), TubeGrid(6, 12, Axis((0, 0, 0), (0, 0, 1))), "of the mesh along the axis. .* A loose part of 1"),
    ],
)
def test_stray_facet_is_named_as_the_cause(corner, grid, message):
    """A facet that was left over far away changes the ends of the link; without it nothing is reported."""
    tube = cylinder()
    with_facet = together(tube, facet_at(*corner))
    try:
        (text,) = (w.message for w in fit_surface(with_facet, grid).warnings if w.code == "short-surface")
    except EmptySection as error:
        text = str(error)
    assert re.search(message, text) and "mm away from the rest of the mesh" in text
    assert not fit_surface(tube, grid).warnings


def test_parts_of_a_link_are_not_stray():
    """A facet within the box of the rest, or next to it, and many small parts."""
    tube = cylinder()
    assert "1 face" in stray_part(together(tube, facet_at(0, 0, 0.5)))
    for others in ([facet_at(0.04, 0, 0.05)], [facet_at(0, 0, 0.1)], [facet_at(0, 0, 0.02 * k) for k in range(80)]):
        assert stray_part(together(tube, *others)) == ""
    assert stray_part(tube) == ""
