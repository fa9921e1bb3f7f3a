"""The sheet on paper: lengths, texts and pages of the files, and distances against those on the surface."""

import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skin_calib_addon.calibration import Trusted, save_calibration
from skin_calib_addon.cli import main
from skin_calib_addon.common.errors import SkinCalibError
from skin_calib_addon.pictures.pattern import Pattern, write_pattern
from skin_calib_addon.pipeline.calibrate import surface_of
from skin_calib_addon.skin.lattice import SheetLattice
from skin_calib_addon.skin.sheet.closure import shortest_paths
from skin_calib_addon.skin.sheet.taxels import sheet_taxels
from skin_calib_addon.skin.sheet.wrap import wrap_sheet
from tests.samples import RADIUS, cylinder, sheet, small_calibration

SVG = "{http://www.w3.org/2000/svg}"


def pattern_of(rows=2, columns=3, barrel=0.0, **trusted):
    """Return the pattern of a sheet on the tube with normals outward; ``barrel`` widens its middle."""
    tube = cylinder()
    wider = np.array((1, 1 + barrel, 1))[:, None, None] ** np.array((1, 1, 0))
    tube = replace(tube, control_net=tube.control_net[::-1] * wider, trusted=Trusted(**trusted) if trusted else None)
    lattice = SheetLattice(rows, columns, (0.01, 0.01))
    start = np.array((RADIUS, 0, 0.1 - 0.005 * (rows - 1)))
    taxels = sheet_taxels(wrap_sheet(surface_of(tube), lattice, start, (0, 1, 0)), "s")
    patch = replace(sheet(rows, columns, 0.01), taxels=taxels, name="s")
    calibration = small_calibration(surfaces=(tube,), patches=(patch,))
    return Pattern(calibration, calibration.patches[0])


def drawn(calibration):
    """Return the tree of an SVG, and a function from a gid to its points [mm]."""
    tree = ElementTree.fromstring(write_pattern(calibration, ".svg"))
    scale = float(tree.get("width").removesuffix("mm")) / float(tree.get("viewBox").split()[2])

    def points(gid):
        group = next(g for g in tree.iter(f"{SVG}g") if g.get("id") == gid)
        path = next(group.iter(f"{SVG}path")).get("d")
        return scale * np.array(re.findall(r"[ML] (\S+) (\S+)", path), float)

    return tree, points


def test_svg_has_true_lengths_and_all_labels():
    """On paper, cells have their pitch and the bar has 100 mm; each cell has its id and channel."""
    calibration = pattern_of().calibration
    tree, points = drawn(calibration)
    centres = {
        i: points(i).mean(axis=0) if len(points(i)) == 4 else points(i)[:4].mean(axis=0) for i in ("s.0.0", "s.1.2")
    }
    assert_allclose(np.abs(centres["s.1.2"] - centres["s.0.0"]), (20, 10), atol=1e-3)
    assert_allclose(np.ptp(points("bar"), axis=0), (100, 0), atol=1e-3)
    assert tree.get("height").endswith("mm")
    texts = {t.text for t in tree.iter(f"{SVG}text")}
    assert {"0.0", "1.2", "5", "100 mm"} <= texts
    assert write_pattern(calibration, ".svg") == write_pattern(calibration, ".svg")


@pytest.mark.parametrize(("rows", "columns", "pages"), [(2, 3, 1), (18, 3, 2)])
def test_pdf_pages_are_a4_and_cover_the_sheet(rows, columns, pages):
    """Pages have 210 x 297 mm, in points; a larger sheet has more of them."""
    data = write_pattern(pattern_of(rows, columns).calibration, ".pdf")
    boxes = re.findall(rb"/MediaBox \[ 0 0 (\S+) (\S+) \]", data)
    assert len(boxes) == pages
    assert_allclose(sorted(map(float, boxes[0])), np.array((210, 297)) * 72 / 25.4, atol=1e-3)


def test_a_left_handed_sheet_has_its_next_row_below():
    """The paper is seen from outside: normal x tangent is up."""
    calibration = pattern_of().calibration
    taxels = calibration.patches[0].taxels
    left = replace(taxels, index=np.array((1, 0)) + taxels.index * (-1, 1))
    patch = replace(calibration.patches[0], taxels=left)
    assert_allclose(Pattern(calibration, patch).centres[:, 1].min(), -10)


@pytest.mark.parametrize("barrel", [0.0, 0.3])
def test_distances_on_paper_are_those_on_the_surface(barrel):
    """Between any two cells of a sheet on a tube, up to strain and 0.1 mm."""
    pattern = pattern_of(4, 6, barrel)
    pairs = np.array([(i, j) for i in range(24) for j in range(i)])
    uv = pattern.patch.taxels.uv
    start, step = uv[pairs[:, 0]], uv[pairs[:, 1]] - uv[pairs[:, 0]]
    step[:, 1] -= np.rint(step[:, 1])  # over the seam
    on_surface = 1e3 * shortest_paths(pattern.layer, start, start + step)[0]
    on_paper = np.linalg.norm(np.diff(pattern.centres[pairs], axis=1)[:, 0], axis=1)
    strain = np.abs(pattern.patch.taxels.quality["strain"]).max()
    assert (np.abs(on_paper - on_surface) <= strain * on_surface + 0.1).all()


def test_closing_line_is_where_the_sheet_meets_itself():
    """18 columns of 10 mm on a tube: the other end is one circumference from the first."""
    pattern = pattern_of(2, 18)
    around = 1e3 * shortest_paths(pattern.layer, np.array([[0.5, 0.0]]), np.array([[0.5, 1.0]]))[0][0]
    line = np.concatenate(pattern.edges(pattern.is_other_end))
    after = line[(np.abs(line[:, 1] - 5) < 8) & (line[:, 0] > 0)]
    assert_allclose(after[:, 0].min(), around - 5, atol=0.3)


@pytest.mark.parametrize(
    "trusted",
    [
        {
            "boundary": (
                np.array(((0.35, 0.0), (0.35, 0.4), (0.35, 0.8))),
                np.array(((0.65, 0.0), (0.65, 0.4), (0.65, 0.8))),
            )
        }
    ],
)
def test_edge_of_the_cover_is_at_its_distance(trusted):
    """Two loops around the tube, 30 mm to both sides of the middle of a sheet of four rows."""
    pattern = pattern_of(4, 3, **trusted)
    edge = np.concatenate(pattern.edges(pattern.is_covered))
    assert_allclose(np.abs(edge[:, 1] - 15), 30, atol=0.1)


def test_other_patches_and_endings_are_refused(tmp_path, capsys):
    """Boards are no sheet; the line names the sheets. A name says whether SVG or PDF is written."""
    with pytest.raises(SkinCalibError, match="patch 'boards' has the kind hexagons.*--patch: sheet"):
        write_pattern(small_calibration(), ".svg")
    save_calibration(small_calibration(), tmp_path / "c.json")
    call = ["export", str(tmp_path / "c.json"), "--to", "pattern", "--patch", "sheet", "-o"]
    assert main([*call, str(tmp_path / "c.png")]) != 0
    assert "written as .svg or .pdf" in capsys.readouterr().err
    assert main([*call, str(tmp_path / "c.svg")]) == 0
