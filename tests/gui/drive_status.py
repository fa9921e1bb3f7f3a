"""Drives the state of a link: a refused fit, its place, the button that mends it; steps that close; no scrolling."""

from buttons import press
from sample import hover_view, pink, plan

# A long warning and its advice, as that of a narrow link.
WARNING = (
    "The surface is 7.96 mm (limit 2 mm) off the mesh at (-12.4, 33.0, -118.2) mm, near u-plane 3 and half-plane at "
    "221.8 degrees."
)
ADVICE = "Cut away what protrudes there, move the planes away from it, or use more planes."
WIDTHS = 500, 250, 170  # of the sidebar, at which its texts are looked at [pixel]


def drive(gui):
    yield from gui.tab("Skin")
    yield from closes_what_is_done(gui)
    yield from folds_many_warnings(gui)
    yield from refuses_with_a_place(gui)
    yield from stays_while_scrolled(gui)
    yield from mends_it(gui)
    yield from breaks_its_lines(gui)


def is_scrolled(gui):
    """Return whether the content is longer than the sidebar: then a page down moves it."""
    here = gui.region("UI")
    yield from gui.move(here.x + here.width / 2, here.y + here.height / 2)
    yield from gui.key("HOME")
    yield from gui.redraw(2)
    before = tuple(here.view2d.region_to_view(0, 0))
    yield from gui.key("PAGE_DOWN")
    yield from gui.redraw(2)
    after = tuple(here.view2d.region_to_view(0, 0))
    yield from gui.key("HOME")
    yield from gui.redraw(2)
    return before != after


def closes_what_is_done(gui):
    """Before the fit and after it nothing is scrolled; the first fit opens the skin."""
    assert not (yield from is_scrolled(gui)), "the tab is longer than the sidebar before the fit"
    yield from gui.shot("start.png")
    yield from press(gui, "skin_calib.fit")
    yield from gui.wait(lambda: plan().result.key, 30, "the fit")
    yield from gui.redraw(2)
    assert plan().steps.skin and not plan().steps.grid
    assert not (yield from is_scrolled(gui)), "the tab is longer than the sidebar after the fit"
    yield from hover_view(gui)
    yield from gui.shot("fitted.png")


def folds_many_warnings(gui):
    """With seven long warnings nothing is scrolled while a sheet is edited; the folded list has all of them."""
    before = len(plan().result.warnings)
    for k in range(7):
        record = plan().result.warnings.add()
        record.code, record.severity, record.message = "off-mesh", "warning", f"{k} {WARNING}"
        record.advice, record.has_point, record.point = ADVICE, True, (0.03, 0.0, 0.05)
    yield from gui.redraw(2)
    assert not (yield from is_scrolled(gui)), "the tab with seven warnings is longer than the sidebar"
    yield from hover_view(gui)
    yield from gui.shot("seven.png")
    yield from press(gui, "skin_calib.steps.warnings")
    yield from gui.redraw(2)
    yield from hover_view(gui)
    yield from gui.shot("seven_open.png")
    assert plan().steps.warnings
    yield from press(gui, "skin_calib.steps.warnings")
    assert not plan().steps.warnings
    while len(plan().result.warnings) > before:
        plan().result.warnings.remove(before)


def refuses_with_a_place(gui):
    """The reason of a refused fit stays; Show marks the first cell outside."""
    plan().skins[0].rows = 12
    yield from gui.redraw(2)
    before = pink(gui)
    yield from press(gui, "skin_calib.fit")
    yield from gui.redraw(3)
    assert not (yield from is_scrolled(gui)), "the tab is longer than the sidebar after a refusal"
    yield from press(gui, "skin_calib.show_warning")
    yield from hover_view(gui)
    yield from gui.redraw(3)
    yield from gui.shot("refused.png")
    assert pink(gui) > before + 50, "the place of the refusal is not marked"


def stays_while_scrolled(gui):
    """At the end of a long tab the header of the view still has the state; it opens the same buttons."""
    for name in ("link", "mesh", "cut", "grid", "fit", "more_skin"):
        setattr(plan().steps, name, True)
    yield from gui.redraw(2)
    here = gui.region("UI")
    yield from gui.move(here.x + here.width / 2, here.y + here.height / 2)
    yield from gui.key("PAGE_DOWN")
    yield from gui.redraw(2)
    header = gui.region("TOOL_HEADER")
    yield from gui.click(header.x + header.width - 60, header.y + header.height / 2)
    yield 1.0
    yield from gui.shot("popover.png")
    yield from gui.key("ESC")
    yield from gui.redraw(2)
    for name in ("link", "mesh", "cut", "grid", "fit", "more_skin"):
        setattr(plan().steps, name, False)


def mends_it(gui):
    """The button does what the refusal advises, and the next fit succeeds."""
    yield from press(gui, "wm.context_set_boolean")
    assert plan().skins[0].trim
    yield from press(gui, "skin_calib.fit")
    yield from gui.wait(lambda: not plan().result.outdated, 30, "the fit")
    yield from hover_view(gui)
    yield from gui.redraw(2)
    yield from gui.shot("mended.png")


def breaks_its_lines(gui):
    """Texts are broken at the width of the sidebar."""
    plan().skins[0].trim = False
    yield from press(gui, "skin_calib.fit")
    yield from gui.redraw(2)
    for width in WIDTHS:
        here = gui.region("UI")
        edge = here.x, here.y + here.height / 2
        yield from gui.drag(edge, (here.x + here.width - width, edge[1]), mods=())
        yield from gui.redraw(3)
        yield from gui.shot(f"wide_{width}.png")
        assert abs(gui.region("UI").width - width) < 5
