"""Laws of exported models: MuJoCo loads them for any names, with all taxels at their poses."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.calibration.exchange import FORMATS
from skin_calib_addon.calibration.exchange.link_taxels import taxels_of
from skin_calib_addon.common.errors import CalibrationFormatError
from tests.laws.test_export_laws import any_name, patches
from tests.samples import boards, small_calibration

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed (pip install mujoco): its model is not tried")
some_patches = st.integers(1, 3).flatmap(patches)
# Otherwise MuJoCo merges bodies that are fixed to the link.
KEPT = '<mujoco><compiler fusestatic="false"/></mujoco>\n</robot>'


def loaded(name, calibration):
    """Return a calibration in a format, as loaded by MuJoCo."""
    try:
        text = FORMATS[name].write(calibration).decode()
    except CalibrationFormatError:  # an invalid name of the format; other tests check these
        assume(False)
    model = mujoco.MjModel.from_xml_string(text.replace("</robot>", KEPT))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


@given(parts=some_patches, link=any_name)
def test_any_model_has_its_sites(parts, link):
    """Sites have names and frames of the taxels, and one sensor each, in the order of the taxels."""
    calibration = small_calibration(patches=parts, link=link)
    model, data = loaded("mjcf", calibration)
    taxels = taxels_of(calibration)
    assert model.body(1).name == link and model.nsite == len(taxels.ids)
    sites = model.sensor_objid[: model.nsite]
    assert [model.site(i).name for i in sites] == list(taxels.ids)
    assert [model.sensor(i).name for i in range(model.nsite)] == list(taxels.ids)
    assert_allclose(data.site_xpos[sites], taxels.positions, rtol=0, atol=1e-12)
    assert_allclose(data.site_xmat[sites].reshape(-1, 3, 3), taxels.axes, rtol=0, atol=1e-12)
    meshes = [patch for patch in parts if len(patch.taxels.ids) > 3]
    assert model.nsensor == len(taxels.ids) + len(meshes)
    assert model.nsensordata == len(taxels.ids) + 3 * sum(len(patch.taxels.ids) for patch in meshes)


@given(parts=some_patches, link=any_name)
def test_any_frames_are_where_the_taxels_are(parts, link):
    """Another program reads the URDF."""
    calibration = small_calibration(patches=parts, link=link)
    _, data = loaded("urdf", calibration)
    taxels = taxels_of(calibration)
    placed = [data.body(name) for name in taxels.ids]
    assert_allclose([body.xpos for body in placed], taxels.positions, rtol=0, atol=1e-12)
    assert_allclose(np.reshape([body.xmat for body in placed], (-1, 3, 3)), taxels.axes, rtol=0, atol=1e-12)


@pytest.mark.parametrize("wall", [0.0005, 0.002, 0.006])
def test_each_side_of_a_thin_wall_feels_its_own_presses(wall):
    """Boards back to back: a sphere that presses one of them is not felt through the wall."""
    front = boards(first_channel=0)
    t = front.taxels
    back = replace(
        front,
        name="back",
        taxels=replace(
            t,
            ids=tuple(f"back {name}" for name in t.ids),
            channels=t.channels + 100,
            neighbours=tuple(tuple(f"back {name}" for name in row) for row in t.neighbours),
            positions_link=t.positions_link - wall * t.normals_link,
            normals_link=-t.normals_link,
            corners_link=(t.corners_link - wall * t.normals_link[:, None])[:, ::-1],
        ),
    )
    text = FORMATS["mjcf"].write(small_calibration(patches=(front, back))).decode()
    sphere = '<body name="sphere"><freejoint/><geom type="sphere" size="0.004" mass="0.1"/></body></worldbody>'
    model = mujoco.MjModel.from_xml_string(text.replace("</worldbody>", sphere))
    model.opt.gravity[:] = 0
    discs = model.geom_type == mujoco.mjtGeom.mjGEOM_CYLINDER
    assert discs.sum() == 2 * len(t.ids) and 2 * model.geom_size[discs, 1].max() < 0.51 * wall  # each in its half
    data = mujoco.MjData(model)
    for patch in (front, back):
        for name, place, normal in zip(patch.taxels.ids, patch.taxels.positions_link, patch.taxels.normals_link):
            mujoco.mj_resetData(model, data)
            data.qpos[:3] = place + (0.004 - min(0.0003, wall / 4)) * normal
            mujoco.mj_forward(model, data)
            felt = [model.sensor(i).name for i in range(model.nsite) if data.sensor(i).data[0] > 0]
            assert felt == [name]
