"""One MuJoCo model of a robot with all its skins: MuJoCo loads it, and feels each taxel that is pressed."""

import json
import shutil

import numpy as np
import pytest
import trimesh

from skin_calib_addon.calibration.robot_set import load_links
from skin_calib_addon.cli import main
from skin_calib_addon.common.file_hash import file_hash
from skin_calib_addon.geometry.mesh.triangle_mesh import save_mesh
from skin_calib_addon.robot import mjcf
from skin_calib_addon.robot.kinematics import link_poses
from skin_calib_addon.robot.urdf import read_robot
from tests.shapes import box, cylinder
from tests.unit.calibration.exchange.test_export_mujoco import DEPTH, RADIUS, with_body
from tests.unit.commands.test_cli import write_plan
from tests.unit.robot.test_robot_mesh import shape

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed (pip install mujoco): its model is not tried")


JOINT = (
    '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin xyz="{3}" rpy="0.3 -0.4 0.5"/>'
    '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
)
MM = "0.001 -0.001 0.001"


INERTIA = '<inertia ixx="0.3" iyy="0.3" izz="0.3" ixy="0" ixz="0" iyz="0"/>'
INERTIAL = f'<inertial><mass value="25"/>{INERTIA}</inertial>'


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """A robot whose arm is a mirrored tube, and whose hand is a DAE file, with a skin on each; fitted into ``out``."""
    pytest.importorskip("collada")
    tmp_path = tmp_path_factory.mktemp("robot")
    (tmp_path / "bot" / "meshes").mkdir(parents=True)
    (tmp_path / "out").mkdir()
    tube = cylinder(around=24, along=8)
    flipped = trimesh.Trimesh(tube.vertices * (1000, -1000, 1000), tube.faces[:, ::-1], process=False)
    flipped.export(tmp_path / "bot" / "meshes" / "tube.stl")
    trimesh.Trimesh(tube.vertices, tube.faces, process=False).export(tmp_path / "bot" / "meshes" / "hand.dae")
    save_mesh(box((0, 0, 0), (0.04, 0.03, 0.02)), tmp_path / "bot" / "meshes" / "base.ply")
    tube = "package://bot/meshes/tube.stl"
    arm = INERTIAL + shape(tube, scale=MM) + shape(tube, "collision", scale=MM)
    hand = INERTIAL + shape("meshes/hand.dae") + shape("meshes/hand.dae", "collision")
    base = shape("meshes/base.ply", origin='xyz="0.3 0 0"') + shape("meshes/base.ply", scale="2 2 2")
    links = "".join(f'<link name="{k}">{v}</link>' for k, v in (("base", base), ("arm", arm), ("hand", hand)))
    joints = JOINT.format("a", "base", "arm", "0.2 0 0.1") + JOINT.format("b", "arm", "hand", "0 0 0.3")
    wrong = '<mujoco><compiler meshdir="nowhere"/></mujoco><gazebo><sensor type="x"/></gazebo><transmission/>'
    (tmp_path / "bot" / "bot.urdf").write_text(f'<robot name="bot" xmlns="http://a.b">{wrong}{links}{joints}</robot>')
    for k, link in enumerate(("arm", "hand")):
        skins = [{"name": "s", "kind": "sheet", "rows": 2, "columns": 4, "pitch": [0.01, 0.01], "origin": "center"}]
        skins[0] |= {"direction": [0, 1, 0], "first_channel": 8 * k}
        write_plan(tmp_path / "bot", link, link=link, mesh="bot.urdf", skins=skins)
    assert main(["fit", str(tmp_path / "bot" / "bot.urdf"), "-o", str(tmp_path / "out")]) == 0
    return tmp_path


@pytest.fixture
def robot(fitted, tmp_path):
    """A copy of it, which the test may change."""
    return shutil.copytree(fitted, tmp_path, dirs_exist_ok=True)


def export(robot, capsys, *words):
    """Return exit code, the line on stdout and the lines on stderr."""
    capsys.readouterr()
    code = main(["export", str(robot / "out"), "--to", "mjcf", "-o", str(robot / "skin.xml"), *words])
    out, err = capsys.readouterr()
    return code, out, err.splitlines()


def edit(urdf, old, new):
    """Replace a part of the URDF, as if the links had been fitted with it."""
    urdf.write_text(urdf.read_text().replace(old, new))
    path = urdf.parent.parent / "out" / "robot.json"
    document = json.loads(path.read_text())
    document["urdf"]["sha256"] = file_hash(urdf)
    path.write_text(json.dumps(document))


def touched(path, folder, urdf, count):
    """Press random taxels; return those that alone feel their press, and all that were pressed."""
    # without gravity: a link that falls away from the sphere is not pressed
    model, data = with_body(mujoco.MjSpec.from_file(str(path)))
    poses, names = link_poses(read_robot(urdf)), []
    mujoco.mj_forward(model, data)
    for link, calibration in load_links(folder)[0].items():
        for patch in calibration.patches:
            names += [f"{link}/{name}" for name in patch.taxels.ids]
            expected = patch.taxels.positions_link @ poses[link][:3, :3].T + poses[link][:3, 3]
            found = [data.site(name).xpos for name in names[-len(expected) :]]
            np.testing.assert_allclose(found, expected, rtol=0, atol=2e-6)  # MuJoCo writes six digits
    places = [(data.site(name).xpos.copy(), data.site(name).xmat.reshape(3, 3)[:, 2].copy()) for name in names]
    rows = [model.sensor(name).adr[0] for name in names]
    chosen = np.random.default_rng(3).permutation(len(names))[:count]
    start = model.jnt_qposadr[model.body("finger").jntadr[0]]
    right = []
    for k in chosen.tolist():
        mujoco.mj_resetData(model, data)
        assert not (data.sensordata[rows] > 0).any()
        place, normal = places[k]
        data.qpos[start : start + 7] = [*(place + (RADIUS - DEPTH) * normal), 1, 0, 0, 0]
        mujoco.mj_forward(model, data)
        if np.flatnonzero(data.sensordata[rows] > 0).tolist() == [k]:
            right.append(names[k])
    return right, [names[k] for k in chosen.tolist()]


def steps(path):
    """Simulate for 0.2 s, and return whether all positions are finite."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    for _ in range(100):
        mujoco.mj_step(model, data)
    return np.isfinite(data.qpos).all()


def test_each_taxel_feels_its_press(robot, capsys):
    """Also where the collision shape of the link is flush with the skin; the model moves with its folder."""
    code, out, err = export(robot, capsys)
    assert (code, err) == (0, []) and "bot with 16 taxels on 2 links; 4 mesh files in skin_meshes" in out
    assert out.endswith("collision shapes that would hide skin are switched off: arm, hand\n")
    elsewhere = robot / "elsewhere"
    elsewhere.mkdir()
    for name in ("skin.xml", "skin_meshes"):
        (robot / name).rename(elsewhere / name)
    right, pressed = touched(elsewhere / "skin.xml", robot / "out", robot / "bot" / "bot.urdf", 16)
    assert right == pressed and len(pressed) == 16
    assert steps(elsewhere / "skin.xml")


def test_meshes_are_those_of_the_links(robot, capsys):
    """Scaled and mirrored; two scales of one file are two meshes."""
    export(robot, capsys)
    found = {path.name: trimesh.load(path) for path in (robot / "skin_meshes").iterdir()}
    assert set(found) == {"tube.stl", "hand.stl", "base.stl", "base_2.stl"}
    tube = cylinder(around=24, along=8)
    for name in ("tube.stl", "hand.stl"):
        np.testing.assert_allclose(
            found[name].bounds, [tube.vertices.min(axis=0), tube.vertices.max(axis=0)], atol=1e-6
        )
        np.testing.assert_allclose(found[name].area, tube.face_areas.sum(), rtol=1e-5)
    np.testing.assert_allclose(found["base_2.stl"].volume, 8 * found["base.stl"].volume, rtol=1e-5)


def test_large_mesh_is_an_obj_file(robot, capsys, monkeypatch):
    """MuJoCo refuses an STL file of more than 200000 faces."""
    monkeypatch.setattr(mjcf, "MAX_STL_FACES", 100)
    assert export(robot, capsys)[0] == 0
    assert sorted(path.name for path in (robot / "skin_meshes").iterdir()) == [
        *("base.stl", "base_2.stl", "hand.obj", "tube.obj")
    ]
    right, pressed = touched(robot / "skin.xml", robot / "out", robot / "bot" / "bot.urdf", 16)
    assert right == pressed


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_meshes_of_an_earlier_export_are_replaced(robot, capsys):
    """Also if the robot has other meshes now."""
    assert export(robot, capsys)[0] == 0
    before = contents(robot / "skin_meshes")
    save_mesh(box((0, 0, 0), (0.05, 0.03, 0.02)), robot / "bot" / "meshes" / "base.ply")
    assert export(robot, capsys)[0] == 0
    after = contents(robot / "skin_meshes")
    assert after.keys() == before.keys() and {path.stem for path in after if after[path] != before[path]} == {
        *("base", "base_2")
    }


def test_no_mesh_of_the_robot_is_replaced(robot, capsys):
    """Neither meshes that another program wrote, nor those of an earlier export that a URDF names."""
    bot = robot / "bot"
    (bot / "meshes").rename(robot / "skin_meshes")
    urdf = bot / "bot.urdf"
    edit(urdf, "package://bot/", "")
    edit(urdf, "meshes/", "../skin_meshes/")
    before = contents(robot)
    code, out, err = export(robot, capsys)
    assert code == 2 and out == "" and len(err) == 1 and contents(robot) == before
    assert f"{robot / 'skin_meshes' / 'tube.stl'} would replace " in err[0]


def test_files_of_others_in_the_folder_of_the_meshes_stay(robot, capsys):
    (robot / "skin_meshes").mkdir()
    (robot / "skin_meshes" / "hand.stl").write_text("solid mine")
    before = contents(robot)
    code, out, err = export(robot, capsys)
    assert code == 2 and out == "" and len(err) == 1 and contents(robot) == before
    assert "hand.stl exists, and is not of an earlier export. Choose another name for the model." in err[0]


@pytest.mark.parametrize("target", ["folder", "out/robot.json", "out/arm.calibration.json", "bot/bot.urdf"])
def test_nothing_is_written_if_the_model_cannot_be(robot, capsys, target):
    """The name is that of a folder, or of a file that the export reads."""
    (robot / "folder").mkdir()
    before = set(robot.rglob("*")), contents(robot)
    capsys.readouterr()
    assert main(["export", str(robot / "out"), "--to", "mjcf", "-o", str(robot / target)]) == 2
    assert (set(robot.rglob("*")), contents(robot)) == before and len(capsys.readouterr().err.splitlines()) == 1


def test_broken_link_is_one_line(robot, capsys):
    """A missing mesh and a changed calibration: the rest of the robot is exported; code 1."""
    (robot / "bot" / "meshes" / "base.ply").unlink()
    (robot / "out" / "hand.calibration.json").write_text("{")
    code, out, err = export(robot, capsys)
    assert code == 1 and "bot with 8 taxels on 1 link; 2 mesh files" in out
    assert (
        sum("base is without its visual mesh: the mesh file meshes/base.ply of bot.urdf" in line for line in err) == 2
    )
    assert sum("/links/1/calibration" in line for line in err) == 2 and len(err) == 4
    right, pressed = touched_arm(robot)
    assert right == pressed


def touched_arm(robot):
    document = json.loads((robot / "out" / "robot.json").read_text())
    document["links"] = document["links"][:1]
    (robot / "out" / "robot.json").write_text(json.dumps(document))
    return touched(robot / "skin.xml", robot / "out", robot / "bot" / "bot.urdf", 8)


@pytest.mark.parametrize(("millimetres", "hides"), [(-3.0, True), (0.9, True), (1.1, False)])
def test_shapes_up_to_a_millimetre_below_the_taxels_are_switched_off(millimetres, hides):
    """A box of the link, and one taxel above it, or inside it."""
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco><worldbody><body name="arm"><geom name="shape" type="box" size=".02 .02 .01" mass="1"/>
        <body name="skin"><geom type="box" size=".002 .002 .001" pos="0 0 {0.009 + 1e-3 * millimetres}" mass="0"/>
        <site pos="0 0 {0.01 + 1e-3 * millimetres}"/></body></body></worldbody></mujoco>"""
    )
    assert mjcf._uncover(spec, ["skin"], mujoco)[0] == (("arm",) if hides else ())
    assert (spec.geom("shape").contype == 0) == hides


@pytest.mark.parametrize("joint", ['<joint axis="0 0 1"/>', ""])
@pytest.mark.parametrize(("millimetres", "covers"), [(-3.0, True), (0.9, True), (1.1, False)])
def test_taxels_below_shapes_of_other_links_are_stated(millimetres, covers, joint):
    """A box of the base over a taxel of the arm stays, because it may be all that touches the world; not if fixed."""
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco><worldbody><body name="base"><geom name="shape" type="box" size=".02 .02 .01" mass="1"/>
        <body name="arm">{joint}<geom type="sphere" size=".001" pos="0 .1 0" mass="1"/>
        <body name="arm/skin"><geom type="box" size=".002 .002 .001" pos="0 0 {0.009 + 1e-3 * millimetres}" mass="0"/>
        <site pos="0 0 {0.01 + 1e-3 * millimetres}"/></body></body></body></worldbody></mujoco>"""
    )
    uncovered, covered, hidden = mjcf._uncover(spec, ["arm/skin"], mujoco)
    assert uncovered == (("base",) if covers and not joint else ())
    assert covered == ({("arm", "base"): 1} if covers and joint else {}) and len(hidden) == len(covered)


def test_shape_that_is_switched_off_covers_no_taxel():
    """A box of the base is over a taxel of the arm, and over one of its own skin, which comes later."""
    skin = '<geom type="box" size=".002 .002 .001" pos="{0} 0 .009" mass="0"/><site pos="{0} 0 .01"/></body>'
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco><worldbody><body name="base"><geom name="shape" type="box" size=".02 .02 .01" mass="1"/>
        <body name="arm"><joint axis="0 0 1"/><geom type="sphere" size=".001" pos="0 .1 0" mass="1"/>
        <body name="arm/skin">{skin.format(0.01)}</body><body name="base/skin">{skin.format(-0.01)}
        </body></worldbody></mujoco>"""
    )
    assert mjcf._uncover(spec, ["arm/skin", "base/skin"], mujoco) == (("base",), {}, {})
    assert spec.geom("shape").contype == 0


def test_mesh_in_millimetres_is_left_out(robot, capsys):
    """A link of 40 m would hide the robot; the command line refuses it for skin, too."""
    urdf = robot / "bot" / "bot.urdf"
    edit(urdf, 'scale="2 2 2"', 'scale="999 999 999"')
    code, _, err = export(robot, capsys)
    (line,) = err
    assert (
        code == 1 and "base is without its visual mesh: meshes/base.ply has a diameter of 5" in line and "scale" in line
    )


LID = f'<link name="lid">{INERTIAL}<collision><geometry><box size="0.2 0.2 0.02"/></geometry></collision></link>'


def test_shape_that_is_fixed_to_a_link_is_switched_off(robot, capsys):
    """A lid over the arm, as a link of its own: presses on the skin are felt."""
    urdf = robot / "bot" / "bot.urdf"
    joint = '<joint name="l" type="fixed"><parent link="arm"/><child link="lid"/><origin xyz="0 0 0.05"/></joint>'
    edit(urdf, "</robot>", f"{LID}{joint}</robot>")
    code, out, err = export(robot, capsys)
    assert (code, err) == (0, []) and out.endswith("would hide skin are switched off: arm, hand, lid\n")
    right, pressed = touched(robot / "skin.xml", robot / "out", urdf, 16)
    assert right == pressed


def test_skin_below_a_moving_lid_is_a_failure(robot, capsys):
    """All of its taxels are dead: the sum, and what to do."""
    joint = '<joint name="l" type="continuous"><parent link="arm"/><child link="lid"/><origin xyz="0 0 0.05"/></joint>'
    edit(robot / "bot" / "bot.urdf", "</robot>", f"{LID}{joint}</robot>")
    code, _, err = export(robot, capsys)
    words = "warning: 8 taxels of arm are below the collision shape of lid in the zero pose: no press is felt there"
    assert code == 1 and err[0] == f"skin-calib: {words}"
    assert "8 of 8 taxels of arm feel no press: they are below collision shapes of lid. Remove these" in err[1]


def test_free_base_and_actuators(robot, capsys):
    """The robot falls; each joint has a motor with its name and its effort."""
    assert export(robot, capsys, "--free-base", "--actuators")[::2] == (0, [])
    model = mujoco.MjModel.from_xml_path(str(robot / "skin.xml"))
    assert [model.actuator(k).name for k in range(model.nu)] == ["a", "b"] and model.nv == 8
    np.testing.assert_array_equal(model.actuator("a").ctrlrange, (-1, 1))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 50)
    assert data.qpos[2] < -0.01
    calibration = next((robot / "out").glob("*.calibration.json"))
    assert main(["export", str(calibration), "--to", "mjcf", "-o", str(robot / "x.xml"), "--free-base"]) != 0
    assert "are for a robot" in capsys.readouterr().err


FLOATING = '<joint name="f" type="floating"><parent link="{0}"/><child link="{1}"/><origin xyz="0 0 1"/></joint>'


@pytest.mark.parametrize("name", ["world", "it's"])
def test_floating_joint_below_an_empty_first_link_is_free(robot, capsys, name):
    """Whatever the name of this link; other joints below it stay."""
    urdf = robot / "bot" / "bot.urdf"
    more = f'<link name="{name}"/><link name="mast"/>' + FLOATING.format(name, "base")
    more += f'<joint name="m" type="fixed"><parent link="{name}"/><child link="mast"/></joint>'
    edit(urdf, "</robot>", f"{more}</robot>")
    assert export(robot, capsys)[::2] == (0, [])
    model = mujoco.MjModel.from_xml_path(str(robot / "skin.xml"))
    assert model.joint("f").type == mujoco.mjtJoint.mjJNT_FREE and model.body("mast").parentid == 0
    right, pressed = touched(robot / "skin.xml", robot / "out", urdf, 16)
    assert right == pressed


@pytest.mark.parametrize("case", ["first link with a shape", "between links", "another world"])
def test_floating_joint_that_mujoco_does_not_have_is_one_line(robot, capsys, case):
    """The line names the joint and what to do; nothing is written."""
    urdf = robot / "bot" / "bot.urdf"
    carrier = "base" if case == "first link with a shape" else "odom"
    more = '<link name="lamp"/>' + FLOATING.format(carrier, "lamp")
    if case != "first link with a shape":
        more += '<link name="odom"/>'
    if case == "between links":
        more += '<joint name="o" type="fixed"><parent link="hand"/><child link="odom"/></joint>'
    elif case == "another world":
        more += '<link name="world"/><joint name="o" type="fixed"><parent link="odom"/><child link="world"/></joint>'
    edit(urdf, "</robot>", f"{more}</robot>")
    code, out, err = export(robot, capsys)
    assert code == 1 and out == "" and len(err) == 1 and not (robot / "skin_meshes").exists()
    assert f"the joint f of bot.urdf is floating, and {carrier} carries it. MuJoCo accepts this only below" in err[0]


def test_robot_that_mujoco_refuses_is_one_line(robot, capsys):
    """Nothing is written."""
    urdf = robot / "bot" / "bot.urdf"
    edit(urdf, "</link>", "<collision><geometry><sphere radius='-1'/></geometry></collision></link>")
    code, out, err = export(robot, capsys)
    assert code == 1 and out == "" and len(err) == 1 and not (robot / "skin.xml").exists()
    assert "MuJoCo does not accept bot.urdf: " in err[0]


@pytest.mark.parametrize(("seed", "above"), [(0, 0.0), (1, 1e-10)])
def test_thin_parts_keep_their_inertia(robot, capsys, seed, above):
    """The inertia of a flat part is at the limit of what a rigid body can have, or above it by rounding."""
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    principal = np.array((1.068524e-5, 4.108974e-5, 5.177498e-5)) + (0, 0, above)
    of_hand(robot, turn @ np.diag(principal) @ turn.T)
    code, out, err = export(robot, capsys)
    model = mujoco.MjModel.from_xml_path(str(robot / "skin.xml"))
    assert code == 0 and err == [] and "inertia" not in out
    np.testing.assert_allclose(np.sort(model.body("hand").inertia), principal, rtol=1e-4)


@pytest.mark.parametrize(
    ("stated", "nearest", "said"),
    [
        ((1e-3, 1e-3, 5e-3), (2.5e-3, 2.5e-3, 5e-3), True),  # as a flat disc
        ((-3e-9, 1e-3, 1e-3), (0, 1e-3, 1e-3), True),  # a thin rod
        ((1e-3, 1e-3, 2.0001e-3), (1e-3, 1e-3, 2e-3), False),  # a flat part, by rounding
        ((-1e-3, 2e-3, 2e-3), (0, 2.5e-3, 2.5e-3), True),
    ],
)
def test_impossible_inertia_becomes_the_nearest_possible(robot, capsys, stated, nearest, said):
    """By its second moments, which are not negative; a line names the link, except for the rounding of a flat part."""
    of_hand(robot, np.diag(stated))
    code, out, err = export(robot, capsys)
    inertia = np.sort(mujoco.MjModel.from_xml_path(str(robot / "skin.xml")).body("hand").inertia)
    assert code == 0 and err == [] and inertia[2] <= inertia[:2].sum()
    np.testing.assert_allclose(inertia, nearest, rtol=1e-3, atol=1e-6)
    words = "no rigid body has the inertia that the URDF states; the model has the nearest possible: hand\n"
    assert out.endswith(words) == said


NO_MASS = "the URDF does not state the mass and inertia of moving links, or of links that are fixed to them; MuJoCo"


@pytest.mark.parametrize(
    ("inertial", "assumed"),
    [
        ("", "assumed hand (21.9 kg)."),
        (INERTIAL.replace("25", "0"), "assumed hand (1e-06 kg)."),
        (INERTIAL.replace("25", "0").replace("0.3", "0"), "assumed hand (1e-06 kg)."),
        (INERTIAL.replace("0.3", "0"), "assumed hand (25 kg)."),
        (INERTIAL, ""),
    ],
)
def test_assumed_mass_of_a_moving_link_is_stated(robot, capsys, inertial, assumed):
    """No mass, none that is positive, no inertia, and a mass of the shapes; but not a mass that the URDF states."""
    edit(robot / "bot" / "bot.urdf", f'<link name="hand">{INERTIAL}', f'<link name="hand">{inertial}')
    code, out, err = export(robot, capsys)
    assert code == 0 and err == [] and (NO_MASS in out) == bool(assumed) and assumed in out


def test_inertia_without_numbers_is_one_line(robot, capsys):
    """MuJoCo refuses it."""
    of_hand(robot, np.diag((1e-3, 1e-3, 1e-3)))
    urdf = robot / "bot" / "bot.urdf"
    edit(urdf, 'ixx="0.001"', 'ixx="much"')
    code, out, err = export(robot, capsys)
    assert code == 1 and out == "" and len(err) == 1 and "MuJoCo does not accept bot.urdf: " in err[0]


def of_hand(robot, inertia):
    """Write the inertia of the hand into the URDF."""
    urdf = robot / "bot" / "bot.urdf"
    numbers = zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), (*np.diag(inertia), *inertia[np.triu_indices(3, 1)]))
    words = " ".join(f'{name}="{value!r}"' for name, value in ((k, float(v)) for k, v in numbers))
    inertial = f'<inertial><mass value="0.04"/><inertia {words}/></inertial>'
    edit(urdf, f'<link name="hand">{INERTIAL}', f'<link name="hand">{inertial}')


@pytest.mark.parametrize("words", [("--to", "csv"), ("--patch", "s")])
def test_other_formats_are_of_one_link(robot, capsys, words):
    code, out, err = export(robot, capsys, *words)
    assert (
        code == 2
        and out == ""
        and err
        == ["skin-calib: A robot is exported as mjcf or newton, with all patches. For others, name a calibration."]
    )


def test_without_mujoco_the_message_states_how_to_install_it(robot, capsys, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    code, _, err = export(robot, capsys)
    assert code == 1 and "pip install 'skin-calib[robots]'" in err[0]


def test_without_urdf_there_is_no_model(robot, capsys):
    path = robot / "out" / "robot.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"urdf": None}))
    code, _, err = export(robot, capsys)
    assert code == 1 and err == [
        "skin-calib: robot.json names no URDF. Fit the plans with it: skin-calib fit ROBOT.urdf PLANS -o FOLDER"
    ]
