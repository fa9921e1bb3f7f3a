"""Laws of exported models: MuJoCo loads them for any names, with all taxels at their poses."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.calibration.exchange import FORMATS
from skin_calib_addon.calibration.exchange.link_taxels import taxels_of
from skin_calib_addon.common.errors import CalibrationFormatError
from tests.laws.test_export_laws import any_name, patches
from tests.samples import small_calibration

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
