"""A small robot touches itself: offsets of joints, tip and skins, what cannot be separated, and the next touch."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from skin_calib_addon.calibration.file import load_calibration, save_calibration
from skin_calib_addon.calibration.robot_set import RobotSet, UrdfFile, load_links, robot_link, save_robot_set
from skin_calib_addon.cli import main
from skin_calib_addon.common.errors import CalibrationFormatError
from skin_calib_addon.common.file_hash import file_hash
from skin_calib_addon.pipeline.self_touch import moved_skins
from skin_calib_addon.robot.kinematics import link_poses
from skin_calib_addon.robot.urdf import read_robot
from skin_calib_addon.skin.uncertainty import MIN_ORIGIN_UNCERTAINTY
from skin_calib_addon.validation.flat import flat_places
from skin_calib_addon.validation.next_self_touch import next_touches
from skin_calib_addon.validation.self_touch import fit_self_touch
from skin_calib_addon.validation.self_touch_session import read_session
from tests.samples import RADIUS, cylinder, sheet, small_calibration

# A trunk with a skin on a cylinder, and an arm in front of it whose forearm has a skin as well.
ARM = {
    "pan": ("trunk", "column", "0.22 0 0.05", "0 0 1"),
    "shoulder": ("column", "upper", "0 0 0", "0 1 0"),
    "elbow": ("upper", "forearm", "0.15 0 0", "0 1 0"),
    "roll": ("forearm", "wrist", "0.12 0 0", "1 0 0"),
    "wrist": ("wrist", "hand", "0.02 0 0", "0 0 1"),
}
TIP = np.array((0.06, 0.0, 0.0))
TRUE_TIP = TIP + (1e-3, -1.5e-3, 2e-3)
OFFSETS = dict(zip(ARM, np.deg2rad((0.6, -0.4, 0.7, -0.5, 0.3))))
SHIFT, TURN = np.array((2e-3, -3e-3)), np.deg2rad(2.0)


def urdf(*more):
    """Return the robot as text."""
    links = ["trunk", *(child for _, child, _, _ in ARM.values())]
    joint = (
        '<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/><origin xyz="{}"/><axis xyz="{}"/>'
        '<limit lower="-3" upper="3"/></joint>'
    )
    parts = [f'<link name="{link}"/>' for link in links] + [joint.format(name, *of) for name, of in ARM.items()]
    return '<robot name="bot">' + "".join((*parts, *more)) + "</robot>"


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    path = tmp_path_factory.mktemp("robot") / "bot.urdf"
    path.write_text(urdf())
    return read_robot(path)


@pytest.fixture(scope="module")
def skins():
    """The calibrations of trunk and forearm; the ids of both are the same."""
    return {
        link: small_calibration(link=link, patches=(sheet(8, 12, 0.01),), surfaces=(cylinder(),))
        for link in ("trunk", "forearm")
    }


def on_skin(patch, shift=SHIFT, turn=TURN):
    """Return where the taxels of a skin are that was moved on its cylinder, and their normals."""
    flat = flat_places(patch, patch.taxels.index)
    arms = flat - flat.mean(axis=0)
    flat = flat + shift + turn * np.column_stack((-arms[:, 1], arms[:, 0]))
    angle, height = flat[:, 0] / RADIUS, flat[:, 1] + 0.005
    normals = np.column_stack((np.cos(angle), np.sin(angle), 0 * angle))
    return RADIUS * normals + np.outer(height, (0, 0, 1)), normals


def in_trunk(point, angles):
    """Return a point of the link that these joints of the arm carry, in the frame of the trunk."""
    x, y, z = point
    for (*_, origin, axis), angle in [*zip(ARM.values(), angles)][::-1]:
        c, s = math.cos(angle), math.sin(angle)
        if axis == "0 0 1":
            x, y = c * x - s * y, s * x + c * y
        elif axis == "0 1 0":
            x, z = c * x + s * z, c * z - s * x
        else:
            y, z = c * y - s * z, s * y + c * z
        dx, dy, dz = map(float, origin.split())
        x, y, z = x + dx, y + dy, z + dz
    return np.array((x, y, z))


def touch(row, rng, skins, tip=TRUE_TIP):
    """Return the measured angles with which the tip is at the centre of a taxel, or None."""
    points, normals = on_skin(skins["trunk"].patches[0])

    def hand(angles, of=tip):
        return in_trunk(of, angles)

    start = rng.uniform(-1, 1, 5) + (np.pi, 0.5, -0.5, 0, 0)
    found = least_squares(
        lambda angles: 1e3 * (hand(angles) - points[row]), np.clip(start, -3, 3), bounds=(-3, 3), max_nfev=20
    ).x
    arm = hand(found, of=np.zeros(3)) - points[row]
    is_good = np.linalg.norm(hand(found) - points[row]) < 1e-6 and arm @ normals[row] > 0.3 * np.linalg.norm(arm)
    return {name: value - OFFSETS[name] for name, value in zip(ARM, found)} if is_good else None


@pytest.fixture(scope="module")
def touches(skins):
    """Forty touches of the trunk: angles and row of the taxel."""
    rng, found = np.random.default_rng(3), []
    while len(found) < 40:
        row = int(rng.integers(96))
        if (angles := touch(row, rng, skins)) is not None:
            found.append((angles, row))
    return found


def table(touches, header=None, tip="# tip: finger hand 60 0 0 mm"):
    """Return a session of the trunk; angles in degrees."""
    names = header or ["link", "taxel", *(f"{name} [deg]" for name in ARM)]
    ids = sheet(8, 12, 0.01).taxels.ids
    rows = [["trunk", ids[row], *(f"{np.rad2deg(value):.6f}" for value in angles.values())] for angles, row in touches]
    return "\n".join([tip, ",".join(names), *(",".join(row) for row in rows)]) + "\n"


def session(folder, text, robot, skins):
    path = folder / "session.csv"
    path.write_text(text)
    return read_session(path, robot, skins)


def of(found, kind):
    """Values, standard errors and learnt parts of one kind of unknowns."""
    rows = [k for k, unknown in enumerate(found.model.unknowns) if unknown.kind == kind]
    return found.values[rows], found.errors[rows], found.learnt[rows]


def test_touches_find_the_errors(robot, skins, touches, tmp_path):
    """Other touches then agree within a tenth of a millimetre, and each error is within three standard errors."""
    found = fit_self_touch(robot, session(tmp_path, table(touches[:30]), robot, skins))
    others = session(tmp_path, table(touches[30:]), robot, skins)
    nominal = np.linalg.norm(
        found.model.__class__(robot, others, found.model.unknowns).linearized(0 * found.values)[0], axis=1
    )
    assert np.median(nominal) > 3e-3 and np.median(found.distances(others)) < 1.5e-4
    for kind, truth in (("joint", [*OFFSETS.values()]), ("tip", TRUE_TIP - TIP), ("shift", SHIFT), ("turn", [TURN])):
        values, errors, learnt = of(found, kind)
        assert (np.abs(values - truth) < 3 * errors).all() and ((learnt >= 0) & (learnt <= 1)).all()
    assert of(found, "shift")[2].min() > 0.5 and not found.unexplained.any()


def test_skins_are_moved(robot, skins, touches, tmp_path):
    """Along their surface, with cells and normals; the calibration states how exactly."""
    found = fit_self_touch(robot, session(tmp_path, table(touches), robot, skins))
    moved = moved_skins(found, skins)
    assert set(moved) == {"trunk"}
    (before,), (after,) = skins["trunk"].patches, moved["trunk"].patches
    truth, normals = on_skin(before)
    first = np.linalg.norm(before.taxels.positions_link - truth, axis=1)
    errors = np.linalg.norm(after.taxels.positions_link - truth, axis=1)
    assert first.mean() > 3e-3 and errors.mean() < 1e-3
    assert (after.taxels.normals_link * normals).sum(axis=1).min() > np.cos(np.deg2rad(2))
    np.testing.assert_allclose(after.taxels.tangents_link[:, 2], np.sin(of(found, "turn")[0][0]), atol=2e-3)
    sides = [np.linalg.norm(p.taxels.corners_link[:, 1] - p.taxels.corners_link[:, 0], axis=1) for p in (before, after)]
    np.testing.assert_allclose(*sides, rtol=1e-9)
    assert 1e-4 < after.registration.origin < 3e-3 and after.registration.direction < np.deg2rad(3)


def test_moved_skins_state_their_registration(robot, skins, touches, tmp_path):
    """Motion of the middle with covariance, residuals, and the session; the taxels next to it moved by it."""
    wrong = [(angles, row if k else (row + 36) % 96) for k, (angles, row) in enumerate(touches)]
    found = fit_self_touch(robot, session(tmp_path, table(wrong), robot, skins))
    (before,), (after,) = skins["trunk"].patches, moved_skins(found, skins)["trunk"].patches
    stated = after.touches
    assert stated.session == file_hash(tmp_path / "session.csv") and len(stated.date) == 10
    assert (stated.used, stated.left_out) == (len(touches) - 1, 1)
    assert 0 < stated.along < 1e-4 and 0 < stated.normal < 1e-4 and stated.angle is None
    np.testing.assert_allclose(stated.turn, of(found, "turn")[0][0])
    near = np.argsort(np.linalg.norm(after.taxels.positions_link - stated.anchor, axis=1))[:4]
    steps = (after.taxels.positions_link - before.taxels.positions_link)[near]
    shift = np.einsum("nij,nj->ni", before.taxels.axes_link[near], steps).mean(axis=0)
    np.testing.assert_allclose(shift, stated.shift, atol=1e-4)
    errors = of(found, "shift")[1]
    np.testing.assert_allclose(np.diag(stated.covariance)[:2], errors**2 + MIN_ORIGIN_UNCERTAINTY**2)
    assert stated.turn_error == pytest.approx(after.registration.direction)
    assert np.linalg.eigvalsh(stated.covariance)[0] > 0


def test_anchor_of_the_registration_is_on_the_skin(robot, skins, touches, tmp_path):
    """Also if touches of a corner leave the point where shift and rotation are independent outside of the skin."""
    corner = [(angles, row) for angles, row in touches if row % 12 < 5 and row < 60]
    found = fit_self_touch(robot, session(tmp_path, table(corner), robot, skins))
    (patch,) = moved_skins(found, skins)["trunk"].patches
    taxels, C = patch.taxels, found.covariance_of(0)
    away = np.linalg.norm(taxels.positions_link - patch.registration.anchor, axis=1)
    assert away.min() == 0.0
    axes, anchor = taxels.axes_link[away.argmin()], found.displacements(0)[1][away.argmin()]
    along = np.linalg.eigvalsh(axes @ anchor @ axes.T)[-1]  # of this taxel as the touches show it
    assert patch.registration.origin == pytest.approx(np.sqrt(along), rel=0.02)
    assert patch.registration.direction == pytest.approx(np.sqrt(C[2, 2]))


def test_uncertainty_of_earlier_touches_stays(robot, skins, touches, tmp_path):
    """Their registration states the largest error; without it nothing would be left of that of a taxel."""
    first = moved_skins(fit_self_touch(robot, session(tmp_path, table(touches), robot, skins)), skins)
    (patch,) = first["trunk"].patches
    sigma = np.tile((5e-4, 1e-4, 0.01), (len(patch.taxels.ids), 1))
    patch = replace(
        patch,
        taxels=replace(patch.taxels, sigma=sigma),
        registration=replace(patch.registration, origin=2e-3, direction=0.05),
    )
    again = first | {"trunk": replace(first["trunk"], patches=(patch,))}
    found = fit_self_touch(robot, session(tmp_path, table(touches), robot, skins | again))
    (after,) = moved_skins(found, again)["trunk"].patches
    assert (after.taxels.sigma[:, 0] >= 5e-4).all()


def test_wrong_touches_are_named_and_count_little(robot, skins, touches, tmp_path):
    """Three of forty touches with the taxel of another row of cells."""
    wrong = [(angles, (row + 48) % 96 if k in (4, 11, 30) else row) for k, (angles, row) in enumerate(touches)]
    found = fit_self_touch(robot, session(tmp_path, table(wrong), robot, skins))
    (warning,) = (warning for warning in found.warnings() if warning.code == "self-touch-outliers")
    assert "line 7, line 14, line 33" in warning.message and warning.value == 3
    right = fit_self_touch(robot, session(tmp_path, table(touches), robot, skins))
    assert np.abs(found.values - right.values)[:8].max() < 3e-3


def test_what_cannot_be_separated_is_named(robot, skins, touches, tmp_path):
    """The last joint and the tip across it: one moves the tip as the other does."""
    found = fit_self_touch(robot, session(tmp_path, table(touches), robot, skins))
    pairs = [{found.name(found.model.unknowns[k]): value for k, value in one.items()} for one in found.combinations]
    (pair,) = (one for one in pairs if "wrist" in one)
    assert set(pair) == {"wrist", "the y of tip finger"}
    assert pair["the y of tip finger"] / pair["wrist"] == pytest.approx(-TIP[0], rel=0.1)
    (note,) = (w for w in found.warnings() if w.code == "not-separated" and "wrist" in w.message)
    assert "wrist by" in note.message and "the y of tip finger by" in note.message and note.severity == "note"


def test_few_touches_teach_little(robot, skins, touches, tmp_path):
    """The part that is learnt grows with the touches; of one touch it is small for most joints."""
    parts = [fit_self_touch(robot, session(tmp_path, table(touches[:n]), robot, skins)).learnt for n in (1, 5, 40)]
    assert parts[0][:5].mean() < 0.3 and parts[0].mean() < parts[1].mean() < parts[2].mean()


def test_skin_touches_skin(robot, skins, tmp_path):
    """The forearm touches the trunk, and both feel it: no tip is needed, and the joints beyond are not asked for."""
    rng, rows = np.random.default_rng(8), []
    trunk, normals = on_skin(skins["trunk"].patches[0])
    arm, outward = on_skin(skins["forearm"].patches[0], np.zeros(2), 0.0)
    ids = skins["trunk"].patches[0].taxels.ids
    while len(rows) < 25:
        a, b = rng.integers(96, size=2)

        def miss(angles, a=a, b=b):
            return 1e3 * (in_trunk(arm[b], angles) - trunk[a])

        found = least_squares(miss, rng.uniform(-1, 1, 3) + (2.0, 0.5, -0.5), bounds=(-3, 3)).x
        if np.abs(miss(found)).max() < 1e-3:
            angles = [value - OFFSETS[name] for name, value in zip(ARM, found)]
            rows.append(",".join(("trunk", ids[a], "forearm", ids[b], *(f"{x:.7f}" for x in angles))))
    text = "\n".join(("link,taxel,link2,taxel2,pan,shoulder,elbow", *rows)) + "\n"
    found = fit_self_touch(robot, session(tmp_path, text, robot, skins))
    assert np.linalg.norm(found.residuals, axis=1).max() < 5e-4
    assert {u.owner for u in found.model.unknowns if u.kind == "joint"} == {"pan", "shoulder", "elbow"}
    values, errors, _ = of(found, "joint")
    assert (np.abs(values - [*OFFSETS.values()][:3]) < 3 * errors).all()


def test_readings_of_all_taxels(robot, skins, touches, tmp_path):
    """Columns LINK/ID: the centroid of several is more exact than the strongest; presses are joined."""
    ids = skins["trunk"].patches[0].taxels.ids
    lines = [
        "# tip: finger hand 60 0 0 mm",
        ",".join(("press", "link", "taxel", *ARM, *(f"trunk/{name}" for name in ids))),
    ]
    for k, (angles, row) in enumerate(touches):
        felt = np.zeros(96)
        felt[row], felt[row + (1 if row % 12 < 11 else -1)] = 10, 8
        lines += [
            ",".join((str(k), "trunk", ids[row], *(f"{a:.7f}" for a in angles.values()), *(f"{x:g}" for x in felt)))
        ] * 3
    read = session(tmp_path, "\n".join(lines) + "\n", robot, skins)
    assert len(read.lines) == 40 and read.rows == 120 and read.lines[1] == 6
    found = fit_self_touch(robot, read)
    assert (found.model.classes[:, 0] == 1).all() and (found.model.classes[:, 1] == 0).all()
    assert (found.model.sigmas[:, 0] < found.model.sigmas[:, 1]).all()


def test_next_touch_is_possible_and_says_most(robot, skins, touches, tmp_path):
    """The tip is at the taxel, from outside, within the limits; later touches say less, and more than random ones."""
    found = fit_self_touch(robot, session(tmp_path, table(touches[:6]), robot, skins))
    proposed = next_touches(found, 40)
    assert len(proposed) == 40 and len({touch.taxel for touch in proposed}) > 1
    gains = [touch.information for touch in proposed]
    assert gains == sorted(gains, reverse=True) and gains[0] > 0
    values = {u: value for u, value in zip(found.model.unknowns, found.values)}
    joints = {u.owner: value for u, value in values.items() if u.kind == "joint"}
    tip = TIP + [value for u, value in values.items() if u.kind == "tip"]
    (patch,) = moved_skins(found, skins)["trunk"].patches
    for touch in proposed:
        poses = link_poses(robot, {name: value + joints[name] for name, value in touch.positions.items()})
        row = patch.taxels.ids.index(touch.taxel)
        at = (poses["hand"] @ (*tip, 1.0))[:3]
        assert np.linalg.norm(at - patch.taxels.positions_link[row]) < 3e-3
        assert (poses["hand"][:3, 3] - at) @ patch.taxels.normals_link[row] > 0
        assert max(map(abs, touch.positions.values())) <= 3

    def left(extra):
        more = session(tmp_path, table(touches[:6] + extra), robot, skins)
        return np.linalg.slogdet(fit_self_touch(robot, more).covariance)[1]

    ids = skins["trunk"].patches[0].taxels.ids
    assert left([(t.positions, ids.index(t.taxel)) for t in proposed[:4]]) < left(touches[6:10])


BAD = {
    "missing joint": (
        lambda t: t.replace("elbow [deg]", "other"),
        "has no column of elbow, between trunk and hand. Add",
    ),
    "unknown joint": (
        lambda t: t.replace("elbow [deg]", "elbw [deg]"),
        'line 2, column 5: bot.urdf has no joint "elbw"',
    ),
    "no unit": (
        lambda t: t.replace(" [deg]", ""),
        "is beyond its limits, -3 to 3 rad; for other units name the column",
    ),
    "unknown unit": (lambda t: t.replace("pan [deg]", "pan [grad]"), 'the unit "grad" of "pan" is not known here'),
    "joint twice": (lambda t: t.replace("elbow [deg]", "pan [deg]"), 'names the column "pan" twice'),
    "link without skin": (
        lambda t: t.replace("\ntrunk,", "\nhand,", 1),
        'line 3, column 1: the link "hand" has no skin',
    ),
    "unknown taxel": (lambda t: t.replace("\ntrunk,s", "\ntrunk,x", 1), 'line 3, column 2: trunk has no taxel "x'),
    "no link": (lambda t: t.replace("link,", "note,", 1), "trunk, forearm have a taxel"),
    "no tip": (lambda t: t.replace("# tip", "# top"), "does not state what touched: name a tip"),
    "link of the tip": (
        lambda t: t.replace("finger hand", "finger hnd"),
        'line 1: bot.urdf has no link "hnd"; did you',
    ),
    "unit of the tip": (
        lambda t: t.replace("0 0 mm", "0 0"),
        'line 1: a tip has the form "# tip: NAME LINK X Y Z UNIT"',
    ),
    "tip twice": (
        lambda t: t.replace("# tip: ", "# tip: finger hand 0 0 90 mm\n# tip: "),
        'line 2: a comment above places the tip "finger", too',
    ),
    "fixed tip": (lambda t: t.replace("finger hand", "finger trunk"), "no joint moves trunk, which touched"),
    "taxel twice": (
        lambda t: t.replace(",pan", ",trunk/s0.0,pan").replace("elbow [deg]", "trunk/s0.0"),
        'line 2, column 6: the header names the taxel "trunk/s0.0" twice',
    ),
    "no row": (lambda t: "\n".join(t.split("\n")[:2]) + "\n", "no row below its header"),
    "no number": (lambda t: t.rsplit(",", 1)[0] + ",x\n", "line 42, column 7"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_session_is_one_line(case, robot, skins, touches, tmp_path):
    """It states what is wrong, where, and what to do."""
    change, message = BAD[case]
    text = change(table(touches))
    assert text != table(touches)
    with pytest.raises(CalibrationFormatError) as error:
        fit_self_touch(robot, session(tmp_path, text, robot, skins))
    assert message in str(error.value) and "\n" not in str(error.value)


@pytest.fixture
def folder(tmp_path, skins):
    """The folder of the robot."""
    (tmp_path / "bot").mkdir()
    (tmp_path / "bot.urdf").write_text(urdf())
    for link, calibration in skins.items():
        save_calibration(calibration, tmp_path / "bot" / f"{link}.calibration.json")
    links = tuple(robot_link(tmp_path / "bot", f"{link}.calibration.json") for link in skins)
    save_robot_set(RobotSet("bot", UrdfFile("../bot.urdf", file_hash(tmp_path / "bot.urdf")), links), tmp_path / "bot")
    return tmp_path


def test_command_moves_the_skins(folder, touches, skins, capsys):
    """It states joints, tip, skins and the next touch; the moved skins are another complete robot."""
    (folder / "session.csv").write_text(table(touches))
    before = {path: path.read_bytes() for path in (folder / "bot").iterdir()}
    words = ["touches", str(folder / "bot"), str(folder / "session.csv")]
    assert main([*words, "--refine", "-o", str(folder / "moved")]) == 0
    said = capsys.readouterr()
    for line in ("robot            bot, 2 links with skin, 192 taxels", "touches          40", "elbow            +0."):
        assert line in said.out
    assert "touch next       finger at trunk/s" in said.out and "tip finger" in said.out
    assert "[not-separated]" in said.err and {path: path.read_bytes() for path in (folder / "bot").iterdir()} == before
    calibrations, warnings = load_links(folder / "moved")
    assert set(calibrations) == {"trunk", "forearm"} and not [
        w for w in warnings if not w.code.startswith("duplicate-")
    ]
    truth, _ = on_skin(skins["trunk"].patches[0])
    assert calibrations["trunk"].patches[0].touches.used == 40 and calibrations["forearm"].patches[0].touches is None
    positions = calibrations["trunk"].patches[0].taxels.positions_link
    assert np.linalg.norm(positions - truth, axis=1).mean() < 1e-3
    offsets = json.loads((folder / "moved" / "joint_offsets.json").read_text())
    assert offsets["joints"]["elbow"]["offset"] == pytest.approx(OFFSETS["elbow"], abs=np.deg2rad(0.5))
    assert set(offsets["tips"]["finger"]) == {"x", "y", "z"}


def test_command_moves_nothing_by_wrong_touches(folder, touches, capsys):
    """Neither with taxels at random, nor into the folder of the robot, nor with a session of another robot."""
    rng = np.random.default_rng(1)
    (folder / "session.csv").write_text(table([(angles, int(rng.integers(96))) for angles, _ in touches]))
    words = ["touches", str(folder / "bot"), str(folder / "session.csv"), "--refine", "-o"]
    assert main([*words, str(folder / "moved")]) == 1
    assert "touches are far from where they were felt. Check the channels" in capsys.readouterr().err
    assert main([*words, str(folder / "bot")]) == 2
    assert "or the folder of the robot. Name another folder" in capsys.readouterr().err
    assert not (folder / "moved").exists()
    assert load_calibration(folder / "bot" / "trunk.calibration.json").patches[0].registration is None


def test_columns_of_joints_that_do_not_move_are_not_used(touches, skins, tmp_path):
    """A recording of all joints has those that are fixed, or follow others, too."""
    fixed, follows = (
        f'<joint name="{name}" type="{kind}"><parent link="trunk"/><child link="{name}_link"/>{more}</joint>'
        for name, kind, more in (
            ("Flange", "fixed", ""),
            ("finger", "revolute", '<limit lower="-1" upper="1"/><mimic joint="pan"/>'),
        )
    )
    (tmp_path / "bot.urdf").write_text(urdf(fixed, follows, '<link name="Flange_link"/>', '<link name="finger_link"/>'))
    lines = table(touches[:3]).splitlines()
    text = "\n".join([lines[0], f"{lines[1]},Flange [deg],finger [deg]", *(f"{line},0,70" for line in lines[2:])])
    found = session(tmp_path, text + "\n", read_robot(tmp_path / "bot.urdf"), skins)
    assert set(found.positions) == set(ARM) and len(found.unused) == 2
