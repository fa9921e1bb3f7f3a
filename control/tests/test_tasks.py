"""Joint torques of wrenches, priorities, attraction and servos, against differences, energy and other libraries."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from skin_control.tasks import MIN_MOBILITY, TorqueResolver, attraction, contact_torques, prioritized
from skin_control.virtual import proximity_wrench, temperature_wrench
from tests.soles import cell_patch, skin_of

RNG = np.random.default_rng(1)
JOINTS = 7
AXES = RNG.normal(size=(JOINTS, 3))
AXES /= np.linalg.norm(AXES, axis=1)[:, None]
OFFSETS = RNG.normal(0, 0.2, (JOINTS, 3))  # from one joint to the next [m]


def rotation_about(axis, angle):
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def chain(q, last=JOINTS):
    """The pose of link ``last`` of a chain of rotary joints, and the Jacobian of its origin."""
    rotation, position, axes, points = np.eye(3), np.zeros(3), [], []
    for k in range(last):
        position = position + rotation @ OFFSETS[k]
        axes.append(rotation @ AXES[k])
        points.append(position)
        rotation = rotation @ rotation_about(AXES[k], q[k])
    pose, jacobian = np.eye(4), np.zeros((6, JOINTS))
    pose[:3, :3], pose[:3, 3] = rotation, position
    for k in range(last):
        jacobian[:, k] = (*np.cross(axes[k], position - points[k]), *axes[k])
    return pose, jacobian


def ring_skin(count=12, radius=0.05):
    """A ring of cells around z; their normals point outward."""
    angle = np.arange(count) * 2 * np.pi / count
    normals = np.column_stack((np.cos(angle), np.sin(angle), 0 * angle))
    along = np.column_stack((-np.sin(angle), np.cos(angle), 0 * angle)) * 0.01
    up = np.array((0, 0, 0.01))
    signs = (-1, -1), (1, -1), (1, 1), (-1, 1)
    corners = np.stack([radius * normals + a * along + b * up for a, b in signs], axis=1)
    return skin_of(cell_patch(radius * normals, normals, corners))


def inertia_matrix(seed=0):
    A = np.random.default_rng(seed).normal(size=(JOINTS, JOINTS))
    return A @ A.T + 0.1 * np.eye(JOINTS)


@pytest.mark.parametrize("seed", range(3))
def test_power_of_the_torques_is_that_of_all_taxels(seed):
    """Torques times joint velocities are the sum of force times velocity of the taxels, by differences."""
    rng, skin = np.random.default_rng(seed), ring_skin()
    q, qd, step = rng.normal(size=JOINTS), rng.normal(size=JOINTS), 1e-6
    power, wrenches, poses, jacobians = 0.0, {}, {}, {}
    for name, last in (("fore", 7), ("upper", 4)):
        forces = np.where(rng.random(12) < 0.4, rng.uniform(0, 20, 12), 0.0)
        (before, _), (after, _) = (chain(q + sign * step * qd, last) for sign in (-1, 1))
        poses[name], jacobians[name] = chain(q, last)
        wrenches[name] = forces @ skin.geometry.wrenches
        for force, p, n in zip(forces, skin.geometry.positions, skin.geometry.normals):
            velocity = (after[:3, :3] @ p + after[:3, 3] - before[:3, :3] @ p - before[:3, 3]) / (2 * step)
            power += -force * (poses[name][:3, :3] @ n) @ velocity
    rows = contact_torques(wrenches, poses, jacobians.__getitem__, JOINTS)
    assert rows.shape == (2, JOINTS)
    assert_allclose(rows.sum(axis=0) @ qd, power, rtol=1e-7)


def test_only_links_in_contact_need_a_jacobian():
    """A wrench that is zero or unknown has no row; several contacts on a link need one Jacobian."""
    asked = []

    def jacobian(link):
        asked.append(link)
        return np.ones((6, JOINTS))

    poses = dict.fromkeys("abcd", np.eye(4))
    wrenches = {
        "a": np.zeros(6),
        "b": np.ones((3, 6)),
        "c": np.full(6, np.nan),
        "d": np.empty((0, 6)),
        "no contacts": [],
    }
    assert contact_torques(wrenches, poses, jacobian, JOINTS).shape == (3, JOINTS) and asked == ["b"]
    assert contact_torques({"a": np.zeros(6)}, {}, jacobian, JOINTS).shape == (0, JOINTS)
    with pytest.raises(ValueError, match=r"Jacobian of 'b' has shape \(6, 7\), expected \(6, 5\)"):
        contact_torques(wrenches, poses, jacobian, 5)
    with pytest.raises(KeyError, match="e"):
        contact_torques({"e": np.ones(6)}, poses, jacobian, JOINTS)


def wall_energy(skin, pose, distance, span, stiffness):
    """Energy of the springs between the taxels, whose normals are along x, and the wall x = distance."""
    gaps = distance - (skin.geometry.positions @ pose[:3, :3].T + pose[:3, 3])[:, 0]
    return 0.5 * stiffness * skin.geometry.areas @ np.clip(span - gaps, 0, None) ** 2


def facing_skin():
    """A flat skin whose normals point along x."""
    y, z = (a.ravel() for a in np.meshgrid((-0.02, 0, 0.02), (-0.01, 0.01)))
    positions = np.column_stack((np.full(6, 0.03), y, z))
    corners = positions[:, None] + 0.01 * np.array([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]])
    return skin_of(cell_patch(positions, np.tile((1.0, 0, 0), (6, 1)), corners))


@pytest.mark.parametrize("kind", ["proximity", "temperature"])
def test_repulsion_is_minus_the_gradient_of_an_energy(kind):
    """Distances to a wall, or temperatures that rise towards it; the energy of the springs is differentiated."""
    skin, q, span, stiffness, steps = facing_skin(), RNG.normal(size=JOINTS), 0.1, 5e4, 1e-6
    start, jacobian = chain(q)
    distance = 0.09

    def energy(q):  # in the frame of the link at the start
        return wall_energy(skin, np.linalg.inv(start) @ chain(q)[0], distance, span, stiffness)

    gradient = [(energy(q + d) - energy(q - d)) / (2 * steps) for d in steps * np.eye(JOINTS)]
    gaps = distance - skin.geometry.positions[:, 0]
    if kind == "proximity":
        wrench = proximity_wrench(skin.geometry, gaps, span, stiffness)
    else:  # 100 K/m: the limit is where the springs begin
        wrench = temperature_wrench(skin.geometry, 50 - 100 * gaps, 50 - 100 * span, stiffness / 100)
    assert np.linalg.norm(wrench) > 1
    torques = contact_torques({"a": wrench}, {"a": start}, lambda _: jacobian, JOINTS)
    assert_allclose(torques.sum(axis=0), -np.array(gradient), rtol=1e-5, atol=1e-6)


def projected(jacobians, M):
    """The projector of eq. 3.10 for the augmented Jacobian, with the inverse that is consistent with the dynamics."""
    J, W = np.concatenate(jacobians), np.linalg.inv(M)
    return np.eye(JOINTS) - J.T @ np.linalg.pinv(J @ W @ J.T, rcond=1e-10, hermitian=True) @ J @ W


@pytest.mark.parametrize("dependent", [False, True])
def test_lower_tasks_do_not_accelerate_higher_ones(dependent):
    """For three tasks; equal to the augmented Jacobian of the thesis, also if two tasks depend on each other."""
    rng, M = np.random.default_rng(3), inertia_matrix()
    J = [rng.normal(size=(m, JOINTS)) for m in (2, 3, 4)]
    if dependent:
        J[1][0] = 2 * J[0][1] - J[0][0]
    torques = rng.normal(size=(3, JOINTS))
    total = prioritized(list(zip(torques, J)), M)
    expected = torques[0] + projected(J[:1], M) @ torques[1] + projected(J[:2], M) @ torques[2]
    assert_allclose(total, expected, atol=1e-9)
    changes = J[0] @ np.linalg.solve(M, total - torques[0])
    assert np.abs(changes).max() < 1e-10
    assert np.abs(J[0] @ np.linalg.solve(M, torques[1] + torques[2])).max() > 0.1  # without priorities they would


def test_units_of_a_jacobian_have_no_effect():
    """Millimetres in some rows and metres in others block the same motions."""
    rng, M = np.random.default_rng(4), inertia_matrix(1)
    J, torques = rng.normal(size=(3, JOINTS)), rng.normal(size=(2, JOINTS))
    rows = np.zeros((0, JOINTS))
    plain = prioritized([(torques[0], J), (torques[1], rows)], M)
    scaled = prioritized([(torques[0], J * [[1e3], [1], [1e-3]]), (torques[1], rows)], M)
    assert_allclose(plain, scaled, atol=1e-9)


def test_tasks_without_rows_or_torque():
    """An empty task blocks nothing, a row of zeros neither; no task gives no torque."""
    torques, M = RNG.normal(size=(3, JOINTS)), inertia_matrix(2)
    free = np.zeros((0, JOINTS)), np.zeros((1, JOINTS)), np.zeros((0, JOINTS))
    assert_allclose(prioritized(zip(torques, free), M), torques.sum(axis=0), atol=1e-12)
    assert_allclose(prioritized([], M), np.zeros(JOINTS))
    full = [(torques[0], np.eye(JOINTS)), (torques[1], np.eye(JOINTS))]
    assert_allclose(prioritized(full, M), torques[0], atol=1e-12)
    with pytest.raises(ValueError, match="does not fit 7 joints"):
        prioritized([(torques[0][:5], np.eye(5))], M)
    with pytest.raises(ValueError, match="values that are not finite"):
        prioritized([(torques[0], np.full((1, JOINTS), np.nan)), (torques[1], np.eye(JOINTS))], M)


def test_task_that_yields_is_blocked_along_its_wrenches_only():
    """With the rows of contacts as Jacobian, a lower task does not accelerate the links along these wrenches."""
    q, M = RNG.normal(size=JOINTS), inertia_matrix(5)
    pose, jacobian = chain(q)
    wrenches = RNG.normal(size=(2, 6))
    rows = contact_torques({"a": wrenches}, {"a": pose}, lambda _: jacobian, JOINTS)
    lower = RNG.normal(size=JOINTS)
    total = prioritized([(rows.sum(axis=0), rows), (lower, np.eye(JOINTS))], M)
    assert np.abs(rows @ np.linalg.solve(M, total - rows.sum(axis=0))).max() < 1e-9
    assert np.linalg.norm(total - rows.sum(axis=0)) > 0.1


def test_mujoco_applies_the_same_torques():
    """Generalized forces of a force at a point, by MuJoCo."""
    mujoco = pytest.importorskip("mujoco")
    bodies = "".join(
        f'<body pos="{" ".join(map(str, o))}"><joint axis="{" ".join(map(str, a))}"/><geom size=".05"/>'
        for o, a in zip(OFFSETS, AXES)
    )
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}{'</body>' * JOINTS}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    data.qpos[:] = q = RNG.normal(size=JOINTS)
    mujoco.mj_forward(model, data)
    pose, _ = chain(q)
    assert_allclose(data.xpos[JOINTS], pose[:3, 3], atol=1e-9)
    point, force, expected = RNG.normal(size=3), RNG.normal(size=3), np.zeros(JOINTS)  # in the link frame
    R, p = data.xmat[JOINTS].reshape(3, 3), data.xpos[JOINTS]
    mujoco.mj_applyFT(model, data, R @ force, np.zeros(3), R @ point + p, JOINTS, expected)
    J = np.zeros((6, JOINTS))
    mujoco.mj_jac(model, data, J[:3], J[3:], p, JOINTS)
    wrench = np.concatenate((force, np.cross(point, force)))
    assert_allclose(contact_torques({"a": wrench}, {"a": pose}, lambda _: J, JOINTS)[0], expected, atol=1e-9)


def test_pinocchio_agrees_on_torques_and_accelerations():
    """Inverse dynamics with an external force; forward dynamics shows which torque accelerates the hand."""
    pin = pytest.importorskip("pinocchio", reason="the package pin is not installed")
    model = pin.buildSampleModelManipulator()
    data, rng = model.createData(), np.random.default_rng(6)
    q, zero, joint = rng.uniform(-1, 1, model.nq), np.zeros(model.nv), model.njoints - 1
    wrench = rng.normal(size=6)
    forces = pin.StdVec_Force()
    forces.extend([pin.Force.Zero() for _ in range(joint)] + [pin.Force(wrench)])
    expected = pin.rnea(model, data, q, zero, zero).copy() - pin.rnea(model, data, q, zero, zero, forces)
    pin.computeJointJacobians(model, data, q)
    J = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
    pose = data.oMi[joint].homogeneous
    rows = contact_torques({"hand": wrench}, {"hand": pose}, lambda _: J, model.nv)
    assert_allclose(rows[0], expected, atol=1e-9)
    M = pin.crba(model, data, q)
    M = np.triu(M) + np.triu(M, 1).T
    first, second = rng.normal(size=(2, model.nv))
    both = prioritized([(first, J[:3]), (second, np.eye(model.nv))], M)
    bias = pin.rnea(model, data, q, zero, zero).copy()
    accelerations = [J[:3] @ pin.aba(model, data, q, zero, bias + torque) for torque in (first, both)]
    assert_allclose(accelerations[0], accelerations[1], atol=1e-9)
    assert np.linalg.norm(both - first) > 0.1


def test_attraction_is_limited_and_ends_at_the_goal():
    """Far away the point gets the largest speed, near the goal it is a spring with a damper."""
    goal, position, velocity = np.array((1.0, 2)), np.zeros(2), np.array((0.3, -0.1))
    assert_allclose(attraction(position, velocity, goal, 50, 10), 50 * (goal - position) - 10 * velocity)
    still = attraction(position, np.zeros(2), goal, 50, 10, max_speed=0.2)
    assert_allclose(np.linalg.norm(still), 10 * 0.2)
    at_speed = attraction(position, 0.2 * goal / np.linalg.norm(goal), goal, 50, 10, max_speed=0.2)
    assert_allclose(at_speed, 0, atol=1e-12)
    assert_allclose(attraction(goal, np.zeros(2), goal, 50, 10, 0.2), 0)


@pytest.mark.parametrize("period", [1e-3, 4e-3, 1.0])
def test_resolver_loses_energy_and_follows_a_constant_torque(period):
    """Energy never increases by more than the power of the torque; the speed ends at torque over damping."""
    rng, M = np.random.default_rng(7), inertia_matrix(3)
    resolver = TorqueResolver(np.zeros(JOINTS), 0.5)
    for torque in (*rng.normal(size=(30, JOINTS)), *np.zeros((30, JOINTS))):
        before = 0.5 * resolver.velocities @ M @ resolver.velocities
        resolver.step(torque, M, period)
        after = 0.5 * resolver.velocities @ M @ resolver.velocities
        assert after - before <= period * torque @ resolver.velocities + 1e-12
    torque = rng.normal(size=JOINTS)
    for _ in range(2000):
        resolver.step(torque, M, 1.0)
    assert_allclose(resolver.velocities, torque / 0.5, rtol=1e-6)


def test_damping_is_the_weight_where_it_decides_the_motion():
    """With the damping as weight a lower torque gives the hand no lasting velocity; with the inertia it does."""
    rng, M, damping = np.random.default_rng(8), inertia_matrix(4), np.linspace(1, 4, JOINTS)
    J, lower, none = rng.normal(size=(3, JOINTS)), rng.normal(size=JOINTS), np.zeros(JOINTS)
    speeds = []
    for weight in (np.diag(damping), M):
        resolver = TorqueResolver(none, damping)
        torque = prioritized([(none, J), (lower, np.eye(JOINTS))], weight)
        for _ in range(500):
            resolver.step(torque, M, 1.0)
        assert np.linalg.norm(resolver.velocities) > 0.1
        speeds.append(np.linalg.norm(J @ resolver.velocities))
    assert speeds[0] < 1e-9 < 0.05 < speeds[1]


def test_joint_that_stops_at_a_limit_gives_the_others_no_energy():
    """Its impulse stops it alone: the momentum of the others is kept, and energy is lost."""
    rng, M, limits = np.random.default_rng(9), inertia_matrix(5), np.full((JOINTS, 2), (-0.05, 0.05))
    resolver = TorqueResolver(np.zeros(JOINTS), 1e-6, limits)
    resolver.velocities = rng.normal(size=JOINTS)
    stops = 0
    for _ in range(200):
        before = resolver.velocities.copy()
        angles = resolver.step(np.zeros(JOINTS), M, 4e-3)
        after, at_limit = resolver.velocities, np.abs(angles) == 0.05
        stops += bool((at_limit & (before != 0) & (after == 0)).any())
        assert after @ M @ after <= before @ M @ before + 1e-12
        assert_allclose((M @ after)[~at_limit], (M @ before)[~at_limit], atol=1e-5)
    assert stops > 1


def test_resolver_stops_at_a_limit():
    """A joint at its limit has no velocity, and leaves it when the torque turns."""
    resolver = TorqueResolver([0.0, 0.0], [1.0, 1.0], [[-0.1, 0.1], [-1, 1]])
    for _ in range(500):
        angles = resolver.step([5.0, 1.0], np.eye(2), 1e-3)
    assert angles[0] == 0.1 and resolver.velocities[0] == 0 and 0 < angles[1] < 1
    assert resolver.step([-5.0, 0.0], np.eye(2), 1e-3)[0] < 0.1


ONE, NAN = np.ones(6), np.full((6, 2), np.nan)


@pytest.mark.parametrize(
    ("call", "problem"),
    [
        (lambda: attraction([0.0], [0.0], [1.0], 10.0, 0.0), "damping 0.0 must be above zero"),
        (lambda: attraction([0.0], [0.0], [1.0], np.inf, 1.0), "stiffness inf and"),
        (lambda: attraction([0.0], [0.0], [np.nan], 10.0, 1.0), "the goal has values that are not finite"),
        (lambda: attraction([0.0], [0.0], [1.0, 1.0], 10.0, 1.0), r"the goal has shape \(2,\), expected \(1,\)"),
        (lambda: contact_torques({"arm": ONE}, {"arm": np.eye(4)}, lambda _: NAN, 2), "Jacobian or the pose of 'arm'"),
        (lambda: contact_torques({"arm": ONE}, {"arm": NAN[:4, :1]}, lambda _: NAN, 2), r"pose of 'arm' has shape \(4"),
        (lambda: prioritized([([1.0, 1.0], np.ones((2, 1, 2)))], np.eye(2)), "does not fit 2 joints"),
        (lambda: prioritized([([1.0, 1.0], 3.0)], np.eye(2)), "does not fit 2 joints"),
        (lambda: prioritized([([1.0, 1.0], np.eye(2))], np.full((2, 2), np.nan)), "inertia matrix has values"),
        (lambda: prioritized([([1.0, 1.0], np.eye(2))], [[2.0, 1.0], [0.0, 2.0]]), "one triangle only"),
        (lambda: attraction([0.0], [0.0], [1.0], 10.0, 1.0, -0.1), "speed -0.1 not below"),
        (lambda: contact_torques({"arm": None}, {}, pytest.fail, 2), r"wrench of 'arm' has shape \(\)"),
        (lambda: contact_torques({"arm": [1.0] * 12}, {}, pytest.fail, 2), r"wrench of 'arm' has shape \(12,\)"),
        (lambda: prioritized([([1.0, np.nan], np.eye(2))], np.eye(2)), "torque that is not a finite number"),
        (lambda: TorqueResolver([2.0], 1.0, [[-1.0, 1.0]]), "are not within the limits"),
        (lambda: TorqueResolver([0.0], 1.0, [[1.0, -1.0]]), "are not within the limits"),
        (lambda: TorqueResolver([0.0, 0.0], 1.0, [[-1.0, 1.0]]), r"limits have shape \(1, 2\), expected \(2, 2\)"),
        (lambda: TorqueResolver([0.0], -1.0), "no damping may be below zero"),
        (lambda: TorqueResolver([np.nan], 1.0), "must be finite"),
    ],
)
def test_wrong_values_are_refused(call, problem):
    """They gave NaN in all joints, a jump to the limit, or a force away from the goal."""
    with pytest.raises(ValueError, match=problem):
        call()


def test_resolver_keeps_its_state_if_a_torque_is_not_known():
    """One NaN made all angles NaN for ever."""
    resolver = TorqueResolver([0.1, 0.2], 1.0)
    resolver.step([1.0, 0.0], np.eye(2), 1e-3)
    angles, velocities = resolver.angles.copy(), resolver.velocities.copy()
    with pytest.raises(ValueError, match="not finite"):
        resolver.step([np.nan, 0.0], np.eye(2), 1e-3)
    assert np.array_equal(resolver.angles, angles) and np.array_equal(resolver.velocities, velocities)


@pytest.mark.parametrize(
    ("torque", "inertia", "period", "problem"),
    [
        (1.0, np.eye(2), 1e-3, r"torque has shape \(\), expected \(2,\)"),
        ([[1.0], [1.0]], np.eye(2), 1e-3, r"torque has shape \(2, 1\)"),
        ([1.0, 0.0], [1.0, 1.0], 1e-3, r"inertia matrix has shape \(2,\), expected \(2, 2\)"),
        ([1.0, 0.0], np.full((2, 2), np.nan), 1e-3, "inertia matrix has values that are not finite"),
        ([1.0, 0.0], [[2.0, 1.0], [0.0, 2.0]], 1e-3, "not symmetric"),
        ([1.0, 0.0], np.eye(2), np.nan, "period must be zero or more and finite, not nan"),
        ([1.0, 0.0], np.eye(2), -1e-3, "period must be zero or more"),
    ],
)
def test_resolver_keeps_its_state_if_it_is_called_wrongly(torque, inertia, period, problem):
    """One number moved all joints, half of a matrix gave another inertia, and NaN stayed in the angles for ever."""
    resolver = TorqueResolver([0.1, 0.2], 1.0)
    with pytest.raises(ValueError, match=problem):
        resolver.step(torque, inertia, period)
    np.testing.assert_array_equal(resolver.angles, [0.1, 0.2])
    np.testing.assert_array_equal(resolver.velocities, [0.0, 0.0])


@given(rows=arrays(float, (5, JOINTS), elements=st.sampled_from([-1.0, 0.0, 1e-9, 0.5, 2.0])), split=st.integers(0, 5))
def test_singular_tasks_have_finite_torques_that_do_not_accelerate_higher_ones(rows, split):
    """Rows of zeros, equal rows, and rows that depend on each other, in one task and in several."""
    M, torques = inertia_matrix(6), np.random.default_rng(0).normal(size=(3, JOINTS))
    tasks = list(zip(torques, (rows[:split], rows[split:], np.eye(JOINTS))))
    total = prioritized(tasks, M)
    assert np.isfinite(total).all()
    inverse = np.linalg.inv(np.linalg.cholesky(M))
    lower, scaled = inverse @ (total - torques[0]), rows[:split] @ inverse.T
    sizes = np.linalg.norm(scaled, axis=1, keepdims=True)
    directions = scaled[sizes[:, 0] > 0] / sizes[sizes > 0, None]
    changes = np.linalg.norm(directions @ lower) / (np.linalg.norm(lower) + 1e-12)
    assert changes <= 1.001 * MIN_MOBILITY + 1e-9
