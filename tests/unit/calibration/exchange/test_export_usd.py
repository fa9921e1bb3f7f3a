"""USD's own library reads the exported points: every number, in the frame of the link, and valid for its checks."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from skin_calib_addon.calibration import save_calibration
from skin_calib_addon.calibration.exchange import FORMATS
from skin_calib_addon.calibration.exchange.link_taxels import taxels_of
from skin_calib_addon.cli import main
from skin_calib_addon.common.errors import CalibrationFormatError
from tests.samples import seven_boards, sheet, small_calibration

Usd = pytest.importorskip("pxr.Usd", reason="USD is not installed (pip install usd-core): its files are not read")
UsdGeom = pytest.importorskip("pxr.UsdGeom")


def skin():
    """Return a sheet with uncertainties, one unknown, and boards, with names that USD does not allow for prims."""
    patch = sheet(4, 6, 0.01)
    sigma = np.random.default_rng(0).uniform(1e-5, 1e-3, (24, 3))
    sigma[3] = np.nan
    patch = replace(patch, name="7.a", taxels=replace(patch.taxels, sigma=sigma))
    other = replace(seven_boards(24), name="7 a")
    calibration = small_calibration(patches=(patch, other), link='fore"arm\\ 前')
    return calibration, taxels_of(calibration)


def opened(path, calibration):
    """Write a calibration as USD; return its stage and the points of each patch by its name."""
    path.write_bytes(FORMATS["usd"].write(calibration))
    stage = Usd.Stage.Open(str(path))
    return stage, {prim.GetDisplayName(): prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Points)}


def test_values_are_those_of_the_taxels_to_the_last_digit(tmp_path):
    """Points have single precision, primvars double. An unknown uncertainty is NaN, none is no primvar."""
    calibration, taxels = skin()
    stage, points = opened(tmp_path / "skin.usda", calibration)
    assert (UsdGeom.GetStageMetersPerUnit(stage), UsdGeom.GetStageUpAxis(stage)) == (1.0, "Z")
    assert stage.GetDefaultPrim().GetDisplayName() == calibration.link and stage.GetDefaultPrim().IsA(UsdGeom.Xform)
    assert [str(prim.GetPath()) for prim in points.values()] == ["/fore_arm___/_7_a", "/fore_arm___/_7_a_"]
    for patch, prim in points.items():
        rows, geometry, primvars = taxels.of(patch), UsdGeom.Points(prim), UsdGeom.PrimvarsAPI(prim)
        found = {v.GetPrimvarName(): np.array(v.Get()) for v in primvars.GetAuthoredPrimvars()}
        assert_array_equal(found.pop("taxel:id"), np.array(taxels.ids)[rows])
        assert_array_equal(found.pop("taxel:position"), taxels.positions[rows])
        assert_array_equal(found.pop("taxel:normal"), taxels.normals[rows])
        assert_array_equal(found.pop("taxel:tangent"), taxels.tangents[rows])
        assert_array_equal(found.pop("taxel:area"), taxels.areas[rows])
        if patch == "7.a":
            assert_array_equal(found.pop("taxel:sigma"), taxels.sigma[rows])
        assert not found
        assert_array_equal(geometry.GetIdsAttr().Get(), taxels.channels[rows])
        assert_array_equal(geometry.GetPointsAttr().Get(), taxels.positions[rows].astype(np.float32))
        assert_array_equal(geometry.GetNormalsAttr().Get(), taxels.normals[rows].astype(np.float32))
        assert_allclose(np.pi / 4 * np.square(geometry.GetWidthsAttr().Get()), taxels.areas[rows], rtol=1e-6)
        assert {v.GetInterpolation() for v in primvars.GetAuthoredPrimvars()} == {UsdGeom.Tokens.vertex}


def test_all_checks_of_usd_pass(tmp_path):
    """Those of the library, for every kind of prim."""
    validation = pytest.importorskip("pxr.UsdValidation")
    stage, _ = opened(tmp_path / "skin.usda", skin()[0])
    validators = validation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 20
    assert [error.GetErrorAsString() for error in validation.ValidationContext(validators).Validate(stage)] == []


def test_referenced_skin_moves_with_its_link(tmp_path):
    """As in the manual: below the prim of the link, which is at another pose."""
    calibration, taxels = skin()
    opened(tmp_path / "skin.usda", calibration)
    robot = Usd.Stage.CreateNew(str(tmp_path / "robot.usda"))
    link = UsdGeom.Xform.Define(robot, "/robot/arm")
    link.AddTranslateOp().Set((0.1, 0.2, 0.3))
    link.AddRotateZOp().Set(90.0)
    robot.DefinePrim("/robot/arm/skin").GetReferences().AddReference("skin.usda")
    prim = robot.GetPrimAtPath("/robot/arm/skin/_7_a")
    pose = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(prim)).T  # USD multiplies rows
    at = np.array(UsdGeom.PrimvarsAPI(prim).GetPrimvar("taxel:position").Get())
    x, y, z = taxels.positions[taxels.of("7.a")].T
    expected = np.column_stack((0.1 - y, 0.2 + x, 0.3 + z))
    assert_allclose(at @ pose[:3, :3].T + pose[:3, 3], expected, atol=1e-12)


def test_binary_file_of_usd_keeps_all_digits(tmp_path):
    """After a conversion by the library."""
    calibration, taxels = skin()
    stage, _ = opened(tmp_path / "skin.usda", calibration)
    stage.Export(str(tmp_path / "skin.usdc"))
    stage = Usd.Stage.Open(str(tmp_path / "skin.usdc"))
    prim = stage.GetPrimAtPath("/fore_arm___/_7_a")
    assert_array_equal(UsdGeom.PrimvarsAPI(prim).GetPrimvar("taxel:position").Get(), taxels.positions[:24])


def test_names_that_do_not_fit_are_refused():
    """A line feed would end the text of a name."""
    with pytest.raises(CalibrationFormatError, match='patch "a\\\\nb" cannot be written: .*Rename it'):
        FORMATS["usd"].write(small_calibration(patches=(replace(sheet(2, 2, 0.01), name="a\nb"),)))


def test_ending_that_usd_would_not_read_is_refused(tmp_path, capsys):
    """USD takes the kind of file from its ending: it would read .usdc as binary data. Nothing is written."""
    save_calibration(skin()[0], tmp_path / "c.json")
    words = ["export", str(tmp_path / "c.json"), "--to", "usd", "-o"]
    assert main([*words, str(tmp_path / "skin.usdc")]) == 2
    assert "skin.usdc: USD is written as text. Name it .usda or .usd." in capsys.readouterr().err
    assert not (tmp_path / "skin.usdc").exists()
    assert main([*words, str(tmp_path / "skin.usd")]) == 0
    assert Usd.Stage.Open(str(tmp_path / "skin.usd")).GetDefaultPrim().IsValid()
    assert "ids in the file: primvars:taxel:id" in capsys.readouterr().out
