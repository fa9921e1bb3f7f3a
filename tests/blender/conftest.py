"""The extension as Blender loads it: from a folder of extensions, enabled in separate preferences."""

import copy
import importlib
import json
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from sample_scenes.shapes import tube_mesh
from skin_calib_addon import cli
from tests.shapes import box, welded
from tests.unit.robot.test_robot_mesh import MM, shape

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def extension(tmp_path_factory):
    """Return the name of the enabled extension's module; skip without Blender's module."""
    folder = tmp_path_factory.mktemp("blender")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BLENDER_USER_RESOURCES", str(folder / "resources"))
        reason = "Blender's module bpy does not load here; pip install '.[blender]' brings it"
        bpy = pytest.importorskip("bpy", reason=reason, exc_type=ImportError)
        import addon_utils

        (folder / "repository").mkdir()
        (folder / "repository" / "skin_calib").symlink_to(ROOT)
        repository = bpy.context.preferences.extensions.repos.new(
            name="skin_dev", module="skin_dev", custom_directory=str(folder / "repository")
        )
        name = f"bl_ext.{repository.module}.skin_calib"
        assert addon_utils.enable(name, default_set=True)
        yield name
        addon_utils.disable(name, default_set=True)


@pytest.fixture(autouse=True)
def few_samples(request, extension, monkeypatch):
    """Errors are measured at few points, in the extension and in plain Python.

    Not where a test compares with what another process, or a fixture of the module, has made of all points.
    """
    if {"run", "by_command"} & set(request.fixturenames):
        results = modules(extension, "scene.results").results
        results.clear()
        yield
        results.clear()
        return
    for package in (f"{extension}.skin_calib_addon", "skin_calib_addon"):
        report = importlib.import_module(f"{package}.geometry.fit.error_report")
        monkeypatch.setattr(report, "MESH_POINTS", 500)
        monkeypatch.setattr(report, "ROUNDS", 2)
        monkeypatch.setattr(importlib.import_module(f"{package}.geometry.surface.distance"), "MIN_SAMPLES", 500)
    yield


def modules(extension, *names):
    """Return modules of the running extension, each under the last part of its name below ``blender``."""
    found = {name: importlib.import_module(f"{extension}.skin_calib_addon.blender.{name}") for name in names}
    return SimpleNamespace(**{name.split(".")[-1]: module for name, module in found.items()})


@pytest.fixture
def bpy(extension):
    """Return Blender with the extension and an empty scene."""
    module = sys.modules["bpy"]
    module.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    return module


@pytest.fixture
def addon(extension, bpy):
    """Return the extension's modules, which differ from those that plain Python imports."""

    scene = (f"scene.{name}" for name in ("link_meshes", "plans", "points_on_link", "results", "robots"))
    found = modules(extension, "command", "live.diagnoses", "overlay.drawing", *scene)
    found.plan_document = importlib.import_module(f"{extension}.skin_calib_addon.plan").plan_document
    found.skins = importlib.import_module(f"{extension}.skin_calib_addon.plan.skins")
    return found


@pytest.fixture
def document(addon, bpy):
    """Gives the document that a link's plan would be written as."""

    def document(link):
        return addon.plan_document(addon.plans.read_plan(link, bpy.context.scene))

    return document


@pytest.fixture
def updates(extension):
    """Return the module of the running extension."""
    return modules(extension, "live.updates").updates


@pytest.fixture
def state_of(updates):
    """Gives what the window knows of a link."""
    return updates.session.of


@pytest.fixture
def preview(extension):
    """Return the module of the running extension."""
    return modules(extension, "live.preview").preview


@pytest.fixture
def plan_file(tmp_path):
    """Return a function that writes a small tube and a plan for it, with changes; it returns the plan's path."""

    def write(name="arm", numbers_in="m", **changes):
        factor = {"m": 1, "mm": 1000}[numbers_in]
        written(tube_mesh(oval, 24, 9), tmp_path / f"{name}.stl", factor)
        document = copy.deepcopy(PLAN) | {"link": name, "mesh": f"{name}.stl", "unit": numbers_in} | changes
        path = tmp_path / f"{name}.plan.json"
        path.write_text(json.dumps(document))
        return path

    return write


@pytest.fixture
def link(bpy, plan_file):
    """Return a small link in the scene, ready to fit."""
    bpy.ops.skin_calib.import_plan(filepath=str(plan_file()))
    return bpy.context.object


@pytest.fixture
def fit_plainly(tmp_path):
    """Return a function that gives the bytes of the command line's result without Blender."""

    def fit(path):
        out = tmp_path / "plain.json"
        assert cli.main(["fit", str(path), "-o", str(out)]) == 0
        return out.read_bytes()

    return fit


@pytest.fixture
def fit_scene(addon, tmp_path):
    """Return a function that gives the bytes of the same command for the open scene."""

    def fit():
        out = tmp_path / "scene.json"
        assert addon.command.main(["fit", "-o", str(out)]) == 0
        return out.read_bytes()

    return fit


@pytest.fixture
def urdf(tmp_path):
    """Write a robot in a package: a link of two visual meshes, others of one, of boxes, and broken."""
    (tmp_path / "bot" / "urdf").mkdir(parents=True)
    (tmp_path / "bot" / "meshes").mkdir()
    written(TUBE, tmp_path / "bot" / "meshes" / "tube.STL", 1000)
    written(INNER, tmp_path / "bot" / "meshes" / "box.obj")
    written(TUBE, tmp_path / "bot" / "meshes" / "tube.ply")
    upper = shape("package://bot/meshes/tube.STL", origin='xyz="0.1 0 0.2" rpy="0.3 -0.2 1"', scale=MIRROR)
    upper += shape("../meshes/box.obj") + shape("package://bot/meshes/tube.STL", "collision", scale=MM)
    links = {
        "upper": upper,
        "elbow": "<visual><geometry><box size='1 1 1'/></geometry></visual>",
        "lower": shape("package://bot/meshes/tube.STL", scale=MIRROR),
        "hand": shape("package://bot/meshes/tube.ply"),
        "finger": shape("package://bot/meshes/none.stl"),
    }
    joints = (
        ("upper", "elbow", "0 0 0.3", "0.1 0.2 0.3"),
        ("elbow", "lower", "0.02 0 0.1", "0 -0.7 0"),
        ("lower", "hand", "0 0 0.25", "1.5 0 0"),
        ("hand", "finger", "0 0 0.1", "0 0 0"),
    )
    path = tmp_path / "bot" / "urdf" / "bot.urdf"
    path.write_text(robot_text(links, joints))
    return path


def robot_text(links, joints):
    """Return a URDF of links by name, and of joints (parent, child, xyz, rpy)."""
    inner = "".join(f'<link name="{name}">{shapes}</link>' for name, shapes in links.items())
    for parent, child, xyz, rpy in joints:
        inner += f'<joint name="{child}_joint" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        inner += f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="0 1 0"/>'
        inner += '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
    return f'<robot name="bot">{inner}</robot>'


def written(mesh, path, scale=1.0):
    """Write a mesh to a file of any format, and return its path."""
    trimesh.Trimesh(mesh.vertices * scale, mesh.faces, process=False).export(path)
    return path


def look(updates):
    """Run the timer until all changes are drawn."""
    while updates.tick() == updates.POLL_INTERVAL:
        pass


PLAN = {
    "format": "skin-plan",
    "version": 1,
    "grid": {"kind": "tube", "n": 5, "lines": 12, "axis": "auto", "margin": 0.004, "spacing": "uniform"},
    "skins": [
        {
            "name": "band",
            "kind": "sheet",
            "rows": 2,
            "columns": 3,
            "pitch": [0.0085, 0.01],
            "origin": "center",
            "direction": [0.0, 1.0, 0.0],
        }
    ],
}

LANDMARKS = [{"cell": [0, 0], "point": [0.035, 0.02, 0.05]}, {"cell": [1, 2], "point": [0.025, 0.033, 0.06]}]
BAND = PLAN["skins"][0]
PINNED = {name: value for name, value in BAND.items() if name != "origin"} | {"landmarks": LANDMARKS}
LEFT = BAND | {"rows": 12, "hand": "left", "offset": 0.0005, "trim": True}
BOARDS = {"name": "boards", "kind": "hexagons", "side": 0.016, "gap": 0.001}
CLEAR = [{"point": [0.04, 0.01, 0.06], "radius": 0.01}, {"point": [-0.03, 0.01, 0.04], "radius": 0.0045}]
LISTED = {
    "cells": [[0, 0], [1, 0], [0, -1, 0.0004, -0.0015, 0.02]],
    "origin": [0.04, 0.01, 0.06],
    "direction": [0, 1, 0.25],
    "offset": 0.001,
}


def oval(angle, height):
    """Return a curved, tapered oval tube of 80 mm without mirror symmetry."""
    a, b = 0.04 - 0.005 * height, 0.03 + 0.002 * np.sin(angle + 0.4)
    return np.column_stack((a * np.cos(angle) + 0.004 * height**2, b * np.sin(angle) + 0.01, 0.02 + 0.08 * height))


MIRROR = "0.001 -0.001 0.001"  # of numbers in millimetres
TUBE = welded(tube_mesh(oval, 24, 9))
INNER = box((-0.01, 0, 0.04), (0.01, 0.02, 0.08))
