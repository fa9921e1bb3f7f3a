"""What a view shows: cells of the right colour, contacts where they are, polygons on the ground."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.calibration import Response
from skin_calib_addon.messages.scene import FORCE_COLOURS, UNKNOWN_COLOUR, SceneMaker
from skin_calib_addon.runtime import Skin
from tests.samples import boards, plane, sheet, small_calibration
from tests.soles import sole_patch


@pytest.fixture
def sole():
    """Return the calibration of a flat skin whose readings are newtons, and its skin."""
    fields = {"patches": (sole_patch(),), "surfaces": (plane(),), "response": Response((0.0, 1.0))}
    calibration = small_calibration(**fields)
    return calibration, Skin(calibration, switch_on=0.5)


def centres(scene):
    """Return the middle of each triangle."""
    return scene.triangles.mean(axis=1)


def test_only_touched_cells_are_drawn_with_the_colour_of_their_force(sole):
    """From light to dark, relative to the largest force of all frames; the shape is that of the cell."""
    calibration, skin = sole
    frames = []
    for force in (2.0, 8.0):
        reading = np.zeros(skin.reading_length)
        reading[skin.channels[[3, 20]]] = force, force / 2
        frames.append(skin.update(reading, len(frames) * 0.01))
    maker = SceneMaker(calibration, skin, tuple(frames))
    for frame, ends in zip(frames, ((0.25, 0.125), (1.0, 0.5))):
        scene = maker.scene(frame)
        for taxel, end in zip((3, 20), ends):
            own = np.linalg.norm(centres(scene) - skin.positions[taxel], axis=1) < np.sqrt(skin.areas[taxel])
            expected = [np.interp(end, np.linspace(0, 1, len(FORCE_COLOURS)), c) for c in FORCE_COLOURS.T]
            assert own.sum() == 4
            assert_allclose(scene.colours[own], [expected] * 4)
            sides = np.cross(*np.diff(scene.triangles[own], axis=1).transpose(1, 0, 2))
            assert_allclose(np.linalg.norm(sides, axis=1).sum() / 2, 0.94**2 * skin.areas[taxel], rtol=1e-9)
        assert len(scene.triangles) == 8


def test_cells_of_all_shapes_are_drawn():
    """Two triangles for each cell of a sheet, four for each board; all face outwards."""
    calibration = small_calibration(patches=(sheet(3, 4, 0.01), boards(first_channel=12)))
    maker = SceneMaker(calibration, Skin(calibration))
    assert len(maker.cells) == 12 * 2 + 2 * 4
    normals = np.cross(maker.cells[:, 1] - maker.cells[:, 0], maker.cells[:, 2] - maker.cells[:, 0])
    outward = np.repeat(Skin(calibration).normals, [2] * 12 + [4] * 2, axis=0)
    assert ((normals * outward).sum(axis=1) > 0).all()


def test_one_taxel_has_an_arrow():
    """Its cell gives the size; with that of its position, all lines and arrows were of size 0."""
    calibration = small_calibration(patches=(sheet(1, 1, 0.01),), response=Response((0.0, 1.0)))
    skin = Skin(calibration, switch_on=0.5)
    maker = SceneMaker(calibration, skin)
    scene = maker.scene(skin.update(np.full(skin.reading_length, 9.0), 0.0))
    assert maker.size == pytest.approx(0.01 * np.sqrt(2), rel=0.1)
    assert np.linalg.norm(scene.tails - scene.heads) == pytest.approx(0.25 * maker.size)


def test_taxel_without_a_reading_is_drawn_in_a_colour_of_its_own(sole):
    """It is not shown as one without force."""
    calibration, skin = sole
    skin.update(np.zeros(skin.reading_length), 0.0)
    reading = np.zeros(skin.reading_length)
    reading[skin.channels[7]] = np.nan
    scene = SceneMaker(calibration, skin).scene(skin.update(reading, 0.01))
    assert_allclose(scene.colours, [UNKNOWN_COLOUR] * 4)
    assert np.linalg.norm(centres(scene) - skin.positions[7], axis=1).max() < np.sqrt(skin.areas[7])


def test_arrows_end_on_the_skin_and_grow_with_the_force(sole):
    """They come from outside: along the force on the robot."""
    calibration, skin = sole
    reading = np.zeros(skin.reading_length)
    reading[skin.channels[[0, 41]]] = 3.0, 6.0
    frame = skin.update(reading, 0.0)
    scene = SceneMaker(calibration, skin, (frame,)).scene(frame)
    assert_allclose(scene.heads, [contact.position for contact in frame.contacts])
    lengths = np.linalg.norm(scene.heads - scene.tails, axis=1)
    forces = [contact.force for contact in frame.contacts]
    assert_allclose(lengths / forces, lengths[0] / forces[0])
    for tail, head, contact in zip(scene.tails, scene.heads, frame.contacts):
        assert (tail - head) @ contact.normal > 0


def test_polygons_and_cop_are_those_of_the_frame(sole):
    """In the frame of the link, just below the skin; a closed line for each."""
    calibration, skin = sole
    reading = np.zeros(skin.reading_length)
    reading[skin.channels[:20]] = 5.0
    frame = skin.update(reading, 0.0)
    scene, plane_ = SceneMaker(calibration, skin).scene(frame), skin.ground.plane
    assert set(scene.polygons) == {"outer", "nominal", "guaranteed"}
    for name, line in scene.polygons.items():
        corners = getattr(frame.polygon, name).corners
        assert len(corners) > 2
        assert_allclose(plane_.flat(line), [*corners, corners[0]], atol=1e-15)
        assert -0.05 * np.ptp(skin.positions[:, 0]) < plane_.heights(line).max() < 0
    assert_allclose(plane_.flat(scene.cop), [frame.cop], atol=1e-15)


@pytest.mark.parametrize("patch", [sheet(3, 4, 0.01), sole_patch()])
def test_frame_without_contact_shows_nothing(patch):
    """Also of a skin without ground; a refused reading draws every cell as unknown."""
    calibration = small_calibration(patches=(patch,), surfaces=(plane(),))
    skin = Skin(calibration, switch_on=0.5)
    scene = SceneMaker(calibration, skin).scene(skin.update(np.zeros(skin.reading_length), 0.0))
    assert [len(part) for part in (scene.triangles, scene.colours, scene.tails, scene.cop)] == [0, 0, 0, 0]
    assert all(line.shape == (0, 3) for line in scene.polygons.values())
    refused = skin.update(np.full(skin.reading_length, np.nan), 0.01)
    scene = SceneMaker(calibration, skin).scene(refused)
    assert_allclose(scene.colours, np.tile(UNKNOWN_COLOUR, (len(SceneMaker(calibration, skin).cells), 1)))
