"""The exported models in MuJoCo Warp and in Newton: the same forces, the same taxels.

Both compile their kernels when they first run, which takes half a minute.
"""

import numpy as np
import pytest

from skin_calib_addon.calibration.exchange import FORMATS
from skin_calib_addon.cli import main
from tests.unit.calibration.exchange import test_export_mujoco
from tests.unit.calibration.exchange.test_export_mujoco import DEPTH, RADIUS, curved_and_flat, mujoco, plate_on
from tests.unit.robot import test_robot_mjcf

fitted, robot = test_robot_mjcf.fitted, test_robot_mjcf.robot
pytestmark = pytest.mark.slow
INSTALL = "is not installed (pip install 'skin-calib[simulators]'): its forces are not compared"
SINGLE = 2e-5  # [N] single precision: positions are rounded to 6e-8 m 1 m from the origin, stiffness is 277 N/m


@pytest.fixture(scope="module")
def warp():
    """Return MuJoCo Warp, which runs on the processor."""
    return pytest.importorskip("mujoco_warp", reason=f"MuJoCo Warp {INSTALL}")


def forces(warp, model, data, tolerance=0.0):
    """Return the forces of the touch sensors [N], of MuJoCo and of MuJoCo Warp; None keeps the tolerance of Warp."""
    mujoco.mj_forward(model, data)
    on_device, state = warp.put_model(model), warp.put_data(model, data, nconmax=500, njmax=4000)
    if tolerance is not None:
        on_device.opt.tolerance.fill_(tolerance)
    warp.forward(on_device, state)
    assert int(state.nacon.numpy()[0]) == data.ncon and not state.overflow.numpy().any()
    touch = model.sensor_adr[model.sensor_type == mujoco.mjtSensor.mjSENS_TOUCH]
    return data.sensordata[touch], state.sensordata.numpy()[0, touch]


def with_fingers(spec, count):
    """Return the compiled model with free spheres, and its data."""
    for k in range(count):
        finger = spec.worldbody.add_body(name=f"finger {k}")
        finger.add_freejoint(name=f"finger {k}")
        finger.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[RADIUS, 0, 0], mass=0.1)
    spec.option.gravity = [0, 0, 0]
    model = spec.compile()
    return model, mujoco.MjData(model)


def press_apart(model, data, count, seed=0):
    """Move spheres onto random taxels that are far enough from each other."""
    mujoco.mj_forward(model, data)
    sites = model.sensor_objid[model.sensor_type == mujoco.mjtSensor.mjSENS_TOUCH]
    taken = []
    for site in np.random.default_rng(seed).permutation(sites):
        place = data.site_xpos[site] + (RADIUS - DEPTH) * data.site_xmat[site].reshape(3, 3)[:, 2]
        if len(taken) < count and all(np.linalg.norm(place - other) > 2.2 * RADIUS for other in taken):
            data.joint(f"finger {len(taken)}").qpos[:3] = place
            taken.append(place)
    assert len(taken) == count


def test_warp_has_the_forces_of_many_presses(warp):
    """Eight at once on a link, half of them on a curved sheet."""
    model, data = with_fingers(mujoco.MjSpec.from_string(FORMATS["mjcf"].write(curved_and_flat()[0]).decode()), 8)
    press_apart(model, data, 8)
    expected, found = forces(warp, model, data)
    assert np.count_nonzero(expected) == 8
    np.testing.assert_allclose(found, expected, rtol=0, atol=SINGLE)


def test_warp_has_the_forces_of_a_robot(warp, robot, capsys):
    """Presses on both of its links at once."""
    assert main(["export", str(robot / "out"), "--to", "mjcf", "-o", str(robot / "skin.xml")]) == 0
    model, data = with_fingers(mujoco.MjSpec.from_file(str(robot / "skin.xml")), 12)
    press_apart(model, data, 12)
    expected, found = forces(warp, model, data)
    assert np.count_nonzero(expected) == 12
    np.testing.assert_allclose(found, expected, rtol=0, atol=SINGLE)


def test_warp_has_the_forces_of_a_plate_to_its_precision(warp):
    """A plate has up to 94 contacts at the rims of cells. The normals of Warp deviate by up to 1e-4 rad."""
    for model, data in plate_on(test_export_mujoco.sole(), (0, 78, 130)):
        expected, found = forces(warp, model, data)
        assert data.ncon > 20 and expected.sum() > 0.7
        np.testing.assert_allclose(found, expected, rtol=0, atol=4e-4 * expected.sum())


@pytest.fixture(scope="module")
def newton():
    """Return Newton."""
    return pytest.importorskip("newton", reason="Newton is not installed (pip install 'skin-calib[simulators]')")


def test_newton_finds_the_contact_of_each_taxel(newton):
    """The shape of the cell has the id of the taxel. A sphere in it has one contact, with the right depth."""
    calibration, taxels = curved_and_flat()
    builder = newton.ModelBuilder()
    builder.rigid_gap = builder.default_shape_cfg.gap = 0.0  # otherwise contacts begin at a distance
    builder.add_mjcf(FORMATS["newton"].write(calibration).decode())
    finger = builder.add_body(label="finger")
    builder.add_shape_sphere(finger, radius=RADIUS)
    model = builder.finalize()
    state, names = model.state(), [label.rpartition("/")[2] for label in builder.shape_label]
    pipeline = newton.CollisionPipeline(model)
    contacts = pipeline.contacts()
    for row, name in enumerate(taxels.ids):
        place = taxels.positions[row] + (RADIUS - DEPTH) * taxels.normals[row]
        poses = state.body_q.numpy()
        poses[finger] = [*place, 0, 0, 0, 1]
        state.body_q.assign(poses)
        pipeline.collide(state, contacts)
        shapes = [contacts.rigid_contact_shape0.numpy()[0], contacts.rigid_contact_shape1.numpy()[0]]
        points = [contacts.rigid_contact_point0.numpy()[0], contacts.rigid_contact_point1.numpy()[0]]
        cell = int(model.shape_body.numpy()[shapes[0]] == finger)
        assert int(contacts.rigid_contact_count.numpy()[0]) == 1 and names[shapes[cell]] == name
        depth = RADIUS - (place - points[cell]) @ taxels.normals[row]
        assert depth == pytest.approx(DEPTH, abs=1e-7)


def test_newton_loads_a_robot(newton, robot, capsys):
    """Each taxel of each link is a shape and a site with its name; the model for MuJoCo is refused."""
    assert main(["export", str(robot / "out"), "--to", "newton", "-o", str(robot / "skin.xml")]) == 0
    builder = newton.ModelBuilder()
    builder.add_mjcf(str(robot / "skin.xml"))
    model = mujoco.MjModel.from_xml_path(str(robot / "skin.xml"))
    taxels = [f"/{model.sensor(i).name}" for i in range(model.nsensor)]
    assert len(set(taxels)) == 16
    assert {sum(label.endswith(name) for label in builder.shape_label) for name in taxels} == {2}
    assert main(["export", str(robot / "out"), "--to", "mjcf", "-o", str(robot / "tactile.xml")]) == 0
    with pytest.raises(ValueError, match="3 shared values or 3 values per vertex"):
        newton.ModelBuilder().add_mjcf(str(robot / "tactile.xml"))


def test_newton_loads_usd(newton, tmp_path):
    """The points of USD are no bodies: they only may not disturb."""
    pytest.importorskip(
        "newton_usd_schemas", reason="Newton's readers are not installed (pip install newton[importers])"
    )
    (tmp_path / "skin.usda").write_bytes(FORMATS["usd"].write(curved_and_flat()[0]))
    builder = newton.ModelBuilder()
    assert builder.add_usd(str(tmp_path / "skin.usda"))["linear_unit"] == 1.0
    assert builder.body_count == builder.shape_count == 0
