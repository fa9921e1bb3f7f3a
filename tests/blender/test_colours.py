"""Colours of the view differ for readers with red-green blindness, and no state differs by its hue alone."""

from itertools import combinations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.blender.conftest import modules
from tests.blender.test_registration import draw

# Machado, Oliveira and Fernandes (2009): what complete protanopia and deuteranopia make of linear RGB.
SIGHT = {
    "normal": np.eye(3),
    "protanopia": np.array(
        ((0.152286, 1.052583, -0.204868), (0.114503, 0.786281, 0.099216), (-0.003882, -0.048116, 1.051998))
    ),
    "deuteranopia": np.array(
        ((0.367322, 0.860646, -0.227968), (0.280085, 0.672501, 0.047413), (-0.01182, 0.04294, 0.968881))
    ),
}
TO_XYZ = np.array(((0.4125, 0.3576, 0.1804), (0.2127, 0.7152, 0.0722), (0.0193, 0.1192, 0.9503)))
# [CIELAB units] Distance from which on thin lines and small cells are distinct.
MIN_OF_LINES, MIN_OF_UNKNOWN = 30.0, 20.0


def lab(colours, sight):
    """Return CIELAB coordinates (n, 3) of colours (n, >= 3), as a kind of sight has them."""
    rgb = np.array([colour[:3] for colour in colours], float)
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    xyz = np.clip(linear @ SIGHT[sight].T, 0, 1) @ TO_XYZ.T
    x, y, z = np.where(xyz > 0.008856, np.cbrt(xyz / TO_XYZ.sum(axis=1)), 7.787 * xyz / TO_XYZ.sum(axis=1) + 4 / 29).T
    return np.stack((116 * y - 16, 500 * (x - y), 200 * (y - z)), axis=1)


@pytest.fixture
def ours(extension):
    """Return the modules of the running extension that have colours."""
    names = ("overlay.layers", "overlay.scales", "live.sketch", "scene.preferences", "handles.skin_handles")
    return modules(extension, *names, "handles.plane_handles")


def states(ours):
    """Return the colours that are drawn together, by what they are of."""
    handles = ours.skin_handles.COLOURS
    return {
        "layers": [colour for _, colour in ours.preferences.COLOURS.values()],
        "contacts": ours.layers.CONTACT_COLOURS,
        "polygons": [colour for colour, _, _ in ours.layers.POLYGONS.values()],
        "touches": [colour for colour, _ in ours.layers.TOUCHES.values()],
        "planes": [*ours.sketch.COLOURS.values(), ours.sketch.REMOVED],
        "handles": [handles[name] for name in ("origin", "landmark", "zone")],
        "dials": ours.plane_handles.DIAL_COLOURS,
    }


@pytest.mark.parametrize("sight", SIGHT)
def test_colours_that_are_drawn_together_differ(ours, sight):
    """Each pair of lines or handles, for each kind of sight."""
    for what, colours in states(ours).items():
        for a, b in combinations(lab(colours, sight), 2):
            assert np.linalg.norm(a - b) > MIN_OF_LINES, (what, colours)


@pytest.mark.parametrize("sight", SIGHT)
@pytest.mark.parametrize("is_signed", [False, True])
def test_unknown_values_are_no_colour_of_the_scale(ours, sight, is_signed):
    """With deuteranopia, a medium grey is the middle of the rising scale: an unknown value would be a number."""
    legend = ours.scales.Legend("", "FRACTION", 1.0, is_signed)
    known = legend.colours(np.linspace(legend.minimum, 1, 101))
    unknown = legend.colours(np.array([np.nan]))
    assert np.linalg.norm(lab(known, sight) - lab(unknown, sight), axis=1).min() > MIN_OF_UNKNOWN


@pytest.mark.parametrize("sight", SIGHT)
def test_scales_rise_in_lightness_and_their_signs_differ(ours, sight):
    """Heat maps are read without hue; the two signs differ in a hue that red-green blind readers see."""
    assert (np.diff(lab(ours.scales.RISING, sight)[:, 0]) > 8).all()
    signed = lab(ours.scales.SIGNED, sight)
    assert (np.diff(signed[:3, 0]) > 8).all() and (np.diff(signed[2:, 0]) < -8).all()
    assert (np.linalg.norm(signed[:2] - signed[:2:-1], axis=1) > MIN_OF_LINES).all()


def test_states_of_lines_differ_in_dashes_or_width_too(ours):
    """Polygons by both; touches that are far away are dashed; handles have other shapes."""
    styles = {(width, is_dashed) for _, width, is_dashed in ours.layers.POLYGONS.values()}
    assert len(styles) == len(ours.layers.POLYGONS)
    boxes = ours.skin_handles.BOXES
    assert boxes["origin"] != boxes["landmark"] and len(boxes["zone"]) == 2


def test_dashes_are_equal_parts_of_a_segment(ours):
    """A dash at each end, gaps as long as dashes; a short segment is one dash."""
    ends = np.array(((0, 0, 0), (5.2, 0, 0), (1, 1, 1), (1, 1, 1.5)))
    found = ours.layers.dashed(ends, 1.0)
    assert_allclose(found[:6, 0], 5.2 / 5 * np.arange(6), rtol=1e-6)
    assert_allclose(found[6:], ends[2:])


def test_field_without_its_file_is_not_only_red(bpy, link):
    """The reason is below it in words."""
    skin = link.skin_calib.skins.add()
    skin.kind, skin.opened = "imported", True
    assert "Choose the file that has the taxels" in " ".join(draw(bpy, "skin"))
