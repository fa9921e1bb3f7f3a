"""Laws of exported calibrations: the readers of this package read them back unchanged."""

import dataclasses

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.calibration.exchange import FORMATS, READABLE, WRITABLE, read_taxels
from skin_calib_addon.calibration.exchange.reading import cloud_format_of, format_of
from skin_calib_addon.common.errors import CalibrationFormatError
from tests.samples import seven_boards, sheet, small_calibration
from tests.shapes import Motion

# Valid names in all formats: printable, without spaces at the ends.
printable = st.characters(exclude_categories=["Cs", "Cc"]).filter(str.isprintable)
special = st.text(st.sampled_from(""" <>&"'#,;:/\\[](){}%$=|~é前🤖"""), min_size=1, max_size=5)
names = (st.text(printable, min_size=1, max_size=8) | special).map(str.strip).filter(bool)
words = st.text(st.sampled_from("abz-_.:/&<>;=é前"), min_size=1, max_size=6)  # for positions files
CARRIES = {  # what is read back in addition to positions, normals and link name
    "csv": {"ids", "channels", "tangents", "neighbours"},
    "gentact": {"channels"},
    "icub": {"channels"},
    "tum": {"tangents", "neighbours"},
    "urdf": {"ids", "tangents"},
    "urdf-tactile": {"channels", "tangents"},
    "ply": {"ids", "channels"},
    "pcd": {"ids", "channels"},
}


@st.composite
def patches(draw, count):
    """Draw patches of both cell shapes, with any pose, unique names and ids, and channels with gaps."""
    parts = [draw(st.sampled_from((sheet(2, 3, 0.01), sheet(1, 1, 0.01), seven_boards()))) for _ in range(count)]
    size = sum(len(part.taxels.ids) for part in parts)
    before, after, seed = draw(names), draw(names), draw(st.integers(0, 2**32 - 1))
    ids = [f"{before}{i}{after}" for i in range(size + count)]
    channels = np.random.default_rng(seed).permutation(3 * size)[:size] + draw(st.integers(0, 50))
    found = []
    for part in parts:
        motion, taxels = Motion(seed + len(found)), part.taxels
        n = len(taxels.ids)
        mine, ids = dict(zip(taxels.ids, ids[:n])), ids[n:]
        moved = {
            "positions_link": motion.points(taxels.positions_link),
            "corners_link": motion.points(taxels.corners_link),
            "normals_link": motion.directions(taxels.normals_link),
            "tangents_link": motion.directions(taxels.tangents_link),
            "channels": channels[:n],
            "ids": tuple(mine.values()),
            "neighbours": tuple(tuple(mine[i] for i in row) for row in taxels.neighbours),
            "ports": tuple(tuple(i and mine[i] for i in row) for row in taxels.ports),
        }
        found.append(dataclasses.replace(part, name=ids[-1], taxels=dataclasses.replace(taxels, **moved)))
        channels, ids = channels[n:], ids[:-1]
    return tuple(found)


def column(calibration, name):
    """Return a column of all patches."""
    return [value for patch in calibration.patches for value in getattr(patch.taxels, name)]


@pytest.mark.parametrize("name", READABLE)
@given(data=st.data())
def test_exported_data_are_read_back(tmp_path_factory, name, data):
    """Up to 1e-12, with all data of the format, which is detected from the content."""
    link = data.draw(words if name == "icub" else names)
    calibration = small_calibration(link=link, patches=data.draw(st.integers(1, 3).flatmap(patches)))
    assume(name != "urdf" or link not in {*column(calibration, "ids"), *(patch.name for patch in calibration.patches)})
    path = tmp_path_factory.getbasetemp() / "exported"
    content = FORMATS[name].write(calibration)
    path.write_bytes(content)
    assert (cloud_format_of(content) or format_of(content.decode())) == name.partition("-")[0].replace("gentact", "csv")
    back = read_taxels(path)
    order = np.argsort(column(calibration, "channels"), kind="stable")

    def sorted_by_channel(field):
        return [column(calibration, field)[i] for i in order]

    rows = np.argsort(back.channels, kind="stable")  # the sensors of a URDF follow one another
    assert back.frame == link
    channels = np.array(sorted_by_channel("channels"))
    assert_allclose(back.positions[rows], sorted_by_channel("positions_link"), rtol=0, atol=1e-12)
    assert_allclose(back.normals[rows], sorted_by_channel("normals_link"), rtol=0, atol=1e-12)
    if "tangents" in CARRIES[name]:
        assert_allclose(back.tangents[rows], sorted_by_channel("tangents_link"), rtol=0, atol=1e-12)
    if "channels" in CARRIES[name]:
        assert back.channels[rows].tolist() == channels.tolist()
    else:
        assert back.channels[rows].tolist() == list(range(len(channels)))
    ids = sorted_by_channel("ids")
    patch_of = {i: patch.name for patch in calibration.patches for i in patch.taxels.ids}
    labels = {
        "tum": [str(channel + 1) for channel in channels],
        "urdf-tactile": [f"{patch_of[i]}.{channel}" for i, channel in zip(ids, channels)],
    }
    expected = ids if "ids" in CARRIES[name] else labels.get(name, [str(channel) for channel in channels])
    assert [back.labels[row] for row in rows] == expected
    if "neighbours" in CARRIES[name]:
        label = dict(zip(ids, expected))
        neighbours = [{label[i] for i in row} for row in sorted_by_channel("neighbours")]
        assert [set(row) for row in map(back.neighbours.__getitem__, rows)] == neighbours


any_name = st.text(st.characters(exclude_categories=["Cs", "Cc"]), min_size=1, max_size=300)


@pytest.mark.parametrize("name", WRITABLE)
@given(link=any_name, patch=any_name, taxel=any_name)
def test_any_name_is_written_or_rejected(tmp_path_factory, name, link, patch, taxel):
    """One line with the reason, or a file that can be read; the same bytes each time."""
    flat = seven_boards()
    ids = (taxel, *flat.taxels.ids[1:])
    taxels = dataclasses.replace(flat.taxels, ids=ids, neighbours=((),) * 7, ports=())
    calibration = small_calibration(link=link, patches=(dataclasses.replace(flat, name=patch, taxels=taxels),))
    try:
        content = FORMATS[name].write(calibration)
    except CalibrationFormatError as refused:
        assert "\n" not in str(refused) and "Rename" in str(refused)
        return
    assert content == FORMATS[name].write(calibration)
    if name in READABLE:
        path = tmp_path_factory.getbasetemp() / "named"
        path.write_bytes(content)
        back = read_taxels(path)
        assert len(back.labels) == 7 and back.frame == link
        assert "ids" not in CARRIES[name] or taxel in back.labels
