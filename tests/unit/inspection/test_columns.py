"""Columns of a recording: which are the time and the channels of a skin, and which are none."""

import pytest

from skin_calib_addon.inspection.columns import ColumnsError, match_columns

IDS = [f"Sole.0.{k}" for k in range(12)]
NUMBERS = [str(k) for k in range(13)]


def columns_of(header, channels=range(12)):
    """Return the names of the columns of all channels, and the text."""
    found = match_columns(header, IDS, list(channels))
    return [header[k] for k in found.channels.values()], found.text


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ([f"taxel{k}" for k in NUMBERS[:12]], "taxel0 to taxel11 are channels 0 to 11"),
        ([f"taxel{k}" for k in NUMBERS[1:]], "taxel1 to taxel12 are channels 0 to 11, counted from 1"),
        ([f"S_{k} [N]" for k in NUMBERS[:12]], "s_0 [n] to s_11 [n] are channels 0 to 11"),
        (IDS, "sole.0.0 to sole.0.11 are channels 0 to 11, by the ids of the taxels"),
    ],
)
def test_numbers_and_ids_decide_in_any_order(names, expected):
    """The columns are found in the order of their numbers, of their text, and backwards, among columns of others."""
    for order in (names, sorted(names), names[::-1]):
        header = ["frame", *order[:5], "Time", *order[5:], "Total", "temp1"]
        assert columns_of(header) == (names, f"{expected}; not used: frame, total, temp1")


def test_columns_without_numbers_count_by_their_order():
    """Their number must be that of the channels, without those whose names say that they are none."""
    names = [f"cell {letter}" for letter in "abcdefghijkl"]
    text = "cell a to cell l are channels 0 to 11, in their order"
    assert columns_of(["time", *names]) == (names, text)
    assert columns_of(["time", "", *names, "sum"])[1] == f"{text}; not used: a column without a name, sum"
    sides = [f"{side}{k}" for side in ("left", "right") for k in range(1, 7)]
    assert columns_of(["time", *sides])[0] == sides


def test_channels_of_other_skins_are_not_used():
    """A table may have the readings of several links."""
    names = [f"s{k}" for k in range(40)]
    found = match_columns(["time", *names], IDS, list(range(20, 32)))
    assert found.text.startswith("s20 to s31 are channels 20 to 31; not used: s0, s1, ")
    assert found.channels[20] == 21


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ([*"abcdefghijkl", "fz"], "has 13 columns for the 12 channels of the skin: a, b, c, d, e and 8 more. Name"),
        ([*NUMBERS[:11], "fz"], "has 1 column without a number among numbered ones: fz"),
        ([f"s{k}" for k in NUMBERS[:11]], "has 11 columns for the 12 channels"),
        ([*(f"s{k}" for k in NUMBERS[:11]), "total"], "has 11 columns for the 12 channels"),
        ([f"s{k}" for k in range(1, 14)], "has 13 columns for the 12 channels"),
        ([f"s{k}" for k in (*range(11), 12)], 'has columns "s#" without the number 11'),
        ([f"{side}{k}" for k in range(6) for side in "ba"][::-1], 'has columns "a#" that are not in the order of'),
        ([f"{name}{k}" for name in "st" for k in range(12)], 'has 2 sets of columns that fit the channels: "s#", "t#"'),
        (IDS[1:], "has no column for 1 taxel: Sole.0.0"),
        ([*NUMBERS, "3"], "names 3 twice"),
        ([*NUMBERS, "03"], "has 3 and 03, which have the same number"),
    ],
)
def test_columns_that_do_not_match_are_refused(names, message):
    """What is left over could be a channel, or a channel is missing."""
    with pytest.raises(ColumnsError, match=message):
        columns_of(["time", *names])


@pytest.mark.parametrize(
    ("name", "seconds"),
    [("t", 1), ("TimeStamp", 1), ("time_ms", 1e-3), ("Time [us]", 1e-6), ("millis", 1e-3), ("stamp_ns", 1e-9)],
)
def test_time_has_its_usual_names(name, seconds):
    """A unit in the name counts. The name ``time`` wins over others."""
    found = match_columns([*NUMBERS[:12], name], IDS, list(range(12)))
    assert (found.time, found.seconds) == (12, seconds)
    assert f"is the time [{seconds:g} s]; 0 to 11" in found.text
    both = match_columns([name, *NUMBERS[:12], "time"], IDS, list(range(12)))
    assert both.time == 13 and both.text == f"0 to 11 are channels 0 to 11; not used: {name.lower()}"


def test_missing_or_ambiguous_time_is_refused():
    """A channel t0 is no time."""
    names = [f"t{k}" for k in range(12)]
    with pytest.raises(ColumnsError, match="has no time; it has"):
        columns_of(names)
    with pytest.raises(ColumnsError, match="has 2 times: stamp_sec, stamp_ns"):
        columns_of(["stamp_sec", "stamp_ns", *names])
