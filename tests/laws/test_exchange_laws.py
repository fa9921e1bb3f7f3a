"""Laws of taxel files: written files are read back, and any bytes give taxels or a CalibrationFormatError."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from skin_calib_addon.calibration.exchange import READABLE, read_taxels
from skin_calib_addon.common.errors import CalibrationFormatError
from tests.examples import examples
from tests.exchange_samples import (
    CELLS,
    SENSOR,
    csv_text,
    icub_text,
    pcd_text,
    ply_text,
    points_round,
    robot_text,
    tum_text,
)

seeds = st.integers(0, 2**32 - 1)
ROUND, OUTWARD = points_round(6)
SAMPLES = (
    icub_text(np.column_stack((ROUND, OUTWARD)), "3 -1 -2 3 3"),
    tum_text(CELLS),
    csv_text(ROUND, normals=OUTWARD, tangents=OUTWARD),
    csv_text(ROUND).replace("x,y,z", "id,row,frame").replace("\n", "\na,3,b,c,", 1),
    robot_text({f"skin_{i}": place for i, place in enumerate(ROUND.tolist())}),
    SENSOR,
    ply_text(ROUND, OUTWARD).replace("comment by hand", "comment link arm\ncomment taxel 3 a"),
    pcd_text(ROUND),
)
# Critical content: invalid and huge numbers, keywords of each format, lone surrogates, long words.
WORDS = (
    "nan", "inf", "-1e999", "1e308", "-0", "0x10", "1_0", "９", "", " ", "\t", "\n", "\r", "\x00", "\x1c", "\u2028",
    '"', "'", ",", ";", "#", "(", ")", "[calibration]", "[", "]", "taxel2Repr ( 1 ", "name", "frame", "x,y,z", "id",
    "<", ">", "<robot>", "<taxel>", "binary", "element", "property list", "POINTS", "DATA", "COUNT 0", "-1", "1e400",
     "</cell>", "<cell>", "<!--", "<![CDATA[", "]]>", "&a;", "&#0;", "<!ENTITY a 'b'>", "<?xml?>", "<pos/>",
    "\ud7ff", "\U0001f916", "é", "a" * 300, "9" * 5000, "1 " * 300, "<a>" * 30,
)  # fmt: skip


@st.composite
def damaged(draw):
    """Draw a sample with removed, repeated or replaced parts."""
    content = draw(st.sampled_from(SAMPLES))
    for _ in range(draw(st.integers(0, 5))):
        a, b = sorted(draw(st.tuples(*2 * [st.integers(0, len(content))])))
        b = draw(st.sampled_from((a, min(a + 3, b), b)))
        filling = draw(st.sampled_from((*WORDS, content[a:b], 2 * content[a:b])) | st.text(max_size=5))
        content = content[:a] + filling + content[b:]
    return content


def assert_sound(taxels):
    """Check that a taxel set is consistent."""
    n = len(taxels.labels)
    assert n > 0 and len(set(taxels.labels)) == n and len(set(taxels.channels.tolist())) == n
    assert taxels.channels.min() >= 0 and np.isfinite(taxels.positions).all()
    for vectors in (taxels.normals, taxels.tangents):
        if vectors is not None:
            assert_allclose(np.linalg.norm(vectors, axis=1), 1, rtol=1e-12)
    assert all(finding.severity == "warning" for finding in taxels.findings)


@examples(300)
@given(
    data=st.binary(max_size=300) | damaged().map(lambda s: s.encode("utf-8", "surrogatepass")),
    name=st.sampled_from((None, *READABLE)),
)
def test_any_bytes_are_read_or_refused(tmp_path_factory, data, name):
    """Valid taxels, or at least one error with location; no other exception."""
    path = tmp_path_factory.getbasetemp() / "bytes"
    path.write_bytes(data)
    try:
        assert_sound(read_taxels(path, name))
    except CalibrationFormatError as problem:
        assert "\n" not in str(problem) and str(path) in str(problem)
        assert all("\n" not in str(finding) and len(str(finding)) < 1000 for finding in problem.findings)


NUMBERS = np.column_stack((ROUND, OUTWARD)).astype("<f4").tobytes()
BINARY = (
    ply_text(ROUND, OUTWARD).split("0.03")[0].replace("ascii", "binary_little_endian").encode() + NUMBERS,
    pcd_text(np.column_stack((ROUND, OUTWARD)), "x y z normal_x normal_y normal_z")
    .split("0.03")[0]
    .replace("ascii", "binary")
    .encode()
    + NUMBERS,
)


@examples(200)
@given(
    data=st.sampled_from(BINARY),
    cuts=st.lists(st.tuples(st.integers(0, 400), st.integers(0, 8), st.binary(max_size=8))),
)
def test_binary_clouds_are_read_or_refused(tmp_path_factory, data, cuts):
    """With removed and inserted bytes: NaN, and headers that announce missing data."""
    for start, length, new in cuts:
        data = data[:start] + new + data[start + length :]
    path = tmp_path_factory.getbasetemp() / "cloud"
    path.write_bytes(data)
    try:
        assert_sound(read_taxels(path))
    except CalibrationFormatError as problem:
        assert "\n" not in str(problem)
