"""The runtime agrees with a slow implementation that keeps its complete history, for any sequence of inputs."""

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule
from numpy.testing import assert_allclose

from tests.examples import examples
from tests.oracles import felt
from tests.soles import field_patch, skin_of

ROWS, COLUMNS = 4, 5
N = ROWS * COLUMNS


class Sequences(RuleBasedStateMachine):
    """Frames, invalid frames, masks, baselines, and arbitrary times."""

    def __init__(self):
        super().__init__()
        self.skin, self.time = skin_of(field_patch(ROWS, COLUMNS)), 0.0
        self.on = [False] * N
        self.masked, self.baseline = set(), np.zeros(N)
        self.used, self.last = set(), {}
        self.frame = None
        self.is_lost = False  # whether time went back or jumped in the frames without a known taxel

    def expected(self, reading):
        """Return the force of each taxel and whether it is known, one by one."""
        forces, known = [], []
        for i in range(N):
            force = max(reading[i] - self.baseline[i], 0.0)
            known.append(i not in self.masked and bool(np.isfinite(reading[i])) and force <= 1e6)
            forces.append(force if known[i] else 0.0)
        return forces, known

    @rule(
        reading=st.lists(st.sampled_from([0.0, 0.05, 0.12, 0.15, 0.19, 0.3, 2.0, 50.0]), min_size=N, max_size=N),
        missing=st.sets(st.integers(0, N - 1), max_size=3),
        gap=st.sampled_from([0.001, 0.001, 0.004, 0.0, 5.0, -1.0]),
    )
    def update_with_frame(self, reading, missing, gap):
        """Update with a frame in which some taxels have no number."""
        reading = np.array([np.nan if i in missing else x for i, x in enumerate(reading)])
        self.frame = self.skin.update(reading, self.time + gap)
        fresh = self.is_lost or bool({"time_back", "time_jump"} & self.frame.flags)
        forces, known = self.expected(reading)
        self.time += gap
        self.is_lost = fresh and not any(known)
        if not any(known):
            assert self.frame.touched is None
            return
        on = []
        for i in range(N):
            held = self.on[i] and not fresh
            on.append(forces[i] >= (0.1 if held else 0.2) if known[i] else held)
        self.on = on
        active = [known[i] and on[i] for i in range(N)]
        wrench, contacts = felt(self.skin, forces, active)
        assert self.frame.active.tolist() == active and self.frame.known.tolist() == known
        if self.frame.problem is None:
            assert_allclose(self.frame.wrench, wrench, rtol=1e-9, atol=1e-12)
        else:  # a taxel without a reading may carry too much
            assert not all(known) and np.isnan(self.frame.wrench).all() and "lost" in self.frame.flags
        assert {frozenset(c.taxels.tolist()) for c in self.frame.contacts} == set(contacts)
        for contact in self.frame.contacts:
            force, position = contacts[frozenset(contact.taxels.tolist())]
            assert_allclose(contact.force, force, rtol=1e-9)
            assert_allclose(contact.position, position, rtol=1e-9, atol=1e-12)  # a flat skin: the mean is on it
        self.numbers(fresh)

    def numbers(self, fresh):
        """Check the numbers.

        Each is used once; a kept one has a neighbouring taxel in its last contact; the others are new.
        """
        now = {c.number: set(c.taxels.tolist()) for c in self.frame.contacts}
        assert len(now) == len(self.frame.contacts)
        before = {} if fresh else self.last
        neighbours = {i: {i} for i in range(N)}
        for i, j in self.skin.pairs.tolist():
            neighbours[i].add(j)
            neighbours[j].add(i)
        for number, taxels in now.items():
            if number in before:
                assert before[number] & set().union(*(neighbours[i] for i in taxels))
            else:
                assert number not in self.used
                self.used.add(number)
        self.last = now

    @rule(invalid=st.sampled_from([None, np.zeros(3), np.full(N, np.nan), np.zeros((2, N)), "reading", [1, [2]]]))
    def update_with_invalid_frame(self, invalid):
        """An invalid frame is flagged, and only the time goes on."""
        self.time += 0.001
        frame = self.skin.update(invalid, self.time)
        assert frame.touched is None and frame.problem

    @rule(ids=st.sets(st.integers(0, N - 1), max_size=4))
    def mask(self, ids):
        """Mask some taxels and restore the others."""
        self.skin.mask([self.skin.ids[i] for i in ids])
        self.masked = ids

    @rule(rest=st.floats(-0.05, 0.05))
    def tare(self, rest):
        """Set one baseline for all taxels."""
        self.skin.tare(np.full(N, rest))
        self.baseline = np.full(N, rest)

    @invariant()
    def old_frames_do_not_change(self):
        """Frames that a controller keeps do not change."""
        if self.frame is not None and self.frame.problem is None:
            assert_allclose(sum(c.wrench for c in self.frame.contacts), self.frame.wrench, rtol=1e-9, atol=1e-12)


TestSequences = Sequences.TestCase
TestSequences.settings = settings(examples(80), stateful_step_count=25)
