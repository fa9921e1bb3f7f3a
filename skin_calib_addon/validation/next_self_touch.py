"""Which touch of a robot on itself would say most next."""

from dataclasses import dataclass, replace

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray
from ..robot.kinematics import carried
from ..robot.urdf import Robot
from .self_touch import SelfTouch
from .self_touch_model import Model
from .self_touch_session import Felt, Session, Tip

CANDIDATES = 600  # postures that are tried. Larger: better touches, more time.
SEARCH_STEPS = 60  # of a posture that touches. Larger: finds more of them, more time.
DAMPING = 0.02  # [m] of a step. Larger: slower convergence. Smaller: oscillates at stretched arms.
MAX_STEP = 0.3  # [rad, m] per joint. Larger: oscillates.
MAX_MISS = 5e-4  # [m] between tip and taxel. Larger: accepts postures that do not touch.
# [1] Cosine of the angle between the normal and the direction to the hand. Larger: steeper touches.
MIN_INCIDENCE = 0.3
# [1] Parts of the line from the tip to the origin of its link, or of the one that carries it, that have to be outside
# of the skins of the touched link. More: misses fewer of them.
PARTS = (0.3, 0.6, 1.0)
MIN_LENGTH = 0.02  # [m] of this line. Larger: also looks at links that carry a short one.
MARGIN = 0.05  # [1] of the range of a joint that stays free at its limits. Larger: fewer postures.
USUAL_RANGE = np.pi  # [rad, m] either side of zero, of a joint without limits


@dataclass(frozen=True)
class NextSelfTouch:
    """A touch that the robot can make."""

    tip: Tip
    link: str
    taxel: str
    positions: dict[str, float]  # of the joints, as the session has them [rad] or [m]
    information: float  # logarithm of the factor by which it reduces the volume of the uncertainty [1]


def next_touches(found: SelfTouch, count: int = 1, seed: int = 0) -> tuple[NextSelfTouch, ...]:
    """Return the touches that reduce the uncertainty of all unknowns most, one after the other (D-optimal, greedy).

    They are random postures within the limits of the joints from which the tip was moved to a taxel, with the offsets
    that the touches have shown. The tip comes from outside of the skin. Collisions of other links are not examined.

    Parameters
    ----------
    found : SelfTouch
        What previous touches showed.
    count : int
        Largest number of touches.
    seed : int
        Of the random postures.

    Returns
    -------
    tuple of NextSelfTouch
        Empty if no posture was found.
    """
    model = found.model
    session = _candidates(found, np.random.default_rng(seed))
    if session is None:
        return ()
    model = Model(model.robot, session, model.unknowns)
    positions, is_possible = _touching(model, found.values)
    _, slopes = model.linearized(found.values, positions)
    usual = np.median(found.model.sigmas * found.scales[found.model.classes], axis=0)
    slopes = slopes / usual[:, None]
    covariance, chosen = found.covariance, list[NextSelfTouch]()
    for _ in range(count):
        spread = np.eye(3) + slopes @ covariance @ np.swapaxes(slopes, 1, 2)
        gains = np.where(is_possible, np.linalg.slogdet(spread)[1] / 2, -np.inf)
        best = int(gains.argmax())
        if not np.isfinite(gains[best]):
            break
        felt, tip = session.felt[best], session.bodies[best]
        assert isinstance(tip, Tip)
        link, patch = session.patches[felt.patch]
        at = {name: float(values[best]) for name, values in positions.items()}
        chosen.append(NextSelfTouch(tip, link, patch.taxels.ids[felt.rows[0]], at, float(gains[best])))
        gain = covariance @ slopes[best].T
        covariance = covariance - gain @ np.linalg.solve(spread[best], gain.T)
        is_possible[best] = False
    return tuple(chosen)


def _candidates(found: SelfTouch, rng: np.random.Generator) -> Session | None:
    """Return touches of random taxels by the tips, in random postures in which they do not touch yet."""
    model, session = found.model, found.model.session
    known = {str(u.owner) for u in model.unknowns if u.kind in ("joint", "slide")}
    pairs = [
        (k, tip)
        for k, (link, _) in enumerate(session.patches)
        for tip in model.tips
        if found.of_patch(k) and (moving := model.moving(link, tip.link)) and known.issuperset(moving)
    ]
    if not pairs:
        return None
    sizes = np.array([np.sqrt(session.patches[k][1].taxels.areas.sum()) for k, _ in pairs])
    picked = [pairs[k] for k in rng.choice(len(pairs), CANDIDATES, p=sizes / sizes.sum())]
    felt = tuple(Felt(k, (int(rng.integers(len(session.patches[k][1].taxels.ids))),), (1.0,)) for k, _ in picked)
    low, high = _limits(model.robot, session)
    positions = {name: np.full(CANDIDATES, np.median(values)) for name, values in session.positions.items()}
    for name in sorted(known & set(positions)):
        positions[name] = rng.uniform(low[name], high[name], CANDIDATES)
    return replace(
        session, positions=positions, felt=felt, bodies=tuple(tip for _, tip in picked), lines=np.arange(CANDIDATES)
    )


def _limits(robot: Robot, session: Session) -> tuple[dict[str, float], dict[str, float]]:
    """Return the lower and upper limits of joints, with a margin."""
    limits = {name: robot.joints[name].limits or (-USUAL_RANGE, USUAL_RANGE) for name in session.positions}
    limits = {name: at if at[0] < at[1] else (-USUAL_RANGE, USUAL_RANGE) for name, at in limits.items()}
    low = {name: a + MARGIN * (b - a) for name, (a, b) in limits.items()}
    return low, {name: b - MARGIN * (b - a) for name, (a, b) in limits.items()}


def _touching(model: Model, values: Array) -> tuple[dict[str, Array], BoolArray]:
    """Return positions of joints in which the tips are at the taxels, and which of these touches are possible."""
    columns = {u.owner: k for k, u in enumerate(model.unknowns) if u.kind in ("joint", "slide")}
    positions = model.session.positions
    names = [name for name in positions if name in columns]
    places = [columns[name] for name in names]
    low, high = (np.array([limits[name] for name in names]) for limits in _limits(model.robot, model.session))
    at = np.stack([positions[name] for name in names], axis=1)
    for _ in range(SEARCH_STEPS):
        residuals, slopes = model.linearized(values, positions)
        moves = slopes[:, :, places]
        squares = moves @ np.swapaxes(moves, 1, 2) + DAMPING**2 * np.eye(3)
        steps = -np.einsum("nij,ni->nj", moves, np.linalg.solve(squares, residuals[..., None])[..., 0])
        at = np.clip(at + np.clip(steps, -MAX_STEP, MAX_STEP), low, high)
        positions = positions | dict(zip(names, at.T))
    misses = np.linalg.norm(model.linearized(values, positions)[0], axis=1)
    return positions, (misses < MAX_MISS) & _from_outside(model, positions)


def _from_outside(model: Model, positions: dict[str, Array]) -> BoolArray:
    """Whether each tip (n,) comes from outside: the line to its link does not go through skins of the touched link."""
    session, out = model.session, np.zeros(len(model.session.lines), bool)
    pairs = [(felt.patch, body) for felt, body in zip(session.felt, session.bodies)]
    for k, tip in dict.fromkeys(pairs):
        assert isinstance(tip, Tip)
        mine = np.array([i for i, pair in enumerate(pairs) if pair == (k, tip)])
        link, patch = session.patches[k]
        own = {name: values[mine] for name, values in positions.items()}
        to_link = np.linalg.inv(carried(model.robot, link, own)[0])
        frame = to_link @ carried(model.robot, tip.link, own)[0]
        ends, starts, base = (frame @ np.append(tip.position, 1.0))[:, :3], frame[:, :3, 3], tip.link
        while base in model.robot.parents and np.linalg.norm(starts - ends, axis=1).min() < MIN_LENGTH:
            base = model.robot.parents[base]
            starts = (to_link @ carried(model.robot, base, own)[0])[:, :3, 3]
        arms, rows = starts - ends, [session.felt[i].rows[0] for i in mine]
        heights = (arms * patch.taxels.normals_link[rows]).sum(axis=1)
        is_free = heights > MIN_INCIDENCE * np.linalg.norm(arms, axis=1)
        for other in (other.taxels for name, other in session.patches if name == link):
            for part in PARTS:
                is_free &= _outside(other.positions_link, other.normals_link, ends + part * arms)
        out[mine] = is_free
    return out


def _outside(positions: Array, normals: Array, points: Array) -> BoolArray:
    """Whether points (n, 3) are on the outer side of the nearest taxel."""
    nearest: IntArray = (((points[:, None] - positions) ** 2).sum(axis=2)).argmin(axis=1)
    return np.asarray(((points - positions[nearest]) * normals[nearest]).sum(axis=1) > 0)
