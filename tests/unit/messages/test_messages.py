"""Messages: two independent readers get every value to the last digit; damaged bytes are refused."""

import dataclasses
import math
import re
import struct
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from skin_calib_addon import __version__
from skin_calib_addon.calibration import Modality, Response, ResponseTable
from skin_calib_addon.common.errors import CalibrationFormatError, InvalidReading
from skin_calib_addon.messages import (
    NAMES,
    PACKAGE,
    decode,
    encode,
    frame_message,
    layout_message,
    reading_message,
    reading_of,
    schema_text,
)  # fmt: skip
from skin_calib_addon.messages.content import nanoseconds, seconds
from skin_calib_addon.messages.definitions import FOLDER, OF_ROS, PRIMITIVES, fields_of, text_of
from skin_calib_addon.runtime import Skin
from tests.samples import plane, small_calibration
from tests.soles import sole_patch

NEAR = Modality("proximity", "m", ResponseTable((0.0, 4000.0), (0.2, 0.0)))
N = 42


@pytest.fixture(scope="module")
def sole():
    """Return a calibrated sole with some known uncertainties, and a further modality."""
    patch = sole_patch()
    sigma = np.full((N, 3), np.nan)
    sigma[:20] = np.linspace(1e-4, 1e-3, 60).reshape(20, 3)
    patch = dataclasses.replace(patch, taxels=dataclasses.replace(patch.taxels, sigma=sigma))
    fields = {"link": "left_sole", "patches": (patch,), "surfaces": (plane(),), "modalities": (NEAR,)}
    return small_calibration(**fields, response=Response((0.0, 0.2), (0.0, 4095.0)))


@pytest.fixture(scope="module")
def messages(sole):
    """Return messages of each kind with the name of theirs: also of a frame in the air, and of one without values."""
    rng, skin = np.random.default_rng(5), Skin(sole)
    rows = np.rint(np.maximum(rng.normal(20, 2, (60, N)), 0)).astype(np.uint16)
    skin.tare(rows[:40], accept=True)
    rows = rows.astype(float)
    rows[50:, 3:14], rows[50:, 30], rows[52, 20] = 300, 4000, np.nan
    near = rng.uniform(0, 4000, (60, N))
    near[52, 7] = np.nan
    frames = [skin.update({"force": rows[k], "proximity": near[k]}, 0.004 * k + 1.7e9) for k in range(60)]
    unknown = skin.update(np.zeros(3), 1.7e9 + 1)
    assert len(frames[52].contacts) > 1 and frames[52].stands and "not_finite" in frames[52].flags
    assert frames[45].touched is False and unknown.touched is None and unknown.problem
    checksum = skin.checksum
    return [
        ("TaxelLayout", layout_message(sole, skin, 1.5)),
        ("TaxelLayout", layout_message(small_calibration(), Skin(small_calibration()), is_virtual=True)),
        ("SkinReading", reading_message("left_sole", rows[51].astype(np.uint16), -0.25, 2**63, 7, checksum)),
        ("SkinReading", reading_message("left_sole", near[52], 12.000000001, 4, quantity="proximity")),
        *(("SkinFrame", frame_message("left_sole", f, k, 1, checksum)) for k, f in enumerate([*frames[44:], unknown])),
        ("SkinFrame", frame_message("left_sole", frames[52], 1, with_forces=False)),
    ]


def rosbags_store():
    """Return the types of our definitions in rosbags."""
    typesys = pytest.importorskip("rosbags.typesys", reason="rosbags is not installed: pip install rosbags")
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    for kind in (*OF_ROS, *(f"{PACKAGE}/{name}" for name in NAMES)):
        store.register(typesys.get_types_from_msg(text_of(kind), kind.replace("/", "/msg/")))
    return store


def rosbags_reader():
    """Return a function that reads bytes with rosbags, from our definitions alone."""
    store = rosbags_store()
    return lambda name, data: store.deserialize_cdr(data, f"{PACKAGE}/msg/{name}")


def mcap_ros2_reader():
    """Return a function that reads bytes with mcap-ros2-support, from the definition in an MCAP file."""
    why = "mcap-ros2-support is not installed: pip install mcap-ros2-support"
    factory = pytest.importorskip("mcap_ros2.decoder", reason=why).DecoderFactory()

    def read(name, data):
        kind = f"{PACKAGE}/msg/{name}"
        schema = SimpleNamespace(id=NAMES.index(name), name=kind, encoding="ros2msg", data=schema_text(name).encode())
        return factory.decoder_for("cdr", schema)(data)

    return read


def assert_same(given, found, kind=f"{PACKAGE}/SkinFrame", where=""):
    """Compare what was written with what a reader found, value by value, to the last digit; NaN equals NaN."""
    for field in fields_of(kind):
        place = f"{where}.{field.name}"
        ours, theirs = given[field.name], getattr(found, field.name)
        if field.kind not in PRIMITIVES:
            many = field.length is not None
            assert not many or len(ours) == len(theirs), place
            for one, other in zip(ours, theirs) if many else [(ours, theirs)]:
                if isinstance(one, np.ndarray):
                    assert_array_equal(one, doubles(other), place)
                else:
                    assert_same(one, other, field.kind, place)
        elif field.length is None:
            assert ours == theirs or (math.isnan(ours) and math.isnan(theirs)), place
        elif field.kind == "string":
            assert list(ours) == list(theirs), place
        else:
            assert_array_equal(ours, theirs, place)


def doubles(message):
    """Return the doubles of a point, a vector or a wrench."""
    if hasattr(message, "force"):
        return doubles(message.force) + doubles(message.torque)
    return [message.x, message.y, message.z]


@pytest.mark.parametrize("reader", [rosbags_reader, mcap_ros2_reader])
def test_independent_readers_get_every_value(reader, messages):
    """All fields of all messages; a reader that takes another alignment would get other numbers."""
    read = reader()
    for name, message in messages:
        assert_same(message, read(name, encode(name, message)), f"{PACKAGE}/{name}", name)


def test_bytes_are_those_of_rosbags(messages):
    """The other direction: what rosbags read gives the same bytes when it writes."""
    store = rosbags_store()
    for name, message in messages:
        data = encode(name, message)
        found = store.deserialize_cdr(data, f"{PACKAGE}/msg/{name}")
        assert bytes(store.serialize_cdr(found, f"{PACKAGE}/msg/{name}")) == data


def test_own_reader_gives_what_was_written(messages):
    """Reading and writing again gives the same bytes."""
    for name, message in messages:
        data = encode(name, message)
        assert encode(name, decode(name, data)) == data


def test_truncated_and_damaged_bytes_are_refused(messages):
    """Each shorter message is an error, never another message; lengths are checked before memory is used."""
    for name, message in messages[:6]:
        data = encode(name, message)
        for end in {*range(0, len(data), 7), len(data) - 1}:
            with pytest.raises(CalibrationFormatError, match=f"a {name} (is damaged|does not begin)"):
                decode(name, data[:end])
        with pytest.raises(CalibrationFormatError, match="8 bytes more than its definition"):
            decode(name, data + bytes(8))
    rng = np.random.default_rng(0)
    for name, message in messages:
        data = bytearray(encode(name, message))
        for at in rng.integers(4, len(data), 30):
            damaged = data.copy()
            damaged[at] ^= 0xFF
            try:
                decode(name, bytes(damaged))
            except CalibrationFormatError as error:
                assert name in str(error)


def test_content_is_that_of_the_frame(sole):
    """Values where they belong; what is not known is NaN with a statement next to it."""
    skin = Skin(sole, 0.2)
    pressed = skin.update(np.where(np.arange(N) < 9, 50.0, 0.0), 0.5)
    found = decode("SkinFrame", encode("SkinFrame", frame_message("left_sole", pressed, 3, 2, skin.checksum)))
    assert found["header"] == {"stamp": {"sec": 0, "nanosec": 500_000_000}, "frame_id": "left_sole"}
    assert (found["cycle"], found["lost"], found["calibration"]) == (3, 2, skin.checksum)
    assert found["touched"] and found["touched_known"] and found["trusted"] and found["stands"]
    assert_array_equal(found["cop"], pressed.cop)
    assert_array_equal(np.column_stack((found["outer"]["x"], found["outer"]["y"])), pressed.polygon.outer.corners)
    assert found["contacts"][0]["taxels"].tolist() == list(range(9)) and np.isnan(found["cop_sigma"]).all()
    bad = skin.update(np.zeros(3), 0.6)
    found = decode("SkinFrame", encode("SkinFrame", frame_message("left_sole", bad, 4)))
    assert not (found["touched"] or found["touched_known"] or found["trusted"] or found["stands"])
    assert found["flags"] == ["wrong_length"] and "needs 42" in found["problem"] and np.isnan(found["wrench"]).all()
    assert np.isnan(found["forces"]).all() and np.isnan(found["load"])
    layout = decode("TaxelLayout", encode("TaxelLayout", layout_message(sole, skin)))
    assert (layout["thresholds"] == 0.2).all() and layout["has_ground"] and not layout["is_virtual"]
    for name, field in (
        ("positions", "positions"),
        ("normals", "normals"),
        ("areas", "areas"),
        ("channels", "channels"),
    ):
        assert_array_equal(layout[name], getattr(skin, field))
    taxels = sole.patches[0].taxels
    assert_array_equal(layout["tangents"], taxels.tangents_link)
    assert_array_equal(np.column_stack([layout[f"sigma_{s}"] for s in ("along", "normal", "angle")]), taxels.sigma)


def test_thresholds_are_those_of_the_noise(sole):
    """After a tare without thresholds of the caller."""
    skin = Skin(sole)
    assert (skin.thresholds == 0.2).all()
    skin.tare(np.rint(np.random.default_rng(1).normal(20, 2, (40, N))), accept=True)
    assert_array_equal(layout_message(sole, skin)["thresholds"], skin.noise.detection_limits)
    fixed = Skin(sole, 0.3)
    fixed.tare(np.rint(np.random.default_rng(1).normal(20, 2, (40, N))), accept=True)
    assert (fixed.thresholds == 0.3).all()


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.uint16, np.int64, np.float32, float])
def test_readings_stay_whole_numbers(dtype):
    """The runtime treats whole numbers in another manner; numbers beyond 32 bits are exact, too."""
    row = np.array([0, 3, 100], dtype)
    message = decode("SkinReading", encode("SkinReading", reading_message("a", row, 0.1, 1)))
    time, found = reading_of(message)
    assert time == 0.1 and found.tolist() == row.tolist()
    assert (found.dtype.kind == "i") == np.issubdtype(dtype, np.integer)
    large = reading_of(reading_message("a", np.array([2**32 - 1], np.uint32), 0.1, 1))[1]
    assert large.tolist() == [2.0**32 - 1]


def test_times_keep_nine_decimals():
    """A stamp has nanoseconds; other times are refused."""
    for time in (0.0, 0.004, -0.25, 12.000000001, 0.1 + 0.2, 86400.123456789, -1e-9, 1.7e9 + 0.004):
        ns = nanoseconds(time)
        assert abs(ns - Fraction(time) * 10**9) <= 0.5 and seconds(
            {"sec": ns // 10**9, "nanosec": ns % 10**9}
        ) == round(time, 9)
    for time in (math.nan, math.inf, 2.0**31, 1.7e18):
        with pytest.raises(InvalidReading, match="give a finite time in seconds"):
            nanoseconds(time)


def test_values_that_do_not_fit_are_refused():
    """No number is cut off."""
    message = reading_message("a", np.zeros(3), 0.1, 1)
    for wrong in ({"cycle": -1}, {"counts": np.array([2**40])}, {"counts": np.array([0.5])}, {"quantity": "a\0b"}):
        with pytest.raises((ValueError, struct.error), match="fit|zero|cycle|range|format"):
            encode("SkinReading", message | wrong)
    with pytest.raises(ValueError, match="cop has 3 numbers, not 2"):
        encode(
            "SkinFrame",
            frame_message("a", Skin(small_calibration()).update(np.zeros(8), 0.0), 1) | {"cop": np.zeros(3)},
        )


def test_definitions_follow_the_rules():
    """Kinds of fields that older readers know, no keyword of IDL, all files in the build, a comment for each field."""
    assert {path.stem for path in FOLDER.glob("*")} == {*NAMES}
    build = (FOLDER.parent / "CMakeLists.txt").read_text()
    assert f"<version>{__version__}</version>" in (FOLDER.parent / "package.xml").read_text()
    assert re.findall(r"msg/(\w+)\.msg", build) == sorted(NAMES)
    keywords = {"sequence", "switch", "default", "context", "home", "union", "local", "object", "port", "native", "any"}
    for name in NAMES:
        fields = fields_of(f"{PACKAGE}/{name}")
        lines = [line for line in text_of(f"{PACKAGE}/{name}").splitlines() if line and not line.startswith("#")]
        assert len(fields) == len(lines)
        for field in fields:
            assert re.fullmatch("[a-z][a-z0-9_]*", field.name) and field.name not in keywords
            assert field.kind in (
                *({*PRIMITIVES} - {"float32", "uint8"}),
                *OF_ROS,
                *(f"{PACKAGE}/{other}" for other in NAMES),
            )


def test_messages_of_ros_are_those_of_ros():
    """Compared with the definitions that rosbags has of a ROS 2 release."""
    typesys = pytest.importorskip("rosbags.typesys", reason="rosbags is not installed: pip install rosbags")
    known = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE).fielddefs
    for kind in OF_ROS:
        assert [f.name for f in fields_of(kind)] == [name for name, _ in known[kind.replace("/", "/msg/")][1]]
        again = typesys.get_types_from_msg(text_of(kind), kind.replace("/", "/msg/"))
        assert again[kind.replace("/", "/msg/")][1] == known[kind.replace("/", "/msg/")][1]
