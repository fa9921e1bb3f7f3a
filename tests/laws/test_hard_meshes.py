"""Ugly input: the surface of the clean mesh, or one line that says what is wrong."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.common.errors import InvalidMesh, SkinCalibError
from skin_calib_addon.geometry import AcrossGrid, Axis, Planes, PlanesGrid, SectorGrid, TubeGrid, fit_surface, weld
from tests.examples import examples
from tests.shapes import LENGTH, RADIUS, Z_AXIS, box, cylinder, dome, keep, sheet, together, wrist

seeds = st.integers(0, 2**32 - 1)
UV = np.random.default_rng(0).uniform(0, 1, (300, 2))
UP = (0.0, 0.0, 1.0)
NEAR_Z = Axis((0.001, -0.001, 0.02), (0.02, 0.01, 1.0))
# An automatic and an even tube, a sector, a face; each with its mesh.
CASES = {
    "tube": (wrist(), TubeGrid(8, 16, NEAR_Z, 0.004)),
    "even tube": (wrist(), TubeGrid(8, 16, NEAR_Z, 0.004, "uniform")),
    "sector": (wrist(), SectorGrid(6, 9, -1.0, 1.5, NEAR_Z, 0.004)),
    "face": (dome(), AcrossGrid(6, 7, UP, (1.0, 0, 0), 0.004)),
}
SURFACES = {name: fit_surface(mesh, grid).surface for name, (mesh, grid) in CASES.items()}


def fit_or_error(mesh, grid, **options):
    """A fit, or None where it is refused with one line."""
    try:
        return fit_surface(mesh, grid, **options)
    except SkinCalibError as error:
        assert str(error) and "\n" not in str(error)
        return None


def slivered(mesh, rng, fraction, width):
    """Some faces split at a point ``width`` [m] from a corner: one sliver each, and the rest."""
    vertices, faces = [*mesh.vertices], []
    for face in mesh.faces:
        if rng.random() > fraction:
            faces.append(face)
            continue
        a, b, c = np.roll(face, rng.integers(3))
        direction = mesh.vertices[b] - mesh.vertices[a]
        # Inside of the face, so that the neighbours need no split.
        inner = mesh.vertices[a] + width * direction / np.linalg.norm(direction)
        inner = inner + width * (mesh.vertices[c] - mesh.vertices[a])
        d = len(vertices)
        vertices.append(inner)
        faces += [(a, b, d), (b, c, d), (c, a, d)]
    return weld(vertices, faces)


@pytest.mark.parametrize("case", CASES)
@examples(4)
@given(seed=seeds)
def test_winding_does_not_matter(case, seed):
    """Half of the faces with the wrong winding: to a billionth of the size, as cuts run in the opposite direction."""
    mesh, grid = CASES[case]
    wrong = np.random.default_rng(seed).random(len(mesh.faces)) < 0.5
    mixed = weld(mesh.vertices, np.where(wrong[:, None], mesh.faces[:, ::-1], mesh.faces))
    fit = fit_surface(mixed, grid)
    assert_allclose(fit.surface.control_net, SURFACES[case].control_net, rtol=0, atol=1e-9 * mesh.size)
    assert fit.missing == 0 and (case == "face" or fit.warnings == ())


@pytest.mark.parametrize("case", CASES)
def test_both_sides_of_every_face_are_one_surface(case):
    """Each face twice, with both windings, as some exporters write: the same surface, to a billionth of the size."""
    mesh, grid = CASES[case]
    double = weld(mesh.vertices, np.concatenate((mesh.faces, mesh.faces[:, ::-1])))
    assert len(double.faces) == 2 * len(mesh.faces)
    fit = fit_surface(double, grid)
    assert_allclose(fit.surface.control_net, SURFACES[case].control_net, rtol=0, atol=1e-9 * mesh.size)


@pytest.mark.parametrize("case", CASES)
@examples(4)
@given(seed=seeds, width=st.sampled_from([1e-6, 1e-9, 1e-12]))
def test_slivers_do_not_matter(case, seed, width):
    """A tenth of the faces split near a corner, to slivers down to a picometre: the shape is the same to a
    billionth of the size where slivers are that thin, and the surface moves no further than they are wide."""
    mesh, grid = CASES[case]
    fit = fit_surface(slivered(mesh, np.random.default_rng(seed), 0.1, width), grid)
    assert fit.missing == 0
    assert_allclose(fit.surface.control_net, SURFACES[case].control_net, rtol=0, atol=width + 1e-9 * mesh.size)


@examples(6)
@given(seed=seeds, gap=st.sampled_from([1e-15, 1e-12, 1e-9, 1e-7]))
def test_hairline_cracks_do_not_matter(seed, gap):
    """Soup with rounded corners, so that no two faces have a common vertex: the surface is the clean one's, as
    far as the cracks are wide; a ray that slips through a crack counts as missing and takes little with it."""
    mesh, grid = CASES["even tube"]
    corners = mesh.triangles.reshape(-1, 3)
    moved = corners + gap * np.random.default_rng(seed).uniform(-1, 1, corners.shape)
    fit = fit_surface(weld(moved, np.arange(len(moved)).reshape(-1, 3)), grid)
    assert fit.missing < 0.01
    assert_allclose(fit.surface.points(UV), SURFACES["even tube"].points(UV), rtol=0, atol=2e-5)


@examples(8)
@given(rings=st.integers(8, 20), lines=st.sampled_from([8, 12, 16, 24, 48]), n=st.integers(4, 12))
def test_planes_through_vertices_miss_nothing(rings, lines, n):
    """u-planes through rings of vertices, v-planes along edges, and sections along them: no ray slips, and the net is
    that of planes at a distance of a nanometre, to a few nanometres."""
    mesh = cylinder(around=48, along=rings + 1)
    inner = LENGTH * np.arange(1, rings) / rings
    stations = inner[np.unique(np.linspace(0, len(inner) - 1, n).round().astype(int))]
    angle = np.arange(lines // 2) * 2 * np.pi / lines
    v = np.column_stack((-np.sin(angle), np.cos(angle), 0 * angle))
    fits = [
        fit_surface(
            mesh,
            PlanesGrid(
                Planes((stations + aside)[:, None] * UP, np.tile(UP, (len(stations), 1))),
                Planes(np.zeros((len(v), 3)) + aside, v),
                True,
            ),
        )
        for aside in (0.0, 1e-9)
    ]
    assert [fit.missing for fit in fits] == [0, 0]
    assert_allclose(fits[0].surface.control_net, fits[1].surface.control_net, rtol=0, atol=1e-8)


def test_planes_through_rows_of_a_sheet_miss_nothing():
    """Planes across a face along the very rows of its vertices, and over its own edge: exact to the rounding."""
    slope = sheet(lambda x, y: 0.02 + 0.3 * x)
    x, y = np.linspace(0.0, 0.1, 21)[[1, 3, 6, 10, 15, 19]], np.linspace(0.0, 0.08, 17)[[1, 4, 8, 12, 15]]
    grid = PlanesGrid(
        Planes(x[:, None] * (1.0, 0, 0), np.tile((1.0, 0, 0), (6, 1))),
        Planes(y[:, None] * (0, 1.0, 0), np.tile((0, 1.0, 0), (5, 1))),
        False,
    )
    fit = fit_surface(slope, grid)
    points = fit.surface.points(UV)
    assert fit.missing == 0
    assert_allclose(points[:, 2], 0.02 + 0.3 * points[:, 0], rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    ("around", "lines", "error"),
    [(12, 14, 5e-6), (12, 16, 1.2e-6), (24, 20, 6e-7), (48, 24, 4e-7)],
)
def test_regular_tube_is_round_by_its_chords(around, lines, error):
    """Corners on a cylinder of 35 mm, facets 1.2, .3 and .07 mm inside of it: with chords the cylinder is found to what
    so many lines can carry (2.3 µm for 12 of them) and a few rounds leave."""
    fit = fit_surface(cylinder(around=around), TubeGrid(6, lines, Z_AXIS, 0.004, "uniform"), chords=True)
    radius = np.linalg.norm(fit.surface.points(UV)[:, :2], axis=1)
    assert np.abs(radius - RADIUS).mean() < error
    assert fit.noise == 0  # facets are no noise of a scan where they are said to be chords


def cap(rings=24, around=72, deepest=np.pi / 2):
    """A cap of a sphere about its pole, where all its meridians meet; it looks up."""
    tilt = deepest * np.arange(1, rings + 1) / rings
    angle = 2 * np.pi * np.arange(around) / around
    ring = np.stack(
        [
            np.sin(tilt)[:, None] * np.cos(angle),
            np.sin(tilt)[:, None] * np.sin(angle),
            np.repeat(np.cos(tilt)[:, None], around, axis=1),
        ],
        axis=-1,
    ).reshape(-1, 3)
    k = np.arange(around)
    after = (k + 1) % around
    faces = [np.column_stack((0 * k, 1 + k, 1 + after))]
    for r in range(rings - 1):
        p, q = 1 + r * around + k, 1 + r * around + after
        faces += [np.column_stack((p, p + around, q + around)), np.column_stack((p, q + around, q))]
    return weld(RADIUS * np.vstack(((0, 0, 1.0), ring)), np.concatenate(faces))


@pytest.mark.parametrize("margin", [0.008, 0.012, 0.02])
def test_pole_under_a_face_grid_is_smooth(margin):
    """Planes across the cap of a sphere, with its pole amid them: the sphere to its facets where it looks up."""
    mesh = cap()
    fit = fit_surface(mesh, AcrossGrid(10, 10, UP, (1.0, 0, 0), margin))
    if fit.missing == 0:
        radius = np.linalg.norm(fit.surface.points(UV), axis=1)
        assert np.abs(radius - RADIUS).max() < 2e-4
    assert np.abs(np.linalg.norm(fit.surface.points(UV), axis=1) - RADIUS).max() < 2e-3
    assert (fit.surface.normals(UV)[:, 2] > 0).all()


@pytest.mark.parametrize("margin", [0.0, 1e-4, 5e-3])
@pytest.mark.parametrize("sector", [(-1.0, 1.0), (-2.5, 2.5)])
def test_pole_at_the_end_of_a_sector_is_fitted_or_refused(margin, sector):
    """Planes across the axis of a cap up to its pole, where its section shrinks to nothing: a surface on the sphere
    as near as 5% of its radius, or one line."""
    fit = fit_or_error(cap(), SectorGrid(10, 10, *sector, Z_AXIS, margin))
    if fit is not None:
        assert np.abs(np.linalg.norm(fit.surface.points(UV), axis=1) - RADIUS).max() < 0.05 * RADIUS
        assert np.isfinite(fit.errors.hausdorff) and np.isfinite(fit.condition)


@pytest.mark.parametrize("margin", [None, 0.0, 0.002])
@pytest.mark.parametrize("spacing", ["auto", "uniform", "curvature"])
def test_walls_along_the_lines_are_fitted_or_refused(margin, spacing):
    """A block with a lower step whose wall runs along the rays: a surface or one line, no other error."""
    block = together(box((0, 0, 0), (0.1, 0.08, 0.03)), box((0.03, 0.02, 0.03), (0.07, 0.06, 0.034)))
    fit = fit_or_error(block, AcrossGrid(10, 9, UP, (1.0, 0, 0), margin, spacing))
    if fit is not None:
        assert fit.surface.points(UV)[:, 2].min() > 0.0 and fit.surface.points(UV)[:, 2].max() < 0.06


@examples(6)
@given(height=st.floats(0.005, 0.1), margin=st.floats(1e-4, 0.02))
def test_walls_outside_of_the_margin_do_not_matter(height, margin):
    """The top of a block, whose walls stand just outside of the planes: flat to the rounding, however high it is."""
    block = box((0, 0, 0), (0.1, 0.08, height))
    fit = fit_surface(block, AcrossGrid(6, 6, UP, None, margin))
    assert fit.missing == 0
    assert_allclose(fit.surface.points(UV)[:, 2], height, rtol=0, atol=1e-12)


@pytest.mark.parametrize("case", CASES)
@examples(6)
@given(seed=seeds, fraction=st.floats(0.02, 0.97))
def test_torn_meshes_are_fitted_or_refused(case, seed, fraction):
    """Without any fraction of the faces at random: a finite surface, or one line."""
    mesh, grid = CASES[case]
    rng = np.random.default_rng(seed)
    try:
        torn = keep(mesh, lambda c: rng.random(len(c)) > fraction)
    except InvalidMesh as error:
        assert "\n" not in str(error)
        return
    fit = fit_or_error(torn, grid)
    if fit is not None:
        assert np.isfinite(fit.surface.control_net).all()
        assert 0 <= fit.missing < 0.55  # half at the first cast, and a few more as the rays move
        assert all("\n" not in str(w) for w in fit.warnings)
        assert (fit.dropped_loops >= 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("case", ["even tube", "sector", "face"])
@examples(3)
@given(seed=seeds, noise=st.floats(1e-5, 0.05))
def test_noise_of_any_size_is_fitted_or_refused(case, seed, noise):
    """Vertices moved by a hundredth of a millimetre to more than the tube's own radius: a surface, or one line."""
    mesh, grid = CASES[case]
    moved = mesh.vertices + noise * np.random.default_rng(seed).normal(size=mesh.vertices.shape)
    fit = fit_or_error(weld(moved, mesh.faces), grid)
    if fit is not None:
        assert np.isfinite(fit.surface.control_net).all()
        assert np.isfinite(fit.condition) and all("\n" not in str(w) for w in fit.warnings)


@examples(10)
@given(seed=seeds, count=st.integers(1, 30))
def test_few_random_triangles_are_fitted_or_refused(seed, count):
    """A handful of faces anywhere: every kind of grid gives a surface or one line."""
    rng = np.random.default_rng(seed)
    mesh = weld(rng.uniform(-0.05, 0.05, (3 * count, 3)), np.arange(3 * count).reshape(-1, 3))
    for grid in (
        TubeGrid(5, 8),
        TubeGrid(5, 8, Z_AXIS, 0.01, "uniform"),
        SectorGrid(5, 6, -1.0, 1.0, Z_AXIS, 0.01),
        AcrossGrid(5, 6, UP),
    ):
        fit = fit_or_error(mesh, grid)
        assert fit is None or np.isfinite(fit.surface.control_net).all()
