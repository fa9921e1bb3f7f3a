"""What a sole learns about the ground from its cells."""

import numpy as np
import pytest
from sole_frames import frame_of


def test_largest_foothold_agrees_with_brute_force():
    from biped import skins
    from foothold import Foothold

    from skin_calib_addon.runtime import Skin

    foothold, rng = Foothold(Skin(skins()["sole"])), np.random.default_rng(2)
    for _ in range(5):
        foothold.void = rng.random(len(foothold.places)) < 0.03
        area, cells = foothold._rectangle(), (len(foothold.xs), len(foothold.ys))
        assert not any(area.contains(place) for place in foothold.places[foothold.void])
        largest, grid = 0, np.zeros(cells, bool)
        grid[foothold.column[foothold.void], foothold.row[foothold.void]] = True
        for a in range(cells[0]):
            for b in range(a + 1, cells[0] + 1):
                for c in range(cells[1]):
                    for d in range(c + 1, cells[1] + 1):
                        largest = max(largest, (b - a) * (d - c) * (not grid[a:b, c:d].any()))
        assert sum(area.contains(place) for place in foothold.places) == largest


def see(foothold, pressed, slope):
    """Give a foothold a frame twice, as a foot that stands does."""
    for _ in range(2):
        foothold.update(frame_of(foothold, pressed), slope)


def test_cell_that_is_active_in_one_frame_only_is_not_pressed():
    """Noise over a pit does not make the foothold larger."""
    from biped import skins
    from foothold import Foothold

    from skin_calib_addon.runtime import Skin

    foothold = Foothold(Skin(skins()["sole"]))
    x, ahead = foothold.places[:, 0], np.array((-0.01, 0.0))
    see(foothold, x < 0.015, ahead)
    for _ in range(foothold.frames):
        foothold.update(frame_of(foothold, np.abs(x) < 0.011), ahead)
    void, bounds = foothold.void.copy(), foothold.area.bounds
    assert void.any()
    noisy = np.abs(x) < 0.011
    cells = np.flatnonzero(void)[:2]
    noisy[cells] = True
    foothold.update(frame_of(foothold, noisy), ahead)
    foothold.update(frame_of(foothold, np.abs(x) < 0.011), ahead)
    np.testing.assert_array_equal(foothold.void, void)
    np.testing.assert_array_equal(foothold.area.bounds, bounds)
    see(foothold, noisy, ahead)
    assert not foothold.void[cells].any()


def test_foothold_ends_at_the_line_about_which_the_sole_turns():
    """First the inner half is pressed, then only the row at its edge: the cells beyond are void, and no others."""
    from biped import skins
    from foothold import Foothold

    from skin_calib_addon.runtime import Skin

    foothold = Foothold(Skin(skins()["sole"]))
    inner, edge = foothold.places[:, 1] > -0.001, np.abs(foothold.places[:, 1]) < 0.001
    ends = np.abs(foothold.places[:, 0]) > 0.05  # what is between them is in the hull of the pressed cells
    outward = np.array((0.0, 0.01))  # the outer side is lower
    see(foothold, inner & ends, outward)
    for _ in range(foothold.frames):
        foothold.update(frame_of(foothold, edge & ends), outward)
    assert (foothold.void[foothold.places[:, 1] < -0.001]).all() and not foothold.void[inner].any()
    assert foothold.area.bounds[0][1] == pytest.approx(-0.005) and foothold.area.contains((-0.09, 0.04))


def test_sole_that_rolls_on_full_ground_has_no_void_cells():
    """Three rows at the edge are pressed at the landing, then the outermost one alone."""
    from biped import skins
    from foothold import Foothold

    from skin_calib_addon.runtime import Skin

    foothold = Foothold(Skin(skins()["sole"]))
    see(foothold, foothold.places[:, 1] > 0.015, np.array((0.0, -0.01)))
    for _ in range(2 * foothold.frames):
        foothold.update(frame_of(foothold, foothold.places[:, 1] > 0.035), np.array((0.0, -0.01)))
    assert not foothold.void.any()


def test_silent_cell_that_is_higher_than_the_pressed_ones_is_no_evidence():
    """The front edge of the ground carries most of the load: cells ahead of it are void, those that hover are not."""
    from biped import skins
    from foothold import Foothold

    from skin_calib_addon.runtime import Skin

    foothold = Foothold(Skin(skins()["sole"]))
    x, y = foothold.places.T
    pressed = (np.abs(x + 0.04) < 0.031) & (y > -0.001)  # the sole is lower ahead, and on the side of y > 0
    frame = frame_of(foothold, pressed)
    frame.forces = pressed * (20.0 + 300.0 * x)
    for _ in range(foothold.frames + 1):
        foothold.update(frame, np.array((-0.005, -0.007)))
    hovers = (x < -0.005) & (y < -0.005)
    assert foothold.void[(x > 0.005) & (y > -0.001)].all() and not foothold.void[hovers].any()


def test_next_foothold_is_expected_to_be_like_the_last_one():
    """The void cells stay void while the foot is in the air; on other ground they are found to be solid."""
    from biped import skins
    from foothold import Foothold

    from skin_calib_addon.runtime import Skin

    foothold = Foothold(Skin(skins()["sole"]))
    x, ahead = foothold.places[:, 0], np.array((-0.01, 0.0))  # the sole is lower ahead
    see(foothold, (x > -0.065) & (x < 0.015), ahead)
    for _ in range(foothold.frames):
        foothold.update(frame_of(foothold, np.abs(x) < 0.011), ahead)
    beam = foothold.area.bounds
    assert beam[1][0] == pytest.approx(0.015)
    foothold.lift()
    np.testing.assert_array_equal(foothold.area.bounds, beam)
    assert not foothold.inside.any()
    see(foothold, x > -0.065, ahead)
    assert foothold.area.bounds[1][0] == pytest.approx(0.095)
