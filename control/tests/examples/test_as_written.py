"""The rules of the thesis as they are written."""

import numpy as np
import pytest
from sole_frames import frame_of


def test_written_rule_plans_at_the_first_polygon_after_the_contact_and_limits_to_the_present_one():
    """Cells have their size; in the air the full sole is expected again."""
    from as_written import WrittenFoothold
    from biped import skins
    from foothold import full_sole

    from skin_calib_addon.runtime import Skin

    foothold, flat = WrittenFoothold(Skin(skins()["sole"])), np.zeros(2)
    x = foothold.places[:, 0]
    assert foothold.inside.all()  # the plan does not wait
    assert not foothold.update(frame_of(foothold, x > 1.0), flat) and foothold.area.area == full_sole().area
    assert foothold.update(frame_of(foothold, x > 0.075), flat)
    np.testing.assert_allclose(foothold.area.bounds, ((0.075, -0.045), (0.095, 0.045)), atol=1e-6)
    assert not foothold.update(frame_of(foothold, x > -1.0), flat)
    np.testing.assert_allclose(foothold.centroid, (0.085, 0.0), atol=1e-6)
    assert foothold.area.area == pytest.approx(full_sole().area)
    foothold.lift()
    np.testing.assert_allclose(foothold.centroid, (0.0, 0.0), atol=1e-9)


def test_written_rule_for_landings_ends_the_swing_by_the_virtual_wrench_and_then_uses_the_felt_one():
    """A sole 2 mm above the ground, and one that stands; the springs of the walker end no swing."""
    from as_written import STOP, WrittenProximity
    from biped import skins
    from estimator import SOLE_CENTRE
    from shapes import RANGE, RANGE_COUNTS
    from walker import Proximity

    from skin_calib_addon.runtime import Skin
    from skin_calib_addon.runtime.wrench import about

    skin, written, springs = Skin(skins()["sole"], switch_on=2.0), WrittenProximity(), Proximity()
    near = np.full(skin.reading_length, round(RANGE_COUNTS * (1 - 0.002 / RANGE)))
    air = skin.update({"force": np.zeros(skin.reading_length), "proximity": near}, 0.0)
    virtual = springs.wrench(skin, air, SOLE_CENTRE)
    np.testing.assert_array_equal(written.wrench(skin, air, SOLE_CENTRE), virtual)
    assert virtual[2] > STOP and written.stops(virtual) and not springs.stops(virtual)
    assert not written.stops(virtual * STOP / virtual[2] * 0.99)
    stands = skin.update({"force": np.full(skin.reading_length, 200.0), "proximity": near}, 0.004)
    felt = written.wrench(skin, stands, SOLE_CENTRE)
    np.testing.assert_array_equal(felt, about(stands.wrench, SOLE_CENTRE))
    assert stands.touched and felt[2] > 2 * virtual[2]


@pytest.mark.slow
def test_written_rule_for_footholds_makes_the_robot_fall_on_flat_ground():
    """The ZMP is planned at the edge that touches first; landings by the written rule stay soft."""
    from as_written import cases_of, run, texts

    (walk,), (landing,) = (
        [run(case) for case in cases_of(name, "thesis", range(1))] for name in ("flat ground", "flat")
    )
    assert not walk.stands and walk.steps < 3
    stands, impacts = landing
    assert stands and len(impacts) == 3 and max(impact.force for impact in impacts) < 250
    assert texts("flat", [landing])[:2] == ("1/1", "3.0")
