"""The skins of a plan: every kind there and back, what does not go together, and the channels they take."""

import copy

import pytest

from skin_calib_addon.calibration.model import MAX_CHANNEL
from skin_calib_addon.common.errors import InvalidPlan
from skin_calib_addon.plan.document import skins_from, write_skin
from skin_calib_addon.plan.skins import (
    first_channels,
    with_channels,
)

SHEET = {
    "name": "band",
    "kind": "sheet",
    "rows": 6,
    "columns": 22,
    "pitch": [0.01, 0.012],
    "origin": [0.0, 0.1, 0.2],
    "direction": [0.0, 1.0, 0.0],
    "hand": "left",
    "trim": True,
    "offset": 0.001,
    "first_channel": 7,
}
MARKED = {k: v for k, v in SHEET.items() if k != "origin"} | {
    "name": "marked",
    "first_channel": 200,
    "landmarks": [{"cell": [0, 0], "point": [0.0, 0.1, 0.2]}, {"cell": [5, 21], "point": [0.1, 0.0, 0.2]}],
}
BOARDS = {
    "name": "sole",
    "kind": "hexagons",
    "side": 0.012,
    "gap": 0.001,
    "cells": [[0, 0], [1, 0], [-1, 2, 0.0012, -0.003, 0.25]],
    "origin": "center",
    "direction": [1.0, 0.0, 0.0],
    "offset": -0.002,
    "excluded": [{"point": [0.0, 0.0, 0.1], "radius": 0.004}],
    "first_channel": 400,
}
THIGH = {
    "name": "thigh",
    "kind": "imported",
    "file": "taxels/left_leg_upper.txt",
    "format": "icub",
    "frame": {"rotation": [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], "translation": [0.0, 0.1, 0.0]},
    "snap": True,
    "only": "skin_*",
    "first_channel": 500,
}


@pytest.mark.parametrize("document", [SHEET, MARKED, BOARDS, BOARDS | {"cells": "all"}, THIGH])
def test_skin_comes_back_as_it_was_written(document):
    """Every member of every kind."""
    (skin,) = skins_from([copy.deepcopy(document)])
    assert write_skin(skin) == document
    assert skins_from([write_skin(skin)]) == (skin,)


@pytest.mark.parametrize(
    ("document", "message"),
    [
        (MARKED | {"origin": "center"}, 'Give exactly one of "origin" and "landmarks" in skin \'marked\''),
        (
            {k: v for k, v in SHEET.items() if k != "origin"},
            'Give exactly one of "origin" and "landmarks" in skin \'band\'',
        ),
        (
            MARKED | {"landmarks": [{"cell": [6, 0], "point": [0, 0, 0]}]},
            r"landmark at cell \[6, 0\], but the sheet has 6 x 22 cells",
        ),
        (
            MARKED | {"rows": 22, "columns": 6, "landmarks": [{"cell": [0, 6], "point": [0, 0, 0]}]},
            r"landmark at cell \[0, 6\], but the sheet has 22 x 6 cells",
        ),
        (BOARDS | {"cells": [[0, 0], [0, 0]]}, "Skin 'sole' lists a cell twice"),
        (BOARDS | {"cells": [[0, 0], [0, 0, 0.001, 0, 0]]}, "Skin 'sole' lists a cell twice"),
        (BOARDS | {"cells": [[0, 0], [1, 0, 0.001]]}, r"Skin 'sole' has a board of 3 numbers, \[1, 0, 0.001\]"),
        (BOARDS | {"direction": [0, 0, 0]}, "The direction of skin 'sole' is zero"),
        (BOARDS | {"gap": -0.03}, "hexagons with sides of 12 mm and gaps of -30 mm have no area or no pitch"),
    ],
)
def test_what_does_not_go_together_is_refused(document, message):
    """With the skin, and what to do."""
    with pytest.raises(InvalidPlan, match=message):
        skins_from([document])


def test_channels_follow_what_is_known_and_wait_for_what_is_not():
    """After a skin that is not placed yet the channel is unknown; then skins with a common channel are named."""
    skins = skins_from(
        [BOARDS | {"cells": "fill", "first_channel": 0}, {k: v for k, v in SHEET.items() if k != "first_channel"}]
    )
    assert [skin.first_channel for skin in with_channels(skins)] == [0, None]
    assert first_channels(skins, [42, 132]) == [0, 42]
    held = skins_from([BOARDS | {"cells": "fill", "first_channel": 0}, SHEET | {"first_channel": 40}])
    with pytest.raises(InvalidPlan, match="Skins 'sole' and 'band' both have channel 40. Change the first channel"):
        first_channels(held, [42, 132])


def test_last_channel_of_a_skin_may_be_the_highest():
    """A sheet of 132 cells may end on the highest channel of 32 bits, and not one beyond it."""
    (first,) = first_channels(skins_from([SHEET | {"first_channel": MAX_CHANNEL - 131}]), [132])
    assert first == MAX_CHANNEL - 131
    with pytest.raises(InvalidPlan, match=f"Skin 'band' would end on channel {MAX_CHANNEL + 1}; the highest is"):
        first_channels(skins_from([SHEET | {"first_channel": MAX_CHANNEL - 130}]), [132])


@pytest.mark.parametrize(
    ("stated", "gap"), [({}, -0.00048), ({"side": 0.008}, 0.0), ({"side": 0.008, "gap": 1e-3}, 1e-3)]
)
def test_boards_of_another_side_have_no_gap_of_tum(stated, gap):
    """That of TUM is negative: smaller boards with it would overlap."""
    (skin,) = skins_from([{"name": "sole", "kind": "hexagons"} | stated])
    assert skin.lattice.spacing == pytest.approx(gap, abs=1e-5)
