"""Drives what is drawn: the legend in the view, the measure of the error, outlines of cells, the number of redraws."""

from time import process_time

import blf
import bpy
import numpy as np
from buttons import press
from mathutils import Quaternion, Vector
from sample import follow, hover_view, link, open_steps, ours, pink, plan

# Cosine between a cell's normal and the direction to the eye above which its outline is looked at.
MIN_FACING = 0.15
# Fraction of the points of these outlines that are white.
MIN_DRAWN = 0.99


def drive(gui):
    yield from gui.tab("Skin")
    yield from open_steps(gui)
    yield from press(gui, "skin_calib.fit")
    yield from gui.wait(lambda: plan().result.key, 60, "the fit")
    yield from draws_the_legend_in_the_view(gui)
    yield from has_one_measure_of_the_error(gui)
    yield from turns_to_a_hidden_place(gui)
    yield from draws_complete_outlines(gui)
    yield from redraws_for_new_pictures_only(gui)


def texts_of_the_legend(gui):
    """Draw, and return the texts of the legends: text, left, right and lower end [pixels of the region]."""
    area, found = ours("overlay.legend").LegendArea, []
    text = area._text

    def note(self, words, x, y):
        text(self, words, x, y)
        left = self.left + x * self.pixel
        found.append((words, left, left + blf.dimensions(0, words)[0], self.low + y * self.pixel))

    area._text = note
    yield from hover_view(gui)
    gui.area().tag_redraw()
    yield from gui.redraw()
    area._text = text
    return found[-5:]  # of the last draw: three numbers, title, link


def draws_the_legend_in_the_view(gui):
    """After a fit by the mouse the legend is in the view, and its numbers do not overlap, in metres, too."""
    plan().inspect.heat = "ERROR"
    units = bpy.context.scene.unit_settings
    for unit in ("METERS", "MILLIMETERS"):
        units.length_unit = unit
        texts = yield from texts_of_the_legend(gui)
        yield from gui.shot(f"legend_{unit.lower()}.png")
        assert len(texts) == 5, texts
        view, side = gui.region(), gui.region("UI")
        for words, left, right, low in texts:
            assert left >= 0 and view.x + right < side.x and 0 <= low < view.height / 2, (words, left, right, low)
        numbers = sorted(texts[:3], key=lambda text: text[1])
        assert all(a[2] + 4 <= b[1] for a, b in zip(numbers, numbers[1:])), numbers


def has_one_measure_of_the_error(gui):
    """The legend ends at the maximum of the panel; Show Maximum Deviation marks the brightest point."""
    layer = next(layer for layer in ours("overlay.drawing").shown_layers(link()) if layer.what == "ERROR")
    metre = ours("scene.units").metres_per_unit(bpy.context.scene)
    assert abs(layer.legend.maximum - plan().result.max * metre) < 1e-9, (layer.legend.maximum, plan().result.max)
    yield from press(gui, "skin_calib.show_worst")
    yield from hover_view(gui)
    yield from gui.redraw(2)
    yield from gui.shot("maximum.png")
    brightest = layer.points[(layer.colours[:, :3] == np.float32(layer.legend.scale[-1])).all(axis=1)] / metre
    cursor = np.array(bpy.context.scene.cursor.location)
    assert np.linalg.norm(brightest - cursor, axis=1).min() < 1e-6 / metre
    is_in_the_free_middle(gui, cursor)
    yield from press(gui, "skin_calib.show_worst")
    yield from hover_view(gui)
    yield from gui.redraw(2)
    assert pink(gui) == 0
    plan().inspect.heat = "NONE"


def is_in_the_free_middle(gui, place):
    """A place of the world is in the middle of the view to the left of the sidebar, with the mark."""
    region, side = gui.region(), gui.region("UI")
    x, y = gui.at(Vector(place))
    assert abs(x - (region.x + side.x) / 2) < 3 and abs(y - region.y - region.height / 2) < 3, (x, y)
    assert pink(gui) > 50


def turns_to_a_hidden_place(gui):
    """From behind the link, Show Maximum Deviation turns the view so that nothing hides the place."""
    view = gui.area().spaces.active.region_3d
    for kind in ("PERSP", "ORTHO"):
        view.view_perspective = kind
        view.view_rotation = view.view_rotation @ Quaternion((0, 1, 0), np.pi)
        yield from gui.redraw(2)
        distance = view.view_distance
        yield from press(gui, "skin_calib.show_worst")
        yield from hover_view(gui)
        yield from gui.redraw(2)
        yield from gui.shot(f"hidden_{kind.lower()}.png")
        place = bpy.context.scene.cursor.location
        is_in_the_free_middle(gui, place)
        ahead = view.view_rotation @ Vector((0, 0, 1))
        eye = view.view_location + distance * ahead if kind == "PERSP" else place + distance * ahead
        found = bpy.context.scene.ray_cast(bpy.context.evaluated_depsgraph_get(), eye, place - eye)
        assert found[0] and (found[1] - place).length < 1e-3 * distance, (found[1], place)
        assert abs(view.view_distance - distance) < 1e-6
        yield from press(gui, "skin_calib.show_worst")
    view.view_perspective = "PERSP"


def draws_complete_outlines(gui):
    """At an oblique view, too, the outline of each visible cell is a continuous line."""
    plan().layers = {"CELLS"}
    bpy.context.preferences.view.smooth_view = 0
    view = gui.area().spaces.active.region_3d
    for angle in (0.0, 0.6, 1.0):
        with gui.context():
            bpy.ops.view3d.view_axis(type="LEFT")
            bpy.ops.view3d.view_orbit(angle=angle, type="ORBITUP")
            bpy.ops.view3d.view_selected()
        assert view.view_perspective == "ORTHO"
        view.view_location += view.view_rotation @ Vector((0.2 * view.view_distance, 0, 0))  # clear of the side bar
        yield from hover_view(gui)
        yield from gui.redraw(2)
        yield from gui.shot(f"outlines_{angle:.1f}.png")
        drawn = white_at(gui, visible_points(gui, view))
        assert len(drawn) > 300 and drawn.mean() > MIN_DRAWN, (angle, len(drawn), drawn.mean())
    plan().layers = {"SURFACE", "CELLS", "NORMALS"}


def visible_points(gui, view):
    """Return points on the drawn outlines of cells that face the eye, and that nothing hides, in the world."""
    drawing = ours("overlay.drawing")
    (patch,) = drawing.patches_of(link())
    (layer,) = (layer for layer in drawing.shown_layers(link()) if layer.what == "CELLS")
    metre = ours("scene.units").metres_per_unit(bpy.context.scene)
    to_world = ours("scene.link_meshes").link_frame(link())
    ahead = view.view_rotation @ Vector((0, 0, 1))  # these views are orthographic
    depsgraph, found = bpy.context.evaluated_depsgraph_get(), []
    sides = layer.points.reshape(len(patch.taxels.ids), -1, 2, 3) / metre
    for outline, normal in zip(sides, patch.taxels.normals_link):
        normal = to_world.to_3x3() @ Vector(normal)
        if normal.dot(ahead) < MIN_FACING:
            continue
        for a, b in outline:
            for fraction in np.arange(0.05, 1, 0.1):
                point = to_world @ Vector((1 - fraction) * a + fraction * b)
                if not bpy.context.scene.ray_cast(depsgraph, point + 0.001 / metre * normal, ahead)[0]:
                    found.append(point)
    return found


def white_at(gui, points):
    """Return whether the view is white within two pixels of each point."""
    area, pixels = gui.area(), gui.pixels("VIEW_3D").astype(int)
    white = (pixels > 200).all(axis=2)
    found = []
    for point in points:
        x, y = gui.at(point)
        column, row = x - area.x, area.height - 1 - (y - area.y)
        found.append(white[row - 2 : row + 3, column - 2 : column + 3].any())
    return np.array(found)


def redraws_for_new_pictures_only(gui):
    """A change with Live on requests two draws, of the preview and of the result. Blender draws the change, too: it
    draws the whole window when a property of an extension changes.
    """
    bpy.context.preferences.system.viewport_aa = "OFF"  # which draws each picture eight times
    yield from follow(gui)
    yield from gui.wait(lambda: not plan().result.outdated, 60, "the result")
    yield from hover_view(gui)
    yield 1.0
    draws, requests, drawing = [], [], ours("overlay.drawing")
    redraw = drawing.redraw
    drawing.redraw = lambda: requests.append(plan().result.outdated) or redraw()
    handle = bpy.types.SpaceView3D.draw_handler_add(
        lambda: draws.append(plan().result.outdated), (), "WINDOW", "POST_PIXEL"
    )
    key, start = plan().result.key, process_time()
    plan().grid.n += 1
    while plan().result.key == key or plan().result.outdated:
        yield 0.2
    yield 0.5
    seconds = process_time() - start
    bpy.types.SpaceView3D.draw_handler_remove(handle, "WINDOW")
    drawing.redraw = redraw
    print(f"{len(draws)} draws, {seconds:.2f} s of CPU time for a change with preview and fit, without a graphics card")
    assert requests == [True, False], requests
    assert len(draws) <= 3 and not draws[-1], draws
