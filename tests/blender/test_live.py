"""Live fit: surface and skin follow the plan; no file, no undo step and no other link knows of a preview."""

from threading import Event

import pytest

from tests.blender.conftest import look


@pytest.fixture
def following(bpy, link, addon):
    """A fitted link that follows its plan."""
    bpy.ops.skin_calib.fit()
    bpy.context.object.skin_calib.live = True
    return bpy.context.object


def rest(live, monkeypatch):
    """Let the plan rest: the timer draws, then finishes."""
    while live.tick() is not None:
        monkeypatch.setattr(live, "FIT_DELAY", 0.0)


def test_surface_and_skin_follow_a_change(bpy, addon, live, following, monkeypatch):
    """A preview is drawn at once, with its mean; after a rest the result is the one that the button gives."""
    plan = following.skin_calib
    before = plan.result.key
    plan.grid.n += 2
    assert plan.result.outdated and bpy.app.timers.is_registered(live.tick)
    look(live)
    assert following.name in addon.overlay.previews and plan.result.key == before
    assert 0 < live.reports[following.name].mean < 1e-3
    rest(live, monkeypatch)
    assert not addon.overlay.previews and not live.reports and not plan.result.outdated
    followed = plan.result.key, plan.result.mean
    bpy.ops.skin_calib.fit()
    assert (plan.result.key, plan.result.mean) == followed and followed[0] != before


def test_many_changes_make_one_fit(live, preview, following, monkeypatch):
    """While the hand moves only the last state counts."""
    fits = []
    monkeypatch.setattr(preview, "fit_grid", lambda *words, real=preview.fit_grid: fits.append(1) or real(*words))
    for n in range(6, 16):
        following.skin_calib.grid.n = n
    look(live)
    look(live)
    assert len(fits) == 1


def test_change_of_a_skin_needs_no_other_surface(bpy, addon, live, preview, following, monkeypatch):
    """Rows, origins and the like lay the skin anew on the last surface; planes and the mesh ask for another."""
    fits = []
    monkeypatch.setattr(preview, "fit_grid", lambda *words, real=preview.fit_grid: fits.append(1) or real(*words))
    plan = following.skin_calib
    plan.grid.n += 1
    look(live)
    for rows in (1, 3):
        plan.skins[0].rows = rows
        look(live)
        cells = next(a for a in addon.overlay.previews[following.name] if a.what == "CELLS")
        assert len(cells.points) == rows * plan.skins[0].columns * 8
    assert len(fits) == 1
    following.data.vertices[0].co.z += 1e-4
    plan.skins[0].rows = 2
    look(live)
    plan.grid.n += 1
    look(live)
    assert len(fits) == 3
    rest(live, monkeypatch)
    assert not plan.result.outdated


def test_plan_that_cannot_be_fitted_says_why_and_recovers(live, following, monkeypatch):
    """The last result stays; the next sound plan is drawn again."""
    plan = following.skin_calib
    key = plan.result.key
    plan.skins[0].rows = 900
    rest(live, monkeypatch)
    assert "beyond the edge" in live.reports[following.name].problem and plan.result.key == key and plan.result.outdated
    plan.skins[0].rows = 2
    rest(live, monkeypatch)
    assert not live.reports and not plan.result.outdated


def test_link_that_does_not_follow_is_left_alone(bpy, live, link):
    """Without Live a change fits nothing; switched off, what waits is forgotten."""
    bpy.ops.skin_calib.fit()
    plan = bpy.context.object.skin_calib
    plan.grid.n += 1
    assert live.tick() is None and plan.result.outdated
    plan.live = True
    plan.live = False
    assert live.tick() is None and plan.result.outdated


def test_object_that_goes_or_changes_its_name_stops_nothing(bpy, live, following):
    """Renamed, deleted, without a link name: forgotten."""
    plan = following.skin_calib
    plan.grid.n += 1
    following.name = "other"
    assert live.tick() is None
    plan.grid.n += 1
    plan.link = ""
    assert live.tick() is None
    plan.link = "arm"
    bpy.data.objects.remove(following)
    assert live.tick() is None


def test_undo_takes_the_preview_away(bpy, addon, live, following, monkeypatch):
    """And the link catches up with the plan that came back."""
    bpy.ops.ed.undo_push(message="before")
    following.skin_calib.grid.n = 14
    bpy.ops.ed.undo_push(message="after")
    look(live)
    assert addon.overlay.previews
    bpy.ops.ed.undo()
    link = bpy.context.object
    assert not addon.overlay.previews and link.skin_calib.grid.n != 14
    rest(live, monkeypatch)
    assert not link.skin_calib.result.outdated


def test_new_file_forgets_what_waits(bpy, addon, live, following):
    """Nothing of the old file is fitted in the new one."""
    following.skin_calib.grid.n += 1
    look(live)
    bpy.ops.wm.read_homefile(use_empty=True)
    assert not addon.overlay.previews and not live.reports and live.tick() is None


OTHER = {
    "mesh": lambda link: setattr(link.data.vertices[0], "co", link.data.vertices[0].co * 1.001),
    "modifier": lambda link: setattr(link.modifiers.new("thicker", "DISPLACE"), "strength", 1e-4),
    "place": lambda link: setattr(link, "location", (0.001, 0, 0)),
}


@pytest.mark.parametrize("change", OTHER.values(), ids=OTHER)
@pytest.mark.parametrize("follow", [False, True])
def test_other_mesh_modifier_or_place_outdates_the_result(bpy, live, link, change, follow, monkeypatch):
    """Of links that follow, and of those that do not; what changes nothing is not taken for a change."""
    bpy.ops.skin_calib.fit()
    link = bpy.context.object
    link.skin_calib.live = follow
    for act in (lambda link: None, change):
        rest(live, monkeypatch)
        assert not link.skin_calib.result.outdated
        key = link.skin_calib.result.key
        act(link)
        link.data.update()
        bpy.context.view_layer.update()
        live.tick()
    assert link.skin_calib.result.outdated
    rest(live, monkeypatch)
    assert link.skin_calib.result.outdated != follow
    assert (link.skin_calib.result.key != key) == follow


def test_fit_goes_on_beside_the_window(bpy, live, following, monkeypatch):
    """A change while the last step runs stops that, and the plan's own result is the one that is kept."""
    go_on, begun = Event(), Event()

    def slowly(plan, mesh, begin, real=live.results.fit):
        begun.set()
        go_on.wait(20)
        return real(plan, mesh, begin)

    plan = following.skin_calib
    monkeypatch.setattr(live.results, "fit", slowly)
    plan.grid.n = 8
    look(live)
    monkeypatch.setattr(live, "FIT_DELAY", 0.0)
    assert live.tick() == live.POLL_INTERVAL and begun.is_set()
    plan.grid.n = 12
    look(live)
    assert live.reports[following.name].mean > 0, "the new plan is drawn while the old fit still runs"
    go_on.set()
    rest(live, monkeypatch)
    assert not plan.result.outdated and plan.result.control_points == 12 * 12


def test_link_that_does_not_follow_is_never_fitted(bpy, live, link, monkeypatch):
    """Its cuts are sketched; however slow the window is, its author fits it."""
    bpy.ops.skin_calib.fit()
    key = link.skin_calib.result.key
    monkeypatch.setattr(live, "FIT_DELAY", 0.0)
    bpy.context.scene.cursor.location = (0, 0, 0.03)
    bpy.ops.skin_calib.cut_add()
    rest(live, monkeypatch)
    assert link.name in live.sketches and link.skin_calib.result.outdated and link.skin_calib.result.key == key


def test_mesh_that_is_touched_by_looking_at_it_is_looked_at_once(bpy, live, link, monkeypatch):
    """Blender evaluates an object with nodes anew when a property of it is written or its mesh is read."""
    bpy.ops.skin_calib.fit()
    looks = []

    def touching(link, context, real=live.scene.read_facets):
        looks.append(link.name)
        assert len(looks) < 9, "it looks for ever"
        live._possibly_changed.add(link.name)
        return real(link, context)

    monkeypatch.setattr(live.scene, "read_facets", touching)
    link.location = (0.001, 0, 0)
    bpy.context.view_layer.update()
    live._check_possibly_changed()
    assert looks == ["arm"] and link.skin_calib.result.outdated
