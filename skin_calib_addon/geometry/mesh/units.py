"""The probable unit of the numbers of a mesh, from their size."""

from .triangle_mesh import METRES_PER_UNIT

MIN_LINK_LENGTH = 5e-3  # [m] least longest side of a link with skin, a fingertip. Smaller: more units are plausible
MAX_LINK_LENGTH = 3.0  # [m] largest longest side of a link with skin, a crane. Larger: more units are plausible
UNIT_NAMES = {"m": "metres", "cm": "centimetres", "mm": "millimetres", "in": "inches"}


def is_plausible(side: float) -> bool:
    """Return whether a link may have this longest side [m]."""
    return MIN_LINK_LENGTH <= side <= MAX_LINK_LENGTH


def likely_unit(side: float) -> str:
    """Return the unit, "m" or "mm", in which a longest side of ``side`` fits a link, or fits best."""
    return "m" if side <= MAX_LINK_LENGTH else "mm"


def possible_units(side: float) -> dict[str, float]:
    """Return the units that a mesh may have whose longest side [m] no link has, each with the factor that corrects it.

    A mesh that is too large was read as metres. One that is too small may be in metres, read as millimetres.
    """
    factors = METRES_PER_UNIT if side > MAX_LINK_LENGTH else {"m": 1 / METRES_PER_UNIT["mm"]}
    return {unit: factor for unit, factor in factors.items() if is_plausible(side * factor)}
