"""The simulated biped: its kinematics, its plan, what it feels, and short versions of its experiments."""

import importlib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

for package in ("mujoco", "tqdm", "PIL", "matplotlib", "qpsolvers"):
    pytest.importorskip(package, reason=f"the package {package} is not installed: pip install '.[control]'")

pytestmark = pytest.mark.usefixtures("scripts")


def test_each_table_has_a_place_in_its_page():
    """``--write`` replaces what is between two marks."""
    from experiment import ARM_PAGE, PAGE, ROOT

    pages = {page: page.read_text("utf-8") for page in (PAGE, ARM_PAGE)}
    scripts = {path.name: path.read_text("utf-8") for path in (ROOT / "examples/control").glob("*.py")}
    scripts = {name: text for name, text in scripts.items() if "report(given," in text}
    assert len(scripts) > 5
    for name, text in scripts.items():
        page = pages[ARM_PAGE if "page=ARM_PAGE" in text else PAGE]
        before, found, after = page.partition(f"<!-- begin of the table of {name} -->\n")
        assert found and after.lstrip().startswith("|") and f"<!-- end of the table of {name} -->\n" in after, name


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("no table", "has no line <!-- begin of the table of beam.py -->"),
        ("<!-- begin of the table of beam.py -->\nrest", "has no line <!-- end of the table of beam.py -->"),
        (None, "No such file or directory"),
    ],
)
def test_page_without_a_place_for_the_table_stops_before_the_runs(text, problem, tmp_path):
    """The rest of the page after a missing end was lost."""
    from experiment import run_all

    page = tmp_path / "page.md"
    if text is not None:
        page.write_text(text)
    with pytest.raises(SystemExit, match=problem):
        run_all(pytest.fail, [0], SimpleNamespace(write=True, page=page, name="beam", jobs=1))
    assert text is None or page.read_text() == text


@pytest.mark.parametrize(
    ("script", "words", "problem"),
    [
        ("landing", "--seeds 0", "--seeds: '0' is not a whole number of at least 1"),
        ("wrenches", "--seeds 0", "--seeds: '0' is not a whole number of at least 1"),
        ("balance", "--jobs -1", "--jobs: '-1' is not a whole number of at least 1"),
        ("faults", "--steps 0", "--steps: '0' is not a whole number of at least 1"),
        ("g1_landing", "--steps 1.5", "--steps: '1.5' is not a whole number of at least 1"),
        ("beam", "--width -0.1", "--width: '-0.1' is not a number above 0"),
        ("landing", "--speed nan", "--speed: 'nan' is not a number above 0"),
        ("footholds", "--out {file}/out", "--out: cannot write to the folder {file}/out: Not a directory"),
        ("g1", "--urdf {file}", "--urdf: {file} is not an XML file"),
        ("g1", "--urdf {other}", "--urdf: {other} is not the URDF of a G1: it has no link 'left_ankle_roll_link'"),
        ("g1_arm", "--urdf {file}.urdf", "--urdf: cannot read {file}.urdf: No such file"),
        ("rates", "--no-animation", "unrecognized arguments: --no-animation"),
        ("as_written", "--no-animation", "unrecognized arguments: --no-animation"),
    ],
)
def test_bad_option_is_one_message(script, words, problem, tmp_path, monkeypatch, capsys):
    """The exit code is 2, and nothing is simulated."""
    file, other = tmp_path / "file", tmp_path / "other.urdf"
    file.write_text("no XML")
    other.write_text("<robot name='other'><link name='pelvis'/></robot>")
    names = {"file": file, "other": other}
    monkeypatch.setattr("sys.argv", [f"{script}.py", *words.format(**names).split()])
    module = importlib.import_module(script)
    monkeypatch.setattr(module, "run_all", lambda *_: pytest.fail("the experiment runs"))
    with pytest.raises(SystemExit) as ended:
        module.main()
    assert ended.value.code == 2 and problem.format(**names) in capsys.readouterr().err


@pytest.mark.parametrize("bears", [0.5, 3.2, 7.9, 10.6, 20.0, 33.3])
def test_search_finds_the_largest_push_however_large_it_is(bears):
    from balance import largest_push

    found = largest_push(lambda impulse: impulse <= bears, first=8.0, resolution=1.0)
    assert found <= bears < found + 1


def test_landing_is_on_the_obstacle_with_the_whole_sole_or_not_at_all():
    """Places that the steps lead to, moved by up to 2 cm; a fifth step would meet a part of it."""
    from estimator import SOLE_CENTRE
    from landing import OBSTACLE_STEPS, STEP, WIDTH, Impact
    from walker import forward_steps

    def meets(steps, off=(0.0, 0.0)):
        at = (np.append(step.centre + off, 0.0) - SOLE_CENTRE for step in forward_steps(steps, STEP, WIDTH))
        landings = [Impact(100.0, 0.3, 0.8, place) for place in at]
        return [i.is_on_obstacle for i in landings], [i.is_whole for i in landings]

    for off in np.random.default_rng(4).uniform(-0.02, 0.02, (20, 2)):
        assert meets(OBSTACLE_STEPS, off) == ([False, False, True, False],) * 2
    on, whole = meets(OBSTACLE_STEPS + 1)
    assert on[4] and not whole[4]


def test_angles_of_the_legs_agree_with_the_simulator():
    import mujoco
    from biped import FEET, nominal
    from legs import joint_angles, rotation

    model, rng = nominal(), np.random.default_rng(0)
    data = mujoco.MjData(model)
    for _ in range(20):
        pelvis, turn = rng.normal(0, 0.02, 3), rotation(2, rng.normal(0, 0.2)) @ rotation(0, rng.normal(0, 0.1))
        feet = {}
        for foot, y in zip(FEET, (0.1, -0.1)):
            pitch = rotation(1, rng.normal(0, 0.1)) @ rotation(0, rng.normal(0, 0.1))
            feet[foot] = (np.array((0, y, -0.6)) + rng.normal(0, 0.03, 3), pitch)
        data.qpos[:3] = pelvis
        mujoco.mju_mat2Quat(data.qpos[3:7], turn.ravel())
        data.qpos[7:19] = joint_angles(pelvis, turn, feet)
        mujoco.mj_kinematics(model, data)
        for foot, (position, orientation) in feet.items():
            body = data.body(f"{foot}_foot")
            assert np.abs(body.xpos - position).max() < 1e-9
            assert np.abs(body.xmat.reshape(3, 3) - orientation).max() < 1e-9


def test_reference_of_the_dcm_obeys_the_pendulum():
    """Its derivative is omega (dcm - zmp) (thesis eq. 4.12), it is continuous, and it ends at the last point."""
    from zmp_plan import ZmpPlan

    rng, omega, step = np.random.default_rng(1), 3.8, 1e-5
    plan = ZmpPlan([0, 1, 1.9, 2.2, 3.1], rng.normal(0, 0.1, (5, 2)), omega)
    for time in rng.uniform(0, 3.09, 50):
        now, after = plan.at(time), plan.at(time + step)
        middle = plan.at(time + step / 2)
        np.testing.assert_allclose((after.dcm - now.dcm) / step, omega * (middle.dcm - middle.zmp), atol=1e-6)
    np.testing.assert_allclose(plan.at(9.0).dcm, plan.points[-1])


def test_largest_foothold_agrees_with_brute_force():
    from biped import skins
    from foothold import Foothold

    from skin_calib_addon.runtime import Skin

    foothold, rng = Foothold(Skin(skins()["sole"])), np.random.default_rng(2)
    for _ in range(5):
        foothold.void = rng.random(len(foothold.places)) < 0.03
        area, cells = foothold._rectangle(), (len(foothold.xs), len(foothold.ys))
        assert not any(area.contains(place) for place in foothold.places[foothold.void])
        largest, grid = 0, np.zeros(cells, bool)
        grid[foothold.column[foothold.void], foothold.row[foothold.void]] = True
        for a in range(cells[0]):
            for b in range(a + 1, cells[0] + 1):
                for c in range(cells[1]):
                    for d in range(c + 1, cells[1] + 1):
                        largest = max(largest, (b - a) * (d - c) * (not grid[a:b, c:d].any()))
        assert sum(area.contains(place) for place in foothold.places) == largest


def frame_of(foothold, pressed, force=10.0):
    """What a foothold reads of a frame, with the same force on each pressed cell."""
    sets = SimpleNamespace(active=pressed, possible=pressed)
    return SimpleNamespace(
        known=np.ones(len(pressed), bool), sets=sets, load=force * pressed.sum(), forces=force * pressed
    )


def see(foothold, pressed, slope):
    """Give a foothold a frame twice, as a foot that stands does."""
    for _ in range(2):
        foothold.update(frame_of(foothold, pressed), slope)


def test_cell_that_is_active_in_one_frame_only_is_not_pressed():
    """Noise over a pit does not make the foothold larger."""
    from biped import skins
    from foothold import Foothold

    from skin_calib_addon.runtime import Skin

    foothold = Foothold(Skin(skins()["sole"]))
    x, ahead = foothold.places[:, 0], np.array((-0.01, 0.0))
    see(foothold, x < 0.015, ahead)
    for _ in range(foothold.frames):
        foothold.update(frame_of(foothold, np.abs(x) < 0.011), ahead)
    void, bounds = foothold.void.copy(), foothold.area.bounds
    assert void.any()
    noisy = np.abs(x) < 0.011
    cells = np.flatnonzero(void)[:2]
    noisy[cells] = True
    foothold.update(frame_of(foothold, noisy), ahead)
    foothold.update(frame_of(foothold, np.abs(x) < 0.011), ahead)
    np.testing.assert_array_equal(foothold.void, void)
    np.testing.assert_array_equal(foothold.area.bounds, bounds)
    see(foothold, noisy, ahead)
    assert not foothold.void[cells].any()


def test_foothold_ends_at_the_line_about_which_the_sole_turns():
    """First the inner half is pressed, then only the row at its edge: the cells beyond are void, and no others."""
    from biped import skins
    from foothold import Foothold

    from skin_calib_addon.runtime import Skin

    foothold = Foothold(Skin(skins()["sole"]))
    inner, edge = foothold.places[:, 1] > -0.001, np.abs(foothold.places[:, 1]) < 0.001
    ends = np.abs(foothold.places[:, 0]) > 0.05  # what is between them is in the hull of the pressed cells
    outward = np.array((0.0, 0.01))  # the outer side is lower
    see(foothold, inner & ends, outward)
    for _ in range(foothold.frames):
        foothold.update(frame_of(foothold, edge & ends), outward)
    assert (foothold.void[foothold.places[:, 1] < -0.001]).all() and not foothold.void[inner].any()
    assert foothold.area.bounds[0][1] == pytest.approx(-0.005) and foothold.area.contains((-0.09, 0.04))


def test_sole_that_rolls_on_full_ground_has_no_void_cells():
    """Three rows at the edge are pressed at the landing, then the outermost one alone."""
    from biped import skins
    from foothold import Foothold

    from skin_calib_addon.runtime import Skin

    foothold = Foothold(Skin(skins()["sole"]))
    see(foothold, foothold.places[:, 1] > 0.015, np.array((0.0, -0.01)))
    for _ in range(2 * foothold.frames):
        foothold.update(frame_of(foothold, foothold.places[:, 1] > 0.035), np.array((0.0, -0.01)))
    assert not foothold.void.any()


def test_silent_cell_that_is_higher_than_the_pressed_ones_is_no_evidence():
    """The front edge of the ground carries most of the load: cells ahead of it are void, those that hover are not."""
    from biped import skins
    from foothold import Foothold

    from skin_calib_addon.runtime import Skin

    foothold = Foothold(Skin(skins()["sole"]))
    x, y = foothold.places.T
    pressed = (np.abs(x + 0.04) < 0.031) & (y > -0.001)  # the sole is lower ahead, and on the side of y > 0
    frame = frame_of(foothold, pressed)
    frame.forces = pressed * (20.0 + 300.0 * x)
    for _ in range(foothold.frames + 1):
        foothold.update(frame, np.array((-0.005, -0.007)))
    hovers = (x < -0.005) & (y < -0.005)
    assert foothold.void[(x > 0.005) & (y > -0.001)].all() and not foothold.void[hovers].any()


def test_next_foothold_is_expected_to_be_like_the_last_one():
    """The void cells stay void while the foot is in the air; on other ground they are found to be solid."""
    from biped import skins
    from foothold import Foothold

    from skin_calib_addon.runtime import Skin

    foothold = Foothold(Skin(skins()["sole"]))
    x, ahead = foothold.places[:, 0], np.array((-0.01, 0.0))  # the sole is lower ahead
    see(foothold, (x > -0.065) & (x < 0.015), ahead)
    for _ in range(foothold.frames):
        foothold.update(frame_of(foothold, np.abs(x) < 0.011), ahead)
    beam = foothold.area.bounds
    assert beam[1][0] == pytest.approx(0.015)
    foothold.lift()
    np.testing.assert_array_equal(foothold.area.bounds, beam)
    assert not foothold.inside.any()
    see(foothold, x > -0.065, ahead)
    assert foothold.area.bounds[1][0] == pytest.approx(0.095)


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


def test_plan_waits_for_a_dcm_that_is_behind_it_and_goes_on_faster_for_one_ahead():
    from walker import Gains, plan_rate
    from zmp_plan import Reference

    gains, omega, rng = Gains(), 3.8, np.random.default_rng(3)
    for _ in range(20):
        zmp, away = rng.normal(0, 0.1, (2, 2))
        reference, aside = Reference(zmp, zmp + away), np.array((-away[1], away[0]))
        assert plan_rate(reference, reference.dcm, omega, gains) == 1.0
        assert plan_rate(reference, reference.dcm + 0.2 * aside, omega, gains) == pytest.approx(1.0)
        fast = plan_rate(reference, reference.dcm + away, omega, gains)
        slow = plan_rate(reference, reference.dcm - away, omega, gains)
        assert 0.0 <= slow < 1.0 < fast <= gains.fastest
    standing = Reference(np.zeros(2), np.zeros(2))
    assert plan_rate(standing, np.array((0.1, 0.0)), omega, gains) == 1.0


def test_step_leaves_an_obstacle_by_the_shortest_shift():
    from replanning import CLEARANCE, shift_off
    from shapes import HALF_SIZE

    from skin_calib_addon.runtime import convex_hull

    def box(low, high):
        return convex_hull([low, high, (low[0], high[1]), (high[0], low[1])])

    middle, ahead = box((-0.04, -0.03), (0.03, 0.03)), box((0.05, -0.03), (0.09, 0.03))
    np.testing.assert_allclose(shift_off(middle, "right"), (0.0, -0.03 - CLEARANCE - HALF_SIZE[1]))
    np.testing.assert_allclose(shift_off(middle, "left"), -shift_off(middle, "right"))
    np.testing.assert_allclose(shift_off(ahead, "right"), (0.05 - CLEARANCE - HALF_SIZE[0], 0.0))


def test_diagram_has_zmp_and_dcm_of_each_walk(tmp_path):
    """Two robots that stand for a few cycles."""
    from biped import Biped
    from diagrams import LINES, draw_walks
    from walker import Walker

    walkers = []

    def stand(each):
        robot = Biped(proximity=False)
        walkers.append(Walker(robot, []))
        for _ in range(3):
            robot.step(*walkers[-1].cycle(robot.senses()))
            each(robot, walkers[-1])

    draw_walks({"one": stand, "other": stand}, tmp_path / "diagram.png")
    assert (tmp_path / "diagram.png").stat().st_size > 10_000 and len(walkers) == 2
    row = walkers[0].log.rows[-1]
    low, high = row["limits"]
    assert (low <= row["wanted"]).all() and (row["wanted"] <= high).all() and all(key in row for key, *_ in LINES)


@pytest.mark.slow
def test_standing_robot_feels_its_zmp_and_its_weight():
    from biped import Biped
    from walker import Walker

    robot = Biped()
    walker = Walker(robot, [])
    off = []
    for _ in range(150):
        robot.step(*walker.cycle(robot.senses()))
        off.append(walker.log.rows[-1]["zmp"] - robot.true_zmp())
    felt = walker.log.rows[-1]
    assert np.abs(np.mean(off[-100:], axis=0)).max() < 0.001
    weight = robot.model.body_subtreemass[0] * 9.81
    assert abs(sum(felt["loads"]) / weight - 1) < 0.01


@pytest.mark.slow
def test_proximity_softens_the_landing():
    """Two steps: less than a quarter of the impact, no later contact."""
    from landing import Case, run

    (stands, hard), (stands_too, soft) = (run(Case("flat", near, 2, 0.4, 0)) for near in (False, True))
    assert stands and stands_too and len(hard) == len(soft) == 2
    assert max(i.force for i in soft) < min(i.force for i in hard) / 4
    assert np.mean([i.time for i in soft]) < np.mean([i.time for i in hard]) + 0.02


@pytest.mark.slow
def test_walker_needs_the_five_members_that_the_page_states():
    """The robot is hidden behind them; it begins to lift a foot."""
    from biped import Biped
    from walker import Walker, forward_steps

    robot = Biped(proximity=False)
    names = ("body", "start", "period", "senses", "step")
    walker = Walker(SimpleNamespace(**{name: getattr(robot, name) for name in names}), forward_steps(1, 0.15, 0.18))
    while robot.data.time < 1.5:
        robot.step(*walker.cycle(robot.senses()))
    assert walker.swing_foot == "right" and not robot.fallen


def test_robot_walks_at_1_khz_and_feels_its_zmp():
    """The felt ZMP is compared with the true one of the time of the readings; a step later it is up to 8 mm away."""
    from biped import PERIOD, TIME_STEP
    from rates import cases_of, run

    slow, fast = (run(cases_of("walk", [0], period)[0]) for period in (PERIOD, TIME_STEP))
    assert slow.stands and fast.stands and slow.steps == fast.steps == 2
    assert fast.apart < 0.001 and slow.apart < 0.001


@pytest.mark.slow
def test_table_of_the_rates_has_all_rows():
    """With the shortest runs of each row: it is built from what all experiments return."""
    from rates import PERIODS, ROWS, cases_of, column, run

    assert {name: len(cases_of(name, range(20), PERIODS["1 kHz"])) for name in ROWS}["balance"] == 8
    assert all(case.period == PERIODS["1 kHz"] for name in ROWS for case in cases_of(name, range(20), 1e-3))
    texts = column({name: [run(case) for case in cases_of(name, range(1), PERIODS["250 Hz"])] for name in ROWS})
    assert texts["cone of the felt polygon: stands"] == "1/1" and texts["cone of the full sole: stands"] == "0/1"
    assert texts["balance, full sole: largest push [N s]"] == "10.0"


class _Seen(Exception):
    """Ends a walk after its first cycle."""


@pytest.mark.parametrize("name", ["beam", "replanning"])
def test_walk_has_the_period_of_its_case(name):
    from biped import TIME_STEP

    module = importlib.import_module(name)
    first = {"beam": (True, 0.08, 1), "replanning": ("large block", "what is felt, new steps")}[name]

    def look(robot, walker):
        raise _Seen(robot.period, walker.period, robot.data.time)

    with pytest.raises(_Seen) as seen:
        module.run(module.Case(*first, seed=0, period=TIME_STEP), look)
    assert seen.value.args == (TIME_STEP, TIME_STEP, TIME_STEP)


@pytest.mark.parametrize("period", [4e-3, 1e-3])
def test_fault_of_latency_is_10_ms_at_each_rate_rounded_up_to_a_cycle(period):
    from faults import FAULTS

    fault = FAULTS["10 ms of latency"](0.0, np.random.default_rng(0), period)
    assert 0 <= fault.latency * period - 10e-3 < period


def test_other_experiments_run_with_each_rate_and_the_seeds_of_their_row():
    """All experiments that ran at one rate only have a row; the two rates differ in nothing else."""
    from dataclasses import replace

    from rates import PERIODS
    from rates_others import FEW, LONG, RUNS, cases_of, of_g1, of_robot

    rows, kinds = of_robot() | of_g1(*map(Path, ("g1.urdf", "feet", "arms"))), set()
    for row in rows.values():
        slow, fast = (cases_of(row, 4, period) for period in PERIODS.values())
        assert [[replace(case, period=PERIODS["1 kHz"]) for case in some] for some in slow] == fast
        assert {len(some) for some in fast} <= {LONG, FEW, 4}
        assert {case.period for some in slow for case in some} == {PERIODS["250 Hz"]}
        kinds |= {type(case) for some in fast for case in some}
    assert kinds == set(RUNS)


def test_table_of_the_other_rates_has_the_results_of_each_row(monkeypatch, capsys, tmp_path):
    """With the short runs of the arm; without a G1 there are no rows of it."""
    import rates_others

    arm_rows = {name: row for name, row in rates_others.of_robot().items() if "8 N by" in name}
    monkeypatch.setattr(rates_others, "of_robot", lambda: arm_rows)
    monkeypatch.setattr("rates_others.g1.URDF", tmp_path / "none.urdf")
    monkeypatch.setattr("sys.argv", ["rates_others.py", "--seeds", "1", "--jobs", "1", "--out", str(tmp_path)])
    rates_others.main()
    lines = [line.split("|") for line in capsys.readouterr().out.splitlines() if "8 N by" in line]
    assert len(lines) == 4 and all(line[2].strip() == "1" and "mm/s" in line[3] and "mm/s" in line[4] for line in lines)
    assert any(line[3] != line[4] for line in lines)  # the columns are of different runs


def test_speed_of_a_sole_is_that_of_its_centre():
    """As small motions give it, of a foot that turns; not the one of the frame at the CoM of the robot."""
    import mujoco
    from biped import Biped
    from estimator import SOLE_CENTRE
    from landing import sinking

    robot = Biped(proximity=False)
    foot, speeds, heights = robot.data.body("right_foot"), [], []
    robot.data.qvel[:] = np.random.default_rng(0).normal(0, 0.3, robot.model.nv)
    for _ in range(2):
        mujoco.mj_forward(robot.model, robot.data)
        heights.append(foot.xpos[2] + foot.xmat.reshape(3, 3)[2] @ SOLE_CENTRE)
        speeds.append(sinking(robot, "right_foot", SOLE_CENTRE))
        mujoco.mj_integratePos(robot.model, robot.data.qpos, robot.data.qvel, 1e-5)
    assert abs(speeds[0] - (heights[0] - heights[1]) / 1e-5) < 1e-4 < 0.01 < abs(speeds[0] + foot.cvel[5])


def test_effective_mass_of_a_sole_is_the_force_that_lifts_it_without_turning_it_and_falls_with_the_bend_of_the_knee():
    """The force is that of a robot whose sole is accelerated upward: all equations of motion are solved at once."""
    import mujoco
    from biped import Biped
    from estimator import SOLE_CENTRE
    from impacts import effective_masses

    robot, found = Biped(proximity=False), []
    model, data, n = robot.model, robot.data, robot.model.nv
    for bend in (0.35, 0.7):
        for name, angle in (("hip_pitch", -bend / 2), ("knee", bend), ("ankle_pitch", -bend / 2)):
            data.joint(f"right_{name}").qpos[:] = angle
        mujoco.mj_forward(model, data)
        inertia, jacobian, foot = np.zeros((n, n)), np.zeros((6, n)), data.body("right_foot")
        mujoco.mj_fullM(model, data, inertia)
        mujoco.mj_jac(model, data, jacobian[:3], jacobian[3:], foot.xpos + SOLE_CENTRE, foot.id)
        links = inertia - np.diag(model.dof_armature)
        system = np.block([[links, -jacobian.T], [jacobian, np.zeros((6, 6))]])
        force = np.linalg.solve(system, np.concatenate((np.zeros(n), (0, 0, 1, 0, 0, 0))))[n + 2]
        found.append(effective_masses(robot, "right"))
        assert found[-1][1] == pytest.approx(force) and found[-1][0] > found[-1][1]
    assert found[1][0] < 0.8 * found[0][0] and found[1][1] < 0.8 * found[0][1]


def test_landings_on_the_obstacle_are_judged_apart():
    """The third of four landings; the foot meets it about as fast as the floor, and softly with proximity."""
    from landing import OBSTACLE_STEPS, Case, by_place, run

    results = {
        (ground, near): [run(Case(ground, near, OBSTACLE_STEPS, 0.4, 1))] if ground == "obstacle" else []
        for ground in ("flat", "obstacle")
        for near in (False, True)
    }
    places = by_place(results)
    (hard,), (soft,) = (places["on the obstacle", near] for near in (False, True))
    assert len(places["floor next to the obstacle", False]) == OBSTACLE_STEPS - 1
    assert hard.is_whole and soft.is_whole and 0.3 < hard.speed < 0.5 and soft.force < hard.force / 4


@pytest.mark.slow
def test_force_torque_sensors_and_skin_feel_the_same_zmp_under_a_push():
    """The robot survives a push of a fifth of its momentum at 1 m/s; both ZMPs agree to a few millimetres."""
    from balance import Case, push

    stands, zmps = push(Case("full sole", "skin", 0), 6.0)
    apart = np.linalg.norm(zmps[:, 0] - zmps[:, 1], axis=1)
    assert stands and np.ptp(zmps[:, 0, 0]) > 0.03
    assert apart.mean() < 0.003 and apart.max() < 0.010


def test_noise_and_latency_are_wrong_from_a_time_on():
    """The noise at rest is learned before; a reading is that of one cycle before, and then of three before."""
    from biped import NOISE, PERIOD, Biped, Faults

    robot = Biped(faults=Faults(since=0.4, noise=2 * NOISE, latency=3), proximity=False)
    plain = Biped(proximity=False)
    for name, skin in robot.body.skins.items():
        assert skin.noise.sigma == pytest.approx(plain.body.skins[name].noise.sigma)
    made, kept = [], {True: [], False: []}
    original = robot._reading

    def reading(name, forces):
        counts = original(name, forces)
        if name == "left_foot":
            made.append(counts)
        return counts

    robot._reading = reading
    robot.data.qpos[2] += 1  # in the air
    while robot.data.time < 0.8:
        senses, late = robot.senses(), robot.data.time >= 0.4
        kept[late].append(senses.readings["left_foot"]["force"])
        assert senses.readings["left_foot"] is made[max(len(made) - 1 - (3 if late else 1), 0)]
        robot.data.time += PERIOD
    before, after = (np.std(kept[late][5:], axis=0).mean() for late in (False, True))
    assert abs(before / NOISE - 1) < 0.1 and abs(after / NOISE - 2) < 0.2


@pytest.mark.slow
def test_frozen_bus_ends_the_walk_but_the_robot_stands():
    from faults import Case, run

    result = run(Case("frozen bus", True, 2, 3))  # it freezes in the first step, after 1.35 s
    assert result.stands and result.steps == 1 and 0.1 <= result.stopped < 1.2


def test_distribution_meets_the_wrench_with_both_feet_in_their_areas():
    """Compared with the corners of the areas: their forces make the same wrench (linear program)."""
    from distribution import distribute
    from scipy.optimize import linprog

    from skin_calib_addon.runtime import convex_hull, zero_moment_point
    from skin_calib_addon.runtime.balance.cone import wrench_rays

    full = convex_hull(np.array(((0.1, 0.05), (-0.1, 0.05), (-0.1, -0.05), (0.1, -0.05))))
    rear = convex_hull(np.array(((0.0, 0.05), (-0.1, 0.05), (-0.1, -0.05), (0.0, -0.05))))
    soles = {"left": np.array((0.0, 0.09, 0.0)), "right": np.array((0.0, -0.09, 0.0))}
    areas, weight, wanted = {"left": full, "right": rear}, 340.0, np.array((0.03, 0.0))
    found = distribute(wanted, weight, soles, areas, 0.5)
    total = sum(np.concatenate((w[:3], w[3:] + np.cross(soles[foot], w[:3]))) for foot, w in found.items())
    assert np.abs(zero_moment_point(total) - wanted).max() < 1e-3 and abs(total[2] / weight - 1) < 1e-3
    for foot, wrench in found.items():
        rays = wrench_rays(areas[foot], 0.5)
        assert linprog(np.zeros(len(rays)), A_eq=rays.T, b_eq=wrench, bounds=(-1e-6, None)).success
    assert zero_moment_point(found["right"])[0] < 1e-6 < 0.03 < zero_moment_point(found["left"])[0]


@pytest.mark.slow
def test_cone_of_the_felt_polygon_keeps_a_foot_from_tipping_and_the_robot_from_falling():
    """A run of 3.5 s was too short: the robot tips, and falls 3 s after the motion of the ZMP."""
    from wrenches import END, MOVE, START, TIPPED, Case, run

    felt, full = (run(Case(cone, 0)) for cone in ("felt", "full"))
    assert felt.stands and felt.tilt < TIPPED and felt.demanded <= 0 and felt.off < 0.005
    assert not full.stands and full.tilt > TIPPED and full.demanded > 0 and START + MOVE < full.fell < END - 1


@pytest.mark.slow
def test_pushed_robot_that_falls_slowly_does_not_count_as_standing():
    """It stood on the half soles for 1.4 s after a diagonal push, with a tilt of 43 degrees at the end."""
    from balance import Case, push

    assert push(Case("half sole", "skin", 1), 4.5)[0]
    assert not push(Case("half sole", "skin", 1), 9.0)[0]


@pytest.mark.slow
@pytest.mark.parametrize("obstacle", ["small block in the middle", "three pebbles"])
def test_robot_steps_next_to_an_obstacle_and_walks_on(obstacle):
    from replanning import MIN_AREA, Case, run

    result = run(Case(obstacle, "what is felt, new steps", 0))
    assert result.stands and result.steps == 5
    assert result.retracted[0] == "right" and result.area < MIN_AREA  # without the skin it falls there


@pytest.mark.slow
@pytest.mark.parametrize(("part", "seed"), [("inner half", 0), ("outer half", 0), ("30 %", 3)])
def test_robot_stands_on_a_part_of_a_sole(part, seed):
    """On the 30 % it fell when the plan moved the DCM on while it was held."""
    from footholds import Case, run

    result = run(Case(part, True, seed))
    assert result.stands and result.steps == 5 and 0.4 < result.area < 0.6


@pytest.mark.slow
def test_robot_walks_on_a_beam_with_the_skin_only():
    from beam import Case, run

    felt, full = (run(Case(feels, 0.08, 9, 0)) for feels in (True, False))
    assert felt.stands and felt.steps == 9 and not full.stands


@pytest.mark.slow
def test_estimated_feet_stay_where_they_stand():
    """A foot bounces after it has met the ground, and slides by 2 mm; it is anchored when it carries load."""
    from beam import GAIT, side_steps
    from biped import FEET, Biped
    from estimator import SOLE_CENTRE
    from walker import Walker, walk

    robot = Biped(proximity=False)
    walker = Walker(robot, side_steps(6), GAIT)
    assert walk(robot, walker, 15.0)
    for foot, sole in zip(FEET, walker.log.rows[-1]["soles"]):
        body = robot.data.body(f"{foot}_foot")
        assert np.abs(sole - body.xpos - body.xmat.reshape(3, 3) @ SOLE_CENTRE)[:2].max() < 0.002


@pytest.fixture
def g1_feet(scripts, tmp_path_factory):
    """The folder with the skins proposed for the feet of the G1, made once for all tests."""
    from g1 import URDF, propose

    if not URDF.exists():
        pytest.skip(f"no real robot here: {URDF} is missing")
    folder = tmp_path_factory.getbasetemp() / "g1_feet"
    propose(URDF, folder)
    return folder


@pytest.mark.slow
def test_g1_lands_softly_by_the_distances_below_its_feet(g1_feet):
    """It stands after two steps in place, with less than a tenth of the impact, and not later."""
    from g1 import URDF
    from g1_landing import Case, run

    (stands, soft), (_, hard) = (run(Case(URDF, g1_feet, "flat", near, 2, 0.4, 0)) for near in (True, False))
    assert stands and len(soft) == 2
    assert max(i.force for i in soft) < min(i.force for i in hard) / 10
    assert max(i.time for i in soft) < min(i.time for i in hard) + 0.02


@pytest.mark.slow
def test_g1_lands_softly_on_an_obstacle_that_it_does_not_know(g1_feet):
    """The first of two steps is onto it, the other one onto the floor; the robot stands."""
    from g1 import FEET, G1, URDF
    from g1_landing import OBSTACLE_STEPS, Case, by_place, run

    results = {
        (ground, near): [run(Case(URDF, g1_feet, ground, near, OBSTACLE_STEPS, 0.4, 0))] if ground != "flat" else []
        for ground in ("flat", "obstacle")
        for near in (False, True)
    }
    robot = G1(URDF, g1_feet, 0)
    places = by_place(results, robot.data.body(FEET[0]).xpos[2])
    (hard,), (soft,) = (places["on the obstacle", near] for near in (False, True))
    assert [len(places["floor next to the obstacle", near]) for near in (False, True)] == [1, 1]
    assert 0.3 < hard.speed < 0.5 and soft.force < hard.force / 4 and soft.time < hard.time
    assert results["obstacle", True][0][0]


@pytest.fixture
def g1_arm(scripts, tmp_path_factory):
    """Runs a case of the arm of the G1; its skins are made once for all tests."""
    from g1 import URDF, propose
    from g1_arm import COVERED, G1Case, run

    if not URDF.exists():
        pytest.skip(f"no real robot here: {URDF} is missing")
    folder = tmp_path_factory.getbasetemp() / "g1_arm"
    propose(URDF, folder, COVERED)
    return lambda kind, variant: run(G1Case(kind, variant, 0, urdf=URDF, folder=folder))


@pytest.mark.slow
def test_g1_forearm_yields_to_a_contact_and_shrinks_back_before_one_and_from_heat(g1_arm):
    stiff, soft = (g1_arm("contacts", variant) for variant in ("stiff", "yields"))
    assert 0 < soft["force"].max() < stiff["force"].max() / 4 and soft["moved"][-1] > 0.05 > stiff["moved"][-1]
    hit, clear = (g1_arm("near", variant) for variant in ("hand only", "null space"))
    assert hit["force"].max() > 10 and clear["force"].max() == 0
    assert clear["hand"].max() < 0.03
    burns, cool = (g1_arm("heat", variant) for variant in ("hand only", "first"))
    assert cool["heat"].max() < burns["heat"].max() - 10 and cool["gap"].min() > burns["gap"].min()


@pytest.mark.slow
def test_g1_forearm_feels_the_force_of_its_probe(g1_arm):
    """Its readings are counts; they were taken as newtons, 34 times too large."""
    stiff = g1_arm("contacts", "stiff")
    pressed = slice(len(stiff.log) * 3 // 4, None)
    assert stiff["force"][pressed].min() > 10
    np.testing.assert_allclose(stiff["virtual"][pressed], stiff["force"][pressed], rtol=0.15)


@pytest.mark.slow
def test_g1_arm_yields_by_the_torques_of_contacts_on_two_links(g1_arm):
    """With the torques of the elbow alone the contact of the upper arm stays hard."""
    stiff, one, both = (g1_arm("links", variant) for variant in ("stiff", "one link", "yields"))
    assert both["force"].max() < stiff["force"].max() / 3 and both["second"].max() < one["second"].max() - 10


@pytest.mark.slow
def test_g1_arm_has_pain_by_a_small_probe_earlier_than_by_a_large_one(g1_arm):
    """The pressure of the same force on more taxels is lower; so it also yields more slowly to it."""
    small, large = (g1_arm("pain", variant) for variant in ("small", "large"))
    assert 2 < small.pain_force < 10 and large.pain_force > 2 * small.pain_force
    fast, slow = (g1_arm("pressure", f"{size}, pressure") for size in ("small", "large"))
    assert slow.speed < 0.75 * fast.speed and slow.pressed_area > 3 * fast.pressed_area


@pytest.mark.slow
def test_g1_keeps_its_balance_by_the_skin_that_was_proposed_for_its_feet(g1_feet):
    """A push of 12 N s from behind; the ZMP of the skin agrees with the true one."""
    from g1 import URDF, Case, push

    stands, zmps = push(Case(URDF, g1_feet, "full sole", "skin", 0), 12.0)
    off = np.linalg.norm(zmps[:, 0] - zmps[:, 2], axis=1)
    assert stands and np.ptp(zmps[:, 2, 0]) > 0.03
    assert off.mean() < 0.004 and np.percentile(off, 95) < 0.008


@pytest.mark.slow
def test_g1_is_the_same_robot_with_its_meshes_on_a_beam_that_bears_the_middle_of_its_soles_only(g1_feet):
    """The meshes of an animation touch nothing and have no mass; the ground is below the middle half only."""
    from dataclasses import replace

    import g1

    case = g1.Case(g1.URDF, g1_feet, "half sole", "skin", 0)
    pressed = []

    def look(robot):
        for foot in g1.FEET:
            skin, forces = robot.body.skins[foot], robot._normal_forces()[robot.cells[foot]]
            pressed.extend(robot.data.body(foot).xpos[0] + skin.positions[forces > 0, 0])

    plain, shown = (
        g1.push(replace(case, is_shown=is_shown), 3.0, each) for is_shown, each in ((False, look), (True, None))
    )
    np.testing.assert_array_equal(plain[1], shown[1])
    beam = g1.GROUND["half sole"].boxes[0]
    assert plain[0] and np.abs(np.array(pressed) - beam.centre[0]).max() < beam.half[0] + 0.01
