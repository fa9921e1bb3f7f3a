"""MuJoCo measures contacts at the right taxels: the exported model is loaded and touched on each taxel."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from skin_calib_addon.calibration.exchange import FORMATS
from skin_calib_addon.calibration.exchange.link_taxels import taxels_of
from skin_calib_addon.common.errors import CalibrationFormatError
from skin_calib_addon.pipeline import calibrate
from skin_calib_addon.plan import load_plan
from tests.samples import boards, seven_boards, sheet, small_calibration

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed (pip install mujoco): its model is not tried")

ROOT = Path(__file__).resolve().parents[4]
RADIUS, DEPTH = 0.004, 0.0003  # of the sphere that presses [m]


def curved_and_flat():
    """Return a sheet around a cylinder and boards on a plane, with names that XML escapes."""
    calibration = small_calibration(patches=(sheet(4, 6, 0.01), seven_boards(24)), link='fore"arm & <hand>')
    return calibration, taxels_of(calibration)


def spec_of(calibration):
    """Return the specification of the exported model."""
    return mujoco.MjSpec.from_string(FORMATS["mjcf"].write(calibration).decode())


def with_body(spec, name="finger", kind=mujoco.mjtGeom.mjGEOM_SPHERE, size=(RADIUS, 0, 0), mass=0.1):
    """Return a model with a free body, the sphere by default, without gravity, and its data."""
    body = spec.worldbody.add_body(name=name)
    body.add_freejoint()
    body.add_geom(type=kind, size=size, mass=mass)
    spec.option.gravity = [0, 0, 0]
    model = spec.compile()
    return model, mujoco.MjData(model)


def plate_on(calibration, rows):
    """Yield a model and its data with a plate that presses on some taxels, one after the other."""
    model, data = with_body(spec_of(calibration), "plate", mujoco.mjtGeom.mjGEOM_BOX, [0.3, 0.3, 0.01], 1)
    taxels, turn = taxels_of(calibration), np.zeros(4)
    for row in rows:
        mujoco.mju_quatZ2Vec(turn, taxels.normals[row])
        data.qpos[:] = [*(taxels.positions[row] + (0.01 - DEPTH) * taxels.normals[row]), *turn]
        yield model, data


def press(model, data, place, normal, velocity=(0, 0, 0)):
    """Move the sphere into the skin at a point, and compute."""
    data.qpos[:] = [*(place + (RADIUS - DEPTH) * normal), 1, 0, 0, 0]
    data.qvel[:] = [*velocity, 0, 0, 0]
    mujoco.mj_forward(model, data)


def test_sites_stand_where_the_taxels_are():
    """Return position and frame (z axis along the normal) of each taxel by name."""
    calibration, taxels = curved_and_flat()
    model = mujoco.MjModel.from_xml_string(FORMATS["mjcf"].write(calibration).decode())
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert (model.nsite, model.body(1).name) == (31, calibration.link)
    for i, name in enumerate(taxels.ids):
        np.testing.assert_allclose(data.site(name).xpos, taxels.positions[i], rtol=0, atol=1e-12)
        np.testing.assert_allclose(data.site(name).xmat.reshape(3, 3), taxels.axes[i], rtol=0, atol=1e-12)


def test_touch_and_tactile_sensors_feel_the_pressed_taxel():
    """A small sphere near the centre of each taxel: only this taxel has a contact, with the right depth."""
    calibration, taxels = curved_and_flat()
    model, data = with_body(spec_of(calibration))
    for i, name in enumerate(taxels.ids):
        press(model, data, taxels.positions[i] + 0.0005 * taxels.tangents[i], taxels.normals[i])
        touched = [other for other in taxels.ids if data.sensor(other).data[0] > 0]
        assert touched == [name]
        patch, row = ("sheet", i) if i < 24 else ("flower", i - 24)
        depth = data.sensor(patch).data.reshape(3, -1)[0]
        assert np.flatnonzero(depth).tolist() == [row] and 0.8 * DEPTH < depth[row] <= DEPTH
        assert not data.sensor("flower" if patch == "sheet" else "sheet").data.any()


def test_contact_names_its_taxel():
    """The geom of a cell has the id; the model for Newton has the same cells and no mesh."""
    calibration, taxels = curved_and_flat()
    model, data = with_body(spec_of(calibration))
    press(model, data, taxels.positions[9], taxels.normals[9])
    assert taxels.ids[9] in {model.geom(i).name for i in data.contact[0].geom}
    text = FORMATS["newton"].write(calibration).decode()
    other = mujoco.MjModel.from_xml_string(text)
    assert (other.nmesh, other.nsensor, other.ngeom) == (0, 31, 31) and "tactile" not in text
    for name in taxels.ids:
        assert np.array_equal(other.geom(name).pos, model.geom(name).pos)
        assert np.array_equal(other.geom(name).size, model.geom(name).size)


def sole():
    """Return the calibration of the sole of the samples, whose cells have common edges."""
    return calibrate(load_plan(ROOT / "sample_scenes" / "sole.plan.json")).calibration


@pytest.mark.parametrize("made", [sole, lambda: small_calibration(patches=(seven_boards(),))], ids=["sole", "boards"])
def test_touch_sensors_add_up_to_the_contact_forces(made):
    """A plate presses on one taxel after another. Its contacts at the rims of cells count once each."""
    calibration = made()
    taxels = taxels_of(calibration)
    for model, data in plate_on(calibration, range(len(taxels.ids))):
        mujoco.mj_forward(model, data)
        forces = [np.zeros(6) for _ in range(data.ncon)]
        for k, force in enumerate(forces):
            mujoco.mj_contactForce(model, data, k, force)
        felt = sum(data.sensor(name).data[0] for name in taxels.ids)
        assert felt == pytest.approx(sum(force[0] for force in forces), rel=1e-6) and felt > 0


def test_sphere_that_hovers_is_not_felt():
    """0.1 mm above each taxel there is no contact: the cells end at the taxels."""
    calibration, taxels = curved_and_flat()
    model, data = with_body(spec_of(calibration))
    for i in range(len(taxels.ids)):
        press(model, data, taxels.positions[i] + (DEPTH + 1e-4) * taxels.normals[i], taxels.normals[i])
        assert not data.sensordata.any()


@pytest.mark.parametrize("axis", [0, 1])
def test_slip_runs_along_the_tangent_and_across(axis):
    """A sphere that moves along an axis of the taxel frame gives slip only in that channel."""
    calibration, taxels = curved_and_flat()
    model, data = with_body(spec_of(calibration))
    for i in (8, 9, 24):
        press(model, data, taxels.positions[i], taxels.normals[i], 0.1 * taxels.axes[i, :, axis])
        slips = data.sensor("sheet" if i < 24 else "flower").data.reshape(3, -1)[1:, i if i < 24 else 0]
        assert abs(slips[axis]) > 1e-6 and abs(slips[1 - axis]) < 1e-3 * abs(slips[axis])


def test_press_between_four_cells_is_felt_by_them():
    """Sites have no gaps: a larger sphere on a corner touches only cells around it."""
    calibration, taxels = curved_and_flat()
    model, data = with_body(spec_of(calibration))
    corner = calibration.patches[0].taxels.corners_link[7, 2]
    press(model, data, corner, taxels.normals[7])
    touched = {other for other in taxels.ids if data.sensor(other).data[0] > 0}
    assert touched and touched <= {"s1.1", "s1.2", "s2.1", "s2.2"}


def moved(patch, name, turn, shift):
    """Return a patch with other ids, turned (3, 3) and then moved (3,)."""
    taxels, new = patch.taxels, {old: f"{name}{old}" for old in patch.taxels.ids}
    turned = {
        member: getattr(taxels, member) @ turn.T
        for member in ("positions_link", "corners_link", "normals_link", "tangents_link")
    }
    turned |= {member: turned[member] + shift for member in ("positions_link", "corners_link")}
    channels, neighbours = taxels.channels + 100, tuple(tuple(map(new.get, row)) for row in taxels.neighbours)
    ids = tuple(new.values())
    taxels = replace(taxels, **turned, ids=ids, channels=channels, neighbours=neighbours, ports=())
    return replace(patch, name=name, taxels=taxels)


@pytest.mark.parametrize("turn", [np.diag((1.0, -1, -1)), np.eye(3)])
def test_a_press_in_a_slot_is_not_felt_by_the_cells_above_it(turn):
    """Cells that face each other over 60 mm, and a shelf 60 mm below another one: in both, the ray of a contact along
    its normal meets another cell, which MuJoCo's touch sensor would report in the same body."""
    one = seven_boards()
    middle = one.taxels.positions_link[0]
    other = moved(one, "other", turn, middle + (0, 0, 0.06) - turn @ middle)
    calibration = small_calibration(patches=(one, other))
    model, data = with_body(spec_of(calibration))
    taxels = taxels_of(calibration)
    assert model.nbody == 4  # the world, the link, its cells above the others, the sphere
    for row, name in enumerate(taxels.ids):
        press(model, data, taxels.positions[row], taxels.normals[row])
        assert [other for other in taxels.ids if data.sensor(other).data[0] > 0] == [name]
        patch, vertex = ("flower", row) if row < 7 else ("other", row - 7)
        assert np.flatnonzero(data.sensor(patch).data.reshape(3, -1)[0]).tolist() == [vertex]


def test_cells_of_a_convex_link_are_in_one_body():
    """No normal meets another cell: world, link and sphere are all bodies."""
    assert with_body(spec_of(small_calibration(patches=(sheet(4, 20, 0.01),))))[0].nbody == 3


def test_patches_without_a_mesh_have_touch_sensors():
    """Two boards, or one straight row of cells, give no mesh; one row around a bend does."""
    straight = sheet(5, 1, 0.01)
    assert spec_of(small_calibration(patches=(sheet(1, 3, 0.01),))).compile().nmesh == 0
    calibration = small_calibration(patches=(sheet(1, 5, 0.01), boards(5)))
    model, data = with_body(spec_of(calibration))
    assert (model.nmesh, model.nsensor) == (1, 8)
    press(model, data, calibration.patches[1].taxels.positions_link[1], np.array([0, 0, 1.0]))
    assert data.sensor("h1").data[0] > 0 and data.sensor("h0").data[0] == 0
    model, data = with_body(spec_of(small_calibration(patches=(straight,))))
    assert (model.nmesh, model.nsensor) == (0, 5)


def test_robot_wears_an_attached_skin():
    """As in the manual: on a moving link at another pose, all sensors measure the right values."""
    calibration, taxels = curved_and_flat()
    link = (
        '<body name="arm" pos="0.3 0 0.1" euler="0 40 0"><joint axis="0 0 1"/><geom type="cylinder" size="0.03 0.1"/>'
    )
    robot = mujoco.MjSpec.from_string(f'<mujoco><option gravity="0 0 0"/><worldbody>{link}</body></worldbody></mujoco>')
    skin = mujoco.MjSpec.from_string(FORMATS["mjcf"].write(calibration).decode())
    robot.body("arm").add_frame().attach_body(skin.body(calibration.link), "skin/", "")
    finger = robot.worldbody.add_body(name="finger")
    finger.add_freejoint()
    finger.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[RADIUS, 0, 0], mass=0.1)
    model = robot.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert model.body(f"skin/{calibration.link}").mass == 0
    for i, name in enumerate(taxels.ids):
        site = data.site(f"skin/{name}")
        data.qpos[1:] = [*(site.xpos + (RADIUS - DEPTH) * site.xmat.reshape(3, 3)[:, 2]), 1, 0, 0, 0]
        mujoco.mj_forward(model, data)
        assert [other for other in taxels.ids if data.sensor(f"skin/{other}").data[0] > 0] == [name]
        depth = data.sensor("skin/sheet" if i < 24 else "skin/flower").data.reshape(3, -1)[0]
        assert np.flatnonzero(depth).tolist() == [i if i < 24 else i - 24]


def test_names_of_sensors_must_differ():
    """A patch with the name of a taxel is an error before MuJoCo loads the model."""
    patch = sheet(2, 2, 0.01)
    object.__setattr__(patch, "name", "s0.1")
    with pytest.raises(CalibrationFormatError, match='the name "s0.1" would occur twice in MuJoCo. Rename'):
        FORMATS["mjcf"].write(small_calibration(patches=(patch,)))


def test_frames_of_urdf_are_where_mujoco_puts_them():
    """Another URDF reader gives each frame of patch and taxel the pose of the calibration."""
    calibration = small_calibration(patches=(sheet(3, 5, 0.01), seven_boards(15)), link="arm & hand")
    taxels = taxels_of(calibration)
    text = FORMATS["urdf"].write(calibration).decode()
    kept = '<mujoco><compiler fusestatic="false"/></mujoco>\n</robot>'
    model = mujoco.MjModel.from_xml_string(text.replace("</robot>", kept))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for i, name in enumerate(taxels.ids):
        np.testing.assert_allclose(data.body(name).xpos, taxels.positions[i], rtol=0, atol=1e-12)
        np.testing.assert_allclose(data.body(name).xmat.reshape(3, 3), taxels.axes[i], rtol=0, atol=1e-12)
        parent = model.body(model.body(name).parentid[0]).name
        assert parent == taxels.patches[i]
