"""Preferences of the extension: the skin that is proposed, colours and sizes."""

import importlib

import pytest


@pytest.fixture
def settings(bpy, extension):
    """Return the preferences, which are restored afterwards."""
    found = bpy.context.preferences.addons[extension].preferences
    yield found
    for item in found.bl_rna.properties:
        if item.identifier not in ("rna_type", "bl_idname"):
            found.property_unset(item.identifier)


def test_scene_without_a_skin_gets_that_of_the_preferences(bpy, extension, settings, monkeypatch):
    """The skin of the scene has priority."""
    robot = importlib.import_module(f"{extension}.operators.robot")
    wanted = []
    monkeypatch.setattr(robot, "parse_skin", lambda text: wanted.append(text) or None)
    monkeypatch.setattr(robot.Working, "chosen", lambda self, context: None)
    scene, propose = bpy.context.scene.skin_calib, type("Stub", (robot.Propose,), {})()
    settings.skin = "hexagons:8mm"
    propose.chosen(bpy.context)
    scene.skin = "sheet:6x22x10mm"
    propose.chosen(bpy.context)
    assert wanted == ["hexagons:8mm", "sheet:6x22x10mm"]
