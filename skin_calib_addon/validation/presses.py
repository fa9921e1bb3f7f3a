"""Which rows of a recording belong to which press: all rows of a press are one touch."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..common.arrays import Array, BoolArray, IntArray, usual_size
from ..common.tables import TableError
from .tool import ToolRows

# [s] at the start of a recording without contact. Larger: less noise of the tare, longer waiting.
REST_TIME = 1.0
MIN_REST_ROWS = 10  # in this time. Larger: refuses slow recordings.
MIN_PRESS_TIME = 0.2  # [s] Larger: misses short presses. Smaller: takes bumps for presses.
LOW_PASS = 5.0  # [Hz] of the total force. Larger: more noise. Smaller: presses must be farther apart.
PRESS_SIGMA = 5.0  # [standard deviations at rest] of a press. Larger: misses light presses.
# [fraction of the largest force] of a press. Larger: misses light presses. Smaller: takes drift for presses.
MIN_PRESS_FORCE = 0.03
# [fraction of the largest force] Difference of the forces at rest that lasts as long as a press, and is one; and depth
# below rest, in ``MAX_BELOW`` of the rows, that shows a press at rest. Larger: takes readings of a press for those at
# rest; smaller: refuses weak presses, and sensors that drift.
MAX_REST_FORCE = 0.2
MAX_BELOW = 0.25  # [fraction of the rows] Larger: misses presses at rest; smaller: refuses taxels that are lost.
# [fraction of the rows] whose largest differences show whether readings rise or fall with force. Larger: rows without
# valid readings decide; smaller: misses rare presses.
USUAL_ROWS = 0.99
# [fraction of the rows] after the first second with its force. Larger: warns of short pauses.
MIN_FREE = 0.1
MAX_NUMBER = 10**9  # of a press. Larger: no effect.
PLATEAU = 0.8  # [fraction of the largest force of a press] from which on rows count. Larger: fewer rows.
# [fraction of the force of the weaker press] down to which the force falls between two presses. Larger: a press of
# changing force is several. Smaller: presses without a pause are one.
MAX_PAUSE_FORCE = 0.5
# [m] Successive rows of one taxel that are nearer than this to their mean are one press, if nothing else separates
# presses. Larger: touches next to each other become one. Smaller: noise makes several of one.
SAME_PLACE = 2e-3


AGAIN = f"Record {REST_TIME:g} s without contact, then the presses, or number them"


@dataclass(frozen=True, eq=False)
class Recorded:
    """Rows of a file in SI units; None where the file has no such columns."""

    lines: IntArray  # (n,) of the file
    taxels: Array  # (n,) ids of the taxels with the largest reading
    points: Array | None  # (n, 3) [m]
    wrenches: Array | None  # (n, 6) [N, N m]
    readings: Array  # (n, k)
    times: Array | None  # (n,) not decreasing [s]
    presses: Array | None  # (n,) numbers; negative between presses
    tool: ToolRows | None = None  # whose origins are the points


@dataclass(frozen=True, eq=False)
class Presses:
    """Rows of a file, tared if they have a time, and their presses."""

    recorded: Recorded
    numbers: IntArray  # (n,) of the press of each row; negative between presses
    rest: Array | None = None  # (k,) readings without contact, which are subtracted; None: not known
    sign: int = 1  # -1: readings fall with force, and are the negative of those in the file
    force_noise: float | None = None  # of a press, per axis [N]; None: not known
    notes: tuple[str, ...] = ()  # what a person should know of them


def find_presses(recorded: Recorded, centres: dict[str, Array]) -> Presses:
    """Return the presses by their numbers in the file, or else by the total force over time, or else by position."""
    if recorded.presses is not None:
        numbers = _given(recorded.presses, recorded.lines)
        return _tared(recorded, numbers, np.arange(len(numbers)) < int(np.argmax(numbers >= 0)))
    has_force = recorded.wrenches is not None or recorded.readings.shape[1] > 0
    if recorded.times is not None and has_force:
        return _by_force(recorded, recorded.times)
    return Presses(recorded, _by_place(recorded, centres))


def _given(presses: Array, lines: IntArray) -> IntArray:
    """Return the numbers of the presses in a file, whose rows have to follow each other."""
    wrong = np.flatnonzero((np.rint(presses) != presses) | (np.abs(presses) > MAX_NUMBER))
    if len(wrong):
        message = f"the number of the press is {presses[wrong[0]]:g}, which is no integer up to {MAX_NUMBER}"
        raise TableError(int(lines[wrong[0]]), message)
    numbers = presses.astype(np.int64)
    pressed = np.flatnonzero(numbers >= 0)
    if not len(pressed):
        raise TableError(int(lines[0]), 'no row has a number in the column "press"')
    starts = pressed[np.flatnonzero(np.diff(numbers[pressed], prepend=-1))]
    _, firsts = np.unique(numbers[starts], return_index=True)
    if again := sorted({*range(len(starts))} - {*firsts.tolist()}):
        row = starts[again[0]]
        message = f"press {numbers[row]} has rows above, before those of other presses. Give each press its own number"
        raise TableError(int(lines[row]), message)
    return numbers


def _tared(recorded: Recorded, numbers: IntArray, at_rest: BoolArray) -> Presses:
    """Subtract the medians at rest, if enough rows are. Readings that are then mostly below zero fall with force."""
    if at_rest.sum() < MIN_REST_ROWS:
        return Presses(recorded, numbers)
    rest, wrenches = np.median(recorded.readings[at_rest], axis=0), recorded.wrenches
    readings = recorded.readings - rest
    if wrenches is not None:
        wrenches = wrenches - np.median(wrenches[at_rest], axis=0)
    sign = 1
    if readings.size:
        rise, fall = (np.quantile(most, USUAL_ROWS) for most in (readings.max(axis=1), -readings.min(axis=1)))
        sign = -1 if fall > rise else 1
        noise = 1.4826 * np.median(np.abs(readings[at_rest]), axis=0)
        limits = np.maximum(MAX_REST_FORCE * max(rise, fall), PRESS_SIGMA * noise)
        off = (np.abs(readings) > limits)[~at_rest].mean(axis=0)
        if min(rise, fall) > MAX_REST_FORCE * max(rise, fall) and off.max(initial=0.0) > MAX_BELOW:
            message = f"{off.max():.0%} of the rows have readings below those at rest, and others above"
            raise TableError(int(recorded.lines[0]), f"{message}: the skin was pressed at rest. {AGAIN}")
    return Presses(replace(recorded, readings=sign * readings, wrenches=wrenches), numbers, rest, sign)


def _by_place(recorded: Recorded, centres: dict[str, Array]) -> IntArray:
    """Return a number for each run of rows of one taxel at one position."""
    places = places_of(recorded, np.arange(len(recorded.lines)), recorded.taxels.tolist(), centres)
    numbers = np.zeros(len(places), np.int64)
    taxels = recorded.taxels.tolist()
    first = 0  # of the press
    middle = places[0]
    for k in range(1, len(places)):
        is_same = taxels[k] == taxels[first]
        if is_same and _is_far(places[k], middle):  # a single row can be noise
            is_same = k + 1 < len(places) and taxels[k + 1] == taxels[first] and not _is_far(places[k + 1], middle)
        numbers[k] = numbers[k - 1] + (not is_same)
        if is_same:
            middle = middle + (places[k] - middle) / (k - first + 1)
        else:
            first, middle = k, places[k]
    return numbers


def places_of(recorded: Recorded, rows: IntArray, taxels: Sequence[str], centres: dict[str, Array]) -> Array:
    """Return the points (n, 3) of rows, or those of their lines of action nearest to the centres of taxels (n,) [m]."""
    if recorded.points is not None:
        return recorded.points[rows]
    assert recorded.wrenches is not None
    forces, moments = recorded.wrenches[rows, :3], recorded.wrenches[rows, 3:]
    squares = np.maximum((forces**2).sum(axis=1), np.finfo(float).tiny)[:, None]
    points = np.cross(forces, moments) / squares
    arms = np.array([centres[name] for name in taxels]) - points
    return np.asarray(points + ((arms * forces).sum(axis=1)[:, None] / squares) * forces)


def _is_far(place: Array, middle: Array) -> bool:
    return bool(((place - middle) ** 2).sum() > SAME_PLACE**2)


def _by_force(recorded: Recorded, times: Array) -> Presses:
    """Find the presses of a recording by its total force, and tare its wrenches and readings."""
    line = int(recorded.lines[0])
    at_rest = times - times[0] < REST_TIME
    if at_rest.sum() < MIN_REST_ROWS:
        message = f"the first {REST_TIME:g} s have {at_rest.sum()} rows, which are too few for a tare"
        raise TableError(line, f"{message}. Record {MIN_REST_ROWS} rows without contact, or number the presses")
    numbers = np.full(len(times), -1, np.int64)
    tared = _tared(recorded, numbers, at_rest)
    wrenches, noise, total = tared.recorded.wrenches, None, tared.recorded.readings.sum(axis=1)
    if wrenches is not None:
        noise = float(np.sqrt((wrenches[at_rest, :3] ** 2).mean()))
        total = np.linalg.norm(wrenches[:, :3], axis=1)
    smooth = _low_pass(total, times)
    rest = smooth[at_rest]
    usual = float(np.median(rest))
    sigma = float(usual_size(rest - usual))
    limit = usual + max(PRESS_SIGMA * sigma, MIN_PRESS_FORCE * float(smooth.max() - usual))
    count, sizes = 0, []
    runs = (part for run in _runs(smooth > limit) for part in _parts(smooth - usual, *run, limit - usual))
    for first, last in runs:
        if times[last] - times[first] < MIN_PRESS_TIME:
            continue
        rows = np.arange(first, last + 1)
        rows = rows[smooth[rows] - usual >= PLATEAU * (smooth[rows].max() - usual)]
        numbers[rows] = count
        count += 1
        sizes.append(len(rows))
    is_off = np.abs(rest - usual) > MAX_REST_FORCE * float(smooth.max() - usual)  # the median may be that of a press
    is_pressed = any(times[last] - times[first] >= MIN_PRESS_TIME for first, last in _runs(is_off))
    if is_pressed or count == 0 or (numbers[at_rest] >= 0).any():
        message = "no press was found" if count == 0 and not is_pressed else "the skin is pressed in the first second"
        raise TableError(line, f"{message}. {AGAIN}")
    notes = []
    if (free := float((smooth <= limit)[~at_rest].mean())) < MIN_FREE:
        what = f"the total force is that of the first {REST_TIME:g} s in {free:.0%} of the later rows"
        notes.append(f"{what}: something pressed in it, or presses have no pauses. {AGAIN}")
    of_medians = None if noise is None else noise * float(np.sqrt(np.pi / 2 / np.median(sizes)))
    return replace(tared, force_noise=of_medians, notes=tuple(notes))


def _runs(is_on: BoolArray) -> list[tuple[int, int]]:
    """Return the first and last row of each run."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], is_on, [False])).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]


def _parts(force: Array, first: int, last: int, step: float) -> Iterator[tuple[int, int]]:
    """Yield the first and last row of each press of a run: between them the force falls and rises by ``step`` or more.

    It falls below a fraction of both presses, too.
    """
    peak, low = first, first  # rows of the largest force so far, and of the smallest after it
    for k in range(first, last + 1):
        if force[k] < force[low]:
            low = k
        rise = min(force[peak], force[k])
        if force[low] < MAX_PAUSE_FORCE * rise and rise - force[low] >= step and peak < low < k:
            yield first, low
            first, peak, low = low + 1, k, k
        if force[k] >= force[peak]:
            peak = low = k
    yield first, last


def _low_pass(values: Array, times: Array) -> Array:
    """Return values after a low pass of first order, forwards and backwards."""
    out = values.astype(float)
    gains = 1 - np.exp(-2 * np.pi * LOW_PASS * np.diff(times))
    for order in (range(1, len(out)), range(len(out) - 2, -1, -1)):
        step = -1 if order.step == 1 else 1
        for k in order:
            out[k] = out[k + step] + gains[min(k, k + step)] * (out[k] - out[k + step])
    return out
