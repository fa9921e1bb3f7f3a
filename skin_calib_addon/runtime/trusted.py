"""Say which statements of a frame hold: one rule for controllers instead of a list of flags."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

STATEMENTS = ("touched", "wrench", "point", "guaranteed")  # Contract: names in :class:`Trusted`
# Statements that a flag takes away. All other flags are in the deviations, or concern other frames.
TAKES: dict[str, tuple[str, ...]] = {
    "blind": STATEMENTS,
    "byte_order": STATEMENTS,
    "drift": STATEMENTS,
    "frozen": STATEMENTS,
    "noise_unknown": STATEMENTS,
    "overload": STATEMENTS,
    "wrong_length": STATEMENTS,
    "wrong_type": STATEMENTS,
    "below_rest": ("touched", "wrench", "point"),
    "lost": ("wrench", "point"),
    "noisy": ("wrench", "point"),
    "rest_assumed": ("guaranteed",),
    "saturated": ("wrench", "point"),
    "stuck": ("touched", "wrench", "point"),
}
NOT_GUARANTEED = frozenset(flag for flag, taken in TAKES.items() if "guaranteed" in taken)


@dataclass(frozen=True)
class Trusted:
    """Which statements of a frame hold. It is true if all do."""

    touched: bool  # whether True and False of ``touched`` hold; None is no statement
    wrench: bool  # whether wrench, contacts and forces are within their deviations
    point: bool  # whether CoP and ZMP are within their deviations, or None because nothing stands
    guaranteed: bool  # whether the true contact contains the guaranteed polygon, with its probability
    why: tuple[str, ...] = ()  # flags that take a statement away, sorted

    def __bool__(self) -> bool:
        return self.touched and self.wrench and self.point and self.guaranteed


def trusted_of(flags: Iterable[str], touched: bool | None) -> Trusted:
    """Return what holds of a frame with these flags, and this ``touched``."""
    why = tuple(sorted(flag for flag in flags if flag in TAKES))
    taken = {statement for flag in why for statement in TAKES[flag]}
    if touched is None:
        taken.add("touched")
    holds, wrench, point, guaranteed = (statement not in taken for statement in STATEMENTS)
    return Trusted(holds, wrench, point, guaranteed, why)


def trusted_together(parts: Mapping[str, Trusted]) -> Trusted:
    """Return what holds of several links together, by their names."""
    why = tuple(sorted(f"{name}:{flag}" for name, part in parts.items() for flag in part.why))
    touched, wrench, point, guaranteed = (all(getattr(part, s) for part in parts.values()) for s in STATEMENTS)
    return Trusted(touched, wrench, point, guaranteed, why)
