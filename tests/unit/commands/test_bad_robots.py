"""Whole robots with bad input: one line for each problem, exit code 1, and the rest is done."""

import json
import shutil
import signal
from functools import partial
from xml.sax.saxutils import quoteattr

import numpy as np
import pytest

from skin_calib_addon.cli import main
from skin_calib_addon.geometry.mesh.triangle_mesh import TriangleMesh, save_mesh
from skin_calib_addon.pictures import robot as robot_picture
from skin_calib_addon.proposal import links as proposal_links
from skin_calib_addon.robot.urdf import read_robot
from tests.examples import slow
from tests.shapes import cylinder
from tests.unit.commands.test_cli import write_plan

LINKS = ("arm", "hand", "foot")
LINK = '<link name="{0}"><visual><geometry><mesh filename="{0}.ply"/></geometry></visual></link>'
JOINT = '<joint name="{0}" type="{3}"><parent link="{1}"/><child link="{2}"/>{4}</joint>'
JOINTS = (("a", "base", "arm"), ("h", "arm", "hand"), ("f", "base", "foot"))


def write_urdf(folder, more="", joint=""):
    links = "".join(LINK.format(link) for link in LINKS)
    joints = "".join(JOINT.format(*words, "revolute", joint if words[0] == "h" else "") for words in JOINTS)
    (folder / "bot.urdf").write_text(f'<robot name="bot">\n<link name="base"/>{links}\n{joints}\n{more}\n</robot>')


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """A robot of three links with plans that take their meshes from it, fitted into ``out``."""
    folder = tmp_path_factory.mktemp("robot")
    (folder / "out").mkdir()
    write_urdf(folder)
    for name in LINKS:
        save_mesh(cylinder(around=24, along=8), folder / f"{name}.ply")
        write_plan(folder, name, link=name, mesh="bot.urdf")
    assert run(folder, "fit") == 0
    return folder


@pytest.fixture
def robot(fitted, tmp_path, monkeypatch):
    """A copy of it, with small pictures."""
    monkeypatch.setattr(robot_picture, "PICTURE_HEIGHT", 200)
    shutil.copytree(fitted, tmp_path / "robot")
    return tmp_path / "robot"


def run(robot, command):
    """Run a command on the whole robot, and return its exit code."""
    words = {
        "fit": ("bot.urdf", "-o", "out"),
        "show": ("out", "--picture", "robot.png"),
        "export": ("out", "--to", "mjcf", "-o", "robot.xml"),
        "check": ("out",),
    }[command]
    named = [word if word.startswith("--") or word in ("-o", "mjcf") else str(robot / word) for word in words]
    return main([command, *named])


BAD = {
    "limit": ({"joint": '<limit lower="low" upper="1"/>'}, 'line 3 has "low" instead of a number (limit lower)'),
    "reversed limit": (
        {"joint": '<limit lower="1" upper="-1"/>'},
        "line 3 has the lower limit 1 above the upper one, -1; swap them",
    ),
    "nan": ({"joint": '<origin xyz="nan 0 0"/>'}, 'line 3 has "nan" instead of a finite number (origin xyz)'),
    "far": ({"joint": '<origin xyz="0 -1e200 0"/>'}, "line 3 has -1e+200, which is too large (origin xyz)"),
}


@pytest.mark.parametrize("command", ["fit", "show", "export", "check"])
def test_robot_that_cannot_be_read_is_one_line(robot, capsys, command):
    """With the line of the file; no output is written. ``check`` examines the calibrations as always."""
    if command == "export":
        pytest.importorskip("mujoco")
    changes, words = BAD["reversed limit"]
    write_urdf(robot, **changes)
    capsys.readouterr()
    assert run(robot, command) == 1
    out, err = capsys.readouterr()
    found = [line for line in err.splitlines() if "[duplicate-" not in line]
    if command == "check":
        found = [line for line in out.splitlines() if line.startswith("error")]
        assert out.count("arm.calibration.json: 0 errors") == 1
    assert len(found) == 1 and words in found[0]
    assert not (robot / "robot.png").exists() and not (robot / "robot.xml").exists()


@pytest.mark.parametrize("damage", ["damaged", slow("missing"), slow("too large")])
def test_one_broken_link_stops_no_other(robot, capsys, damage):
    """``fit``, ``show`` and ``export`` do the other links."""
    mesh = robot / "hand.ply"
    if damage == "missing":
        mesh.unlink()
    elif damage == "damaged":
        mesh.write_bytes(mesh.read_bytes()[:500])
    else:
        urdf = robot / "bot.urdf"
        urdf.write_text(urdf.read_text().replace('"hand.ply"', '"hand.ply" scale="1000 1000 1000"'))
    for command in ("fit", "show", "export"):
        if command == "export":
            pytest.importorskip("mujoco")
        capsys.readouterr()
        code = run(robot, command)
        out, err = capsys.readouterr()
        lines = [line for line in err.splitlines() if "[duplicate-" not in line]
        assert code == 1 and len(lines) == 1 and "hand" in lines[0]
        if command == "fit":
            assert "3 links: 2 up to date, 1 failed" in out or "3 links: 2 fitted, 1 failed" in out
    assert (robot / "robot.png").exists() and (robot / "robot.xml").exists()


PLATE = [(0, 0, 0), (0.07, 0, 0), (0.07, 0.07, 0), (0, 0.07, 0)]


def plates(folder, names, visual='<visual><geometry><mesh filename="{0}.ply"/></geometry></visual>', **others):
    """Write a URDF of plates that are fixed above each other; ``others`` has other visuals by the number of a link."""
    links = [
        f"<link name={quoteattr(name)}>{others.get(f'link{k}', visual.format(k))}</link>"
        for k, name in enumerate(names)
    ]
    joints = [
        f'<joint name="j{k}" type="fixed"><parent link={quoteattr(a)}/><child link={quoteattr(b)}/>'
        '<origin xyz="0 0 0.3"/></joint>'
        for k, (a, b) in enumerate(zip(names, names[1:]))
    ]
    for k in range(len(names)):
        save_mesh(TriangleMesh(np.array(PLATE), np.array([(0, 1, 2), (0, 2, 3)])), folder / f"{k}.ply")
    (folder / "bot.urdf").write_text(f'<robot name="bot">{"".join(links + joints)}</robot>', encoding="utf8")
    return folder / "bot.urdf"


def propose(urdf, *words):
    return main(["propose", str(urdf), "-o", str(urdf.parent / "plans"), "--skin", "sheet:3x3x10mm", *words])


def meshes(file, more=""):
    return f'<visual><geometry><mesh filename="{file}" {more}/></geometry></visual>'


FACET = "solid\nfacet normal 0 0 1\nouter loop\n"
BROKEN_LINKS = {
    "missing": (meshes("nofile.ply"), "the mesh file nofile.ply of bot.urdf was not found"),
    "damaged": (meshes("damaged.dae"), "damaged.dae is not a valid DAE file"),
    "origin nowhere": (meshes("1.ply").replace("<geom", '<origin xyz="0 0 1e9"/><geom'), "1.ply has 1e+09 in its xyz"),
    "empty": (meshes("empty.off"), "empty.off is empty. Check that it was written completely."),
    "outside": (meshes("../../../../../../../../etc/passwd"), "passwd"),
}


@pytest.mark.parametrize("case", [case if case == "missing" else slow(case) for case in BROKEN_LINKS])
def test_plans_of_the_other_links_are_proposed(tmp_path, capsys, case):
    """A line about the broken link, before the others if its file is missing; a plan for each other, and code 1."""
    visual, words = BROKEN_LINKS[case]
    (tmp_path / "damaged.dae").write_text("<COLLADA>")
    (tmp_path / "empty.off").touch()
    urdf = plates(tmp_path, ("base", "middle", "end"), link1=visual)
    assert propose(urdf) == 1
    out, err = capsys.readouterr()
    *first, last = err.splitlines()
    assert last.startswith("skin-calib: middle: ") and words in last
    lost = (
        "skin-calib: warning: 1 link of bot.urdf has mesh files that were not found: middle. Such a link gets no plan"
    )
    assert len(first) == ("was not found" in last) and all(line.startswith(lost) for line in first)
    assert "middle  failed" in out and "3 links, 2 plans" in out
    assert sorted(path.name for path in (tmp_path / "plans").iterdir()) == ["base.plan.json", "end.plan.json"]


@pytest.mark.slow
def test_robot_is_that_of_all_plans_or_of_an_earlier_fit(tmp_path, capsys):
    """A plan with another mesh leaves the robot open, and fit states why; a URDF that was named stays."""
    urdf, out = plates(tmp_path, ("base", "middle", "end")), tmp_path / "out"

    def robot():
        assert main(["fit", str(tmp_path / "plans"), "-o", str(out)]) == 0
        return json.loads((out / "robot.json").read_text())["urdf"]

    assert propose(urdf) == 0
    path = tmp_path / "plans" / "end.plan.json"
    text = path.read_text()
    path.write_text(json.dumps(json.loads(text) | {"mesh": "../2.ply"}))
    capsys.readouterr()
    assert robot() is None
    words = "skin-calib: warning: robot.json names no URDF: only some links are from ../bot.urdf. Fit the plans"
    assert words in capsys.readouterr().err
    (tmp_path / "second.urdf").write_text(urdf.read_text())
    path.write_text(json.dumps(json.loads(text) | {"mesh": "../second.urdf"}))
    assert robot() is None
    words = "robot.json names no URDF: its links are from ../bot.urdf, ../second.urdf. Fit the plans of each robot"
    assert words in capsys.readouterr().err
    path.write_text(text)
    assert robot()["file"] == "../bot.urdf" and not capsys.readouterr().err
    (tmp_path / "whole.urdf").write_text(urdf.read_text())
    assert main(["fit", str(tmp_path / "whole.urdf"), str(tmp_path / "plans"), "-o", str(out)]) == 0
    assert robot()["file"] == "../whole.urdf"
    urdf.write_text(urdf.read_text().replace('name="bot"', 'name="other"'))
    assert robot()["file"] == "../whole.urdf"


PREFIXED = f'<link name="${{prefix}}a">{meshes("0.ply")}</link>'
SCALED = meshes("0.ply", 'scale="${s}"')
XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'


@pytest.mark.parametrize("case", [*BAD, "empty", "xacro in a link", "xacro of a scale", "collisions only"])
def test_robot_without_links_to_propose_is_one_line(tmp_path, capsys, case):
    """No folder is made."""
    texts = {
        "empty": ("", "is empty. Check that it was written completely."),
        "xacro in a link": (
            f'<robot name="x" {XACRO}>{PREFIXED.replace("</link>", "<xacro:m/></link>")}</robot>',
            'line 1 has the element "xacro:m", which is not of a URDF [xacro]. It is a xacro file. Convert it first:',
        ),
        "xacro of a scale": (
            f'<robot name="x" {XACRO}><xacro:m/><link name="a">{SCALED}</link></robot>',
            "It is a xacro file. Convert it first: xacro bot.urdf > robot.urdf",
        ),
        "collisions only": (
            f'<robot name="x"><link name="a">{meshes("0.ply").replace("visual", "collision")}</link></robot>',
            "has no link with a visual mesh. Shapes for collisions, boxes and cylinders carry no skin.",
        ),
    }
    if case in BAD:
        changes, words = BAD[case]
        write_urdf(tmp_path, **changes)
    else:
        text, words = texts[case]
        (tmp_path / "bot.urdf").write_text(text)
    for more in ((), ("--propose",)):
        assert main(["fit" if more else "propose", str(tmp_path / "bot.urdf"), "-o", str(tmp_path / "out"), *more]) == 1
        err = capsys.readouterr().err
        assert len(err.splitlines()) == 1 and words in err and not (tmp_path / "out").exists()


def test_comments_of_a_converted_xacro_file_are_read(tmp_path):
    """The program xacro keeps comments, also those about its elements."""
    urdf = plates(tmp_path, ("base", "end"))
    urdf.write_text(urdf.read_text().replace("<link", "<!-- <xacro:include filename='a'/> --><link", 1))
    assert list(read_robot(urdf).links) == ["base", "end"]


@pytest.mark.parametrize("name", [".", "robot.urdf"])
def test_folder_is_no_robot(tmp_path, capsys, monkeypatch, name):
    """One line names it, and no folder is made."""
    (tmp_path / name).mkdir(exist_ok=True)
    monkeypatch.chdir(tmp_path)
    assert main(["propose", name, "-o", "plans"]) == 1
    assert capsys.readouterr().err == f"skin-calib: '{name}' is a folder. Name a URDF or a mesh.\n"
    assert not (tmp_path / "plans").exists()


NAMES = ("a/b", "a_b", "a b", "../up", "腕", "base\u202e", "long" * 80)


@pytest.mark.slow
def test_links_of_any_name_have_plans_of_their_own(tmp_path, capsys):
    """Also names that differ only in characters that files cannot have; nothing is written outside of the folder."""
    (tmp_path / "in").mkdir()
    assert propose(plates(tmp_path / "in", NAMES)) == 0
    assert "7 links, 7 plans" in capsys.readouterr().out
    found = {path.name: json.loads(path.read_text())["link"] for path in (tmp_path / "in" / "plans").iterdir()}
    assert sorted(found.values()) == sorted(NAMES) and {"a_b.plan.json", "腕.plan.json"} <= found.keys()
    assert [path.name for path in tmp_path.iterdir()] == ["in"]


@pytest.mark.parametrize("command", ["propose", "show"])
def test_ctrl_c_is_one_line(robot, capsys, monkeypatch, command):
    """Nothing is half written, and the exit code is that of shells."""

    def interrupt(*_):
        raise KeyboardInterrupt

    capsys.readouterr()
    monkeypatch.setattr(proposal_links, "propose_link", interrupt)
    monkeypatch.setattr(robot_picture, "_image", interrupt)
    before = set(robot.rglob("*"))
    assert (propose(robot / "bot.urdf") if command == "propose" else run(robot, "show")) == 130
    err = capsys.readouterr().err.splitlines()
    assert err[-1] == "skin-calib: interrupted. Files that were not finished are not written."
    assert {path for path in robot.rglob("*") if path.is_file()} <= before


@pytest.mark.parametrize("name", [slow(""), "two&#10;lines"])
def test_a_link_without_a_usable_name_fails_alone(tmp_path, capsys, name):
    """One line from each command that needs the link, and the others are done."""
    urdf, out = plates(tmp_path, ("base", "middle", "end")), tmp_path / "out"
    urdf.write_text(urdf.read_text().replace('"middle"', f'"{name}"'))
    for call in (
        ("fit", urdf, "--propose", "-o", out, "--skin", "sheet:3x3x10mm"),
        ("show", out, "--picture", tmp_path / "robot.png"),
    ):
        assert main([*map(str, call)]) == 1
        lines = [line for line in capsys.readouterr().err.splitlines() if "[duplicate-" not in line]
        assert len(lines) == 1 and "Give it one of printable characters." in lines[0]
    assert main(["check", str(out)]) == 0
    links = [link["link"] for link in json.loads((out / "robot.json").read_text())["links"]]
    assert links == ["base", "end"]


def test_a_mesh_that_mujoco_refuses_is_left_out_of_the_model(tmp_path, capsys):
    """A visual mesh of three vertices: one line, and the robot is exported with all skins."""
    mujoco = pytest.importorskip("mujoco")
    (tmp_path / "three.stl").write_text(
        f"{FACET}vertex 0 0 0\nvertex 0.07 0 0\nvertex 0 0.07 0\nendloop\nendfacet\nendsolid\n"
    )
    urdf, out = plates(tmp_path, ("base", "middle", "end"), link1=meshes("three.stl")), tmp_path / "out"
    assert main(["fit", str(urdf), "--propose", "-o", str(out), "--skin", "sheet:2x2x8mm"]) == 0
    capsys.readouterr()
    assert main(["export", str(out), "--to", "mjcf", "-o", str(tmp_path / "robot.xml")]) == 1
    err = capsys.readouterr().err
    assert len(err.splitlines()) == 1 and "middle is without its visual mesh: MuJoCo does not accept three.stl" in err
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    assert {model.body(k).name for k in range(model.nbody)} >= {"base", "middle", "end"} and model.nsensor >= 8
    assert sorted(path.name for path in (tmp_path / "robot_meshes").iterdir()) == ["0.stl", "2.stl"]


JOINTS_OF_ALL_TYPES = {
    "continuous": "<axis xyz='1 0 0'/>",
    "revolute": "<axis xyz='0 0 1'/><limit lower='-1e16' upper='1e16'/>",
    "prismatic": "<axis xyz='0 1 0'/><limit lower='-1e16' upper='1e16'/>",
    "floating": "",
    "planar": "<axis xyz='0 0 1'/>",
    "mimic": "<axis xyz='0 0 1'/><limit lower='-1' upper='1'/><mimic joint='j1' multiplier='1e300' offset='1e300'/>",
}


@pytest.mark.parametrize("kind", [kind if kind == "mimic" else slow(kind) for kind in JOINTS_OF_ALL_TYPES])
def test_joints_of_all_types_and_ranges_are_proposed(tmp_path, capsys, kind):
    """Each link gets a line, whatever the joint is, and nothing goes on for ever."""
    urdf = plates(tmp_path, ("base", "middle", "end", "last"))
    kinds, more = kind.replace("mimic", "revolute"), JOINTS_OF_ALL_TYPES[kind]
    first, second = 'name="j0" type="fixed"', 'name="j1" type="fixed"'
    text = urdf.read_text().replace(first, f'name="j0" type="{kinds}"')
    text = text.replace(second, 'name="j1" type="continuous"').replace("</joint>", f"{more}</joint>", 1)
    urdf.write_text(text)
    assert propose(urdf) == 0
    out, err = capsys.readouterr()
    assert "4 links, " in out and not err


def ctrl_c():
    raise KeyboardInterrupt


@pytest.mark.slow
@pytest.mark.parametrize("interrupt", [ctrl_c, partial(signal.raise_signal, signal.SIGTERM)], ids=["ctrl_c", "sigterm"])
def test_proposals_continue_after_an_interruption(tmp_path, capsys, monkeypatch, interrupt):
    """Plans of finished links are written; the same call does the others, with the same bytes as without it."""
    handler = signal.getsignal(signal.SIGTERM)
    (tmp_path / "whole").mkdir()
    whole, stopped = plates(tmp_path / "whole", "abc"), plates(tmp_path, "abc")
    assert propose(whole) == 0
    original = proposal_links.propose_link

    def interrupted(link, *rest, **more):
        if link == "c":
            interrupt()
        return original(link, *rest, **more)

    with monkeypatch.context() as patch:
        patch.setattr(proposal_links, "propose_link", interrupted)
        assert propose(stopped) == 130
    assert signal.getsignal(signal.SIGTERM) == handler
    assert sorted(path.name for path in (tmp_path / "plans").iterdir()) == ["a.plan.json", "b.plan.json"]
    capsys.readouterr()
    assert propose(stopped) == 0 and capsys.readouterr().out.count("kept: ") == 2
    for name in "abc":
        plan = f"plans/{name}.plan.json"
        assert (tmp_path / plan).read_bytes() == (tmp_path / "whole" / plan).read_bytes()
