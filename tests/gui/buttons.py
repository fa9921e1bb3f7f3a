"""Find and press buttons of the sidebar: many positions are checked in one iteration of Blender's event loop.

With one position per iteration the sidebar is drawn each time, and a long sidebar needs hundreds of positions. Mouse
moves in one queue are handled together. After each of them a key in the queue records what is under the mouse.
"""

import bpy

ROW = 13  # a button is 20 pixels high at a scale of one
# Fractions of the width at which rows of up to four buttons, and those next to lists, are met; the middle first.
COLUMNS = (0.5, 0.17, 0.83, 0.28, 0.7)
FINE = 4  # pixels between the places at which the ends of a button are looked for
TAB = 20  # a tab is higher than this
HIGH = 40  # pixels above and below a place on a button, among which its ends are

_seen = []


class Seen(bpy.types.Operator):
    """Record the button under the mouse."""

    bl_idname = "wm.skin_calib_seen"
    bl_label = "Note the button under the mouse"

    def invoke(self, context, event):
        _seen.append(_under_mouse(context.window_manager))
        return {"FINISHED"}


def _under_mouse(manager):
    """Return the operator call or the property path of the button under the mouse; None without a button."""
    asks = ((bpy.ops.ui.copy_python_command_button, {}), (bpy.ops.ui.copy_data_path_button, {"full_path": True}))
    for ask, options in asks:
        manager.clipboard = ""
        if ask.poll() and "FINISHED" in ask(**options) and manager.clipboard:
            return manager.clipboard
    return None


def press(gui, name):
    """Find a button and click it."""
    x, y = yield from find(gui, name)
    yield from gui.click(x, y)
    yield from gui.redraw()


def find(gui, name):
    """Move to the centre of a button of the sidebar, named as for ``gui.find``; scroll if necessary."""
    here, known = gui.region("UI"), set()
    for scroll in PAGES:
        if (yield from scroll(gui)):
            break
        for x in [here.x + here.width * fraction for fraction in COLUMNS]:
            places = [(x, y) for y in _rows(here)]
            seen = yield from _look(gui, places)
            known |= {one for one in seen if one}
            hits = [(one, at) for one, at in zip(seen, places) if one and _is_named(one, name)]
            if hits:
                return (yield from _middle(gui, here, *hits[0]))
    raise LookupError(f"no button {name!r} in the sidebar; there are {sorted(known)}")


def _page(key):
    """Return what scrolls the sidebar by a key, or not at all, and returns whether it was at its end."""

    def scroll(gui):
        here = gui.region("UI")
        before = tuple(here.view2d.region_to_view(0, 0))
        if key:
            yield from gui.move(here.x + here.width / 2, here.y + here.height / 2)
            yield from gui.key(key)
            yield from gui.redraw()
        return key == "PAGE_DOWN" and before == tuple(here.view2d.region_to_view(0, 0))

    return scroll


PAGES = [_page(key) for key in (None, "HOME", *["PAGE_DOWN"] * 20)]  # of a sidebar, the present one first


def open_tab(gui, name):
    """Click on a tab of the sidebar, which N opens. Tabs cannot be asked for their names: others are tried first.

    A click on the open tab closes the sidebar.
    """
    if not gui.area().spaces.active.show_region_ui:
        yield from gui.key("N")
        yield from gui.redraw(3)
    here, step = gui.region("UI"), round(TAB * bpy.context.preferences.system.ui_scale)
    right, width = here.x + here.width, here.width
    for y in range(here.y + here.height - step, here.y, -step):
        if here.active_panel_category == name:
            break
        yield from _try_click(gui, right - step / 2, y)
        if gui.region("UI").width < width:
            yield from _try_click(gui, right - step / 2, y)
    assert gui.region("UI").width == width and here.active_panel_category == name, f"no tab {name!r} in the sidebar"


def open_line(gui, states, name):
    """Click on the line of a closed part of the sidebar; scroll if necessary. Others are tried, and closed again.

    Lines are no buttons. ``states`` returns the properties that keep what is open.
    """
    if getattr(states(), name):
        return
    for scroll in PAGES:
        if (yield from scroll(gui)):
            break
        for place in (yield from _without_button(gui)):
            before = _open(states())
            yield from _try_click(gui, *place)
            if name in _open(states()):
                return
            if before != _open(states()):
                yield from _try_click(gui, *place)
    raise LookupError(f"no line {name!r} in the sidebar")


def _open(states):
    """Return the names of the properties that are switched on."""
    items = states.bl_rna.properties
    return {item.identifier for item in items if item.type == "BOOLEAN" and getattr(states, item.identifier)}


def _without_button(gui):
    """Return the positions in the left third of the sidebar where there is no button."""
    here = gui.region("UI")
    places = [(here.x + 0.3 * here.width, y) for y in _rows(here)]
    seen = yield from _look(gui, places)
    known = {one: place for place, one in reversed([*zip(places, seen)]) if one}  # the first place of each
    empty = set(places)
    # Without a button the last one is recorded again: the known one, if the mouse comes from there. Twice, because a
    # button can be at several places.
    for one, start in [*known.items()][-2:]:
        seen = yield from _look(gui, [at for place in places for at in (start, place)])
        empty &= {place for place, button in zip(places, seen[1::2]) if button == one and place != start}
    return [place for place in places if place in empty]


def _rows(here):
    """Return heights such that each row of a sidebar is met."""
    step = round(ROW * bpy.context.preferences.system.ui_scale)
    return range(here.y + here.height - step, here.y, -step)


def _try_click(gui, x, y):
    """Click where the tab or line may be that is looked for. If clicks are counted, these are not."""
    yield from type(gui).click(gui, x, y)
    yield from gui.redraw(2)


def _is_named(button, name):
    """Return whether this is an operator call that starts with the name, or a data path that ends with it."""
    call = "bpy.ops." + (name if "(" in name else name + "(")
    return button.startswith(call) or button == name or button.endswith("." + name)


def _middle(gui, here, button, place):
    """Move to the centre of the button at this position: number fields have arrows at their ends."""
    x, y = place
    xs = [here.x + k for k in range(0, here.width, FINE)]
    x = yield from _between(gui, button, [(one, y) for one in xs], 0)
    ys = [y + k for k in range(-HIGH, HIGH + 1, FINE)]
    y = yield from _between(gui, button, [(x, one) for one in ys], 1)
    yield from gui.move(x, y)
    return x, y


def _between(gui, button, places, coordinate):
    """Return the centre of the positions of a button, in one coordinate."""
    first = yield from _first(gui, button, places)
    last = yield from _first(gui, button, places[::-1])
    return round((first[coordinate] + last[coordinate]) / 2)


def _first(gui, button, places):
    """Return the first position of a button."""
    seen = yield from _look(gui, places)
    return places[seen.index(button)]


def _look(gui, places):
    """Return the button that was last under the mouse at each position, one after the other.

    To leave a button takes one move, to enter the next one another. Without a button the last one is recorded again.
    """
    _ready()
    yield from gui.move(*places[0])  # and draw: that forgets the last one
    _seen.clear()
    for x, y in places:
        for kind, value in (*[("MOUSEMOVE", "NOTHING")] * 2, ("F24", "PRESS"), ("F24", "RELEASE")):
            gui.window.event_simulate(type=kind, value=value, x=round(x), y=round(y))
    yield from gui.wait(lambda: len(_seen) == len(places), 30, "the buttons under the mouse")
    return _seen[:]


def _ready():
    """Bind the key that records what is under the mouse."""
    if not Seen.is_registered:
        bpy.utils.register_class(Seen)
        keymap = bpy.context.window_manager.keyconfigs.addon.keymaps.new("Window")
        keymap.keymap_items.new(Seen.bl_idname, "F24", "PRESS")
