r"""Change the priorities of tasks by what the skin feels: pain, and intentional contact (thesis 3.4)."""

import math
from enum import Enum
from typing import Any

import numpy as np

from .checks import Array, finite, positive


class Switch:
    """Remember whether a value exceeded one level, and has not since stayed below another one for some time.

    With the norm of the force of :func:`.pressure_driven` it is a nociceptor (thesis 3.4.1). While it is on, a
    controller leaves out the tasks of the hand, and yields. The thesis has one level and no time: a force near this
    level switches in each cycle.

    Parameters
    ----------
    on, off : float
        Levels from which on it is on, and below which it may go off, in any unit.
    hold : float
        Time below ``off`` after which it is off [s].

    Raises
    ------
    ValueError
        If ``off`` is larger than ``on``, or the time is below zero.
    """

    def __init__(self, on: float, off: float, hold: float):
        if not off <= on:
            raise ValueError(f"the level off, {off:g}, must not be larger than the level on, {on:g}")
        if not hold >= 0:
            raise ValueError(f"the time below the level off must be zero or more, not {hold}")
        self.is_on = False
        self._on, self._off, self._hold = on, off, hold
        self._last, self._time = -math.inf, math.inf  # time of the last value that was not below, and of the last one

    def update(self, value: float, time: float) -> bool:
        """Return whether it is on. A value that is not a number changes nothing, and its time does not count.

        Parameters
        ----------
        value : float
            In the unit of the levels.
        time : float
            That never decreases [s].

        Raises
        ------
        ValueError
            If the time is not finite; nothing changes.
        """
        if not math.isfinite(time):
            raise ValueError(f"the time {time} is not a finite number")
        if math.isnan(value):
            self._last += max(time - self._time, 0.0)
        self._time = time
        if value >= self._on:
            self.is_on = True
        if value >= self._off:
            self._last = time
        elif value < self._off and self.is_on and time - self._last >= self._hold:
            self.is_on = False
        return self.is_on


class Stage(Enum):
    """Which tasks have priority (thesis table 1), highest first."""

    AVOID = "avoid"  # obstacle avoidance, goal, contact
    PUSH = "push"  # goal, contact, obstacle avoidance
    YIELD = "yield"  # contact, goal, obstacle avoidance


class IntentionalContact:
    """Choose the stage of intentional contact (thesis 3.4.2, table 1, corrected).

    A robot avoids obstacles until they stop it before its goal. Then it may push them, with a limited force. A larger
    force makes it yield.

    As printed, the stage is PUSH only while the robot is slow. As soon as it approaches the obstacle, it avoids it
    again. Here PUSH lasts until no obstacle is near. YIELD lasts until the force is below half of the limit for a time.
    A robot that is slow because it is at its goal does not push. Nor does one that does not know its speed, or what it
    feels: values that are not numbers do not begin PUSH, and do not end YIELD.

    Parameters
    ----------
    slow : float
        Speed below which the robot is stopped [m/s].
    max_force : float
        Largest force of a contact that it wants [N].
    patience : float
        Time for which the robot must be slow before it pushes. An obstacle must be away, or a force small, for this
        time before it avoids again [s].

    Raises
    ------
    ValueError
        If one of these is not positive and finite.
    """

    def __init__(self, slow: float, max_force: float, patience: float):
        for name, value in (("slow", slow), ("max_force", max_force), ("patience", patience)):
            positive(name, value)
        self.stage, self.since = Stage.AVOID, -math.inf  # and the time of the last change [s]
        self._slow, self._patience, self._moved, self._met = slow, patience, math.inf, -math.inf
        self._hard = Switch(max_force, max_force / 2, patience)

    def update(self, time: float, speed: float, is_at_goal: bool, near: float, contact: float) -> Stage:
        """Return the stage.

        Parameters
        ----------
        time : float
            That never decreases [s].
        speed : float
            Of the hand [m/s].
        is_at_goal : bool
            Whether the hand is where it must go.
        near, contact : float
            Sizes of the force of :func:`.proximity_wrench` and of the largest contact [N].

        Raises
        ------
        ValueError
            If the time is not finite; nothing changes.
        """
        is_hard = self._hard.update(contact, time)
        is_known = not math.isnan(speed + near + contact)
        if speed > self._slow or is_at_goal or not is_known or self._moved == math.inf:
            self._moved = time
        if near > 0 or contact > 0:
            self._met = time
        stage = self.stage
        if is_hard:
            stage = Stage.YIELD
        elif stage is Stage.YIELD:
            stage = Stage.AVOID
        elif stage is Stage.AVOID and self._met == time and time - self._moved >= self._patience:
            stage = Stage.PUSH
        elif stage is Stage.PUSH and time - self._met >= self._patience:
            stage = Stage.AVOID
        if stage is not self.stage:
            self.stage, self.since, self._moved = stage, time, time
        return stage


def blended(before: Any, now: Any, elapsed: float, rate: float) -> Array:
    r"""Return torques (n,) that go smoothly from those of old priorities to those of new ones (thesis eq. 3.45, 3.46).

    .. math::
        \boldsymbol{\tau} = \chi \boldsymbol{\tau}_{k-1} + (1 - \chi) \boldsymbol{\tau}_k , \qquad
        \chi = 1 - \tanh\left( \delta_t (t - t_t) \right)

    The thesis has half of this plus the tanh, :math:`(1 - \tanh)/2`. At the change this is a half: half of the step is
    sudden.

    Parameters
    ----------
    before, now : array, shape (n,)
        Torques at the change, and with the new priorities [N m].
    elapsed : float
        :math:`t - t_t` since the change [s].
    rate : float
        :math:`\delta_t` [1/s]. Larger: a faster change.

    Raises
    ------
    ValueError
        If a torque is not finite, the torques have different shapes, the rate is not positive and finite, or the time
        is not a number.
    """
    if math.isnan(elapsed):
        raise ValueError("the time since the change is not a number")
    old = 1 - math.tanh(positive("the rate", rate) * max(elapsed, 0.0))
    shape = np.shape(before)
    return old * finite("the torque before", before, shape) + (1 - old) * finite("the torque now", now, shape)
