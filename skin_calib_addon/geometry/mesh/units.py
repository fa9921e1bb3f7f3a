"""Which unit the numbers of a mesh are in, told from their size."""

from .triangle_mesh import METRES_PER_UNIT

# The longest side of a link that carries skin: more than a fingertip's, less than a crane's [m].
MIN_LINK_LENGTH, MAX_LINK_LENGTH = 5e-3, 3.0
UNITS = METRES_PER_UNIT | {"cm": 1e-2, "in": 0.0254}
UNIT_NAMES = {"m": "metres", "cm": "centimetres", "mm": "millimetres", "in": "inches"}


def is_plausible(side: float) -> bool:
    """Whether a link may have this longest side [m]."""
    return MIN_LINK_LENGTH <= side <= MAX_LINK_LENGTH


def likely_unit(side: float) -> str:
    """The unit in which numbers that reach over ``side`` are those of a link: "m" or "mm", the nearer where neither."""
    return "m" if side <= MAX_LINK_LENGTH else "mm"


def likely_mistake(side: float) -> tuple[str, float] | None:
    """What numbers taken for a link of this longest side [m] rather are, and the factor to it; None if all is well.

    Those of a link that is too large may be millimetres or centimetres that were taken for metres, those of one that is
    too small metres that were taken for millimetres. ("", 1) where neither gives a link.
    """
    if is_plausible(side):
        return None
    others = {"mm": UNITS["mm"], "cm": UNITS["cm"]} if side > MAX_LINK_LENGTH else {"m": 1 / UNITS["mm"]}
    return next(((unit, factor) for unit, factor in others.items() if is_plausible(side * factor)), ("", 1.0))
