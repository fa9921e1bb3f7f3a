"""Errors that a user can correct: each message states what is wrong, where, and what to do."""

from collections.abc import Sequence

MAX_NAMED = 5  # names or numbers that a message lists. Larger: longer lines


class SkinCalibError(Exception):
    """Base class of all errors that a user can correct."""

    def __init__(self, message: str, **numbers):
        super().__init__(message)
        self.numbers = numbers


class InvalidMesh(SkinCalibError):
    """The mesh cannot be read, or is not a surface in metres."""


class InvalidPlan(SkinCalibError):
    """The plan requests something unknown, missing or impossible."""


class EmptySection(SkinCalibError):
    """A plane intersects too little of the mesh for a fit."""


class InvalidKnotVector(SkinCalibError):
    """The knots decrease, or are too few for the degree."""


class UnderdeterminedFit(SkinCalibError):
    """There are too few planes or samples for the requested control points."""


class PoorFit(SkinCalibError):
    """The surface cannot approximate the mesh along these lines."""


class OutsideSurface(SkinCalibError):
    """A cell of the skin is outside the fitted surface."""


class CalibrationFormatError(SkinCalibError):
    """A calibration or plan file is invalid; ``findings`` lists all problems."""

    def __init__(self, message: str, findings=(), **numbers):
        super().__init__(message, **numbers)
        self.findings = tuple(findings)


class OutputError(SkinCalibError):
    """A file cannot be written; the previous file is unchanged."""


class UnknownLink(SkinCalibError):
    """The calibration has no link of this name."""


class UnknownTaxel(SkinCalibError, KeyError):
    """The link has no taxel of this name."""

    __str__ = SkinCalibError.__str__  # that of KeyError puts the message between quotation marks


class InvalidReading(SkinCalibError):
    """A reading does not match the skin; ``flag`` is the flag of the frame."""

    def __init__(self, message: str, flag: str, **numbers):
        super().__init__(message, **numbers)
        self.flag = flag


class UnreachableTolerance(SkinCalibError):
    """No surface meets the requested tolerance."""


def millimetres(point) -> str:
    """Return a point (3,) [m] of the link frame in millimetres, for messages."""
    return f"({', '.join(f'{round(float(x) * 1e3, 1) + 0.0:.1f}' for x in point)}) mm"  # no minus zero


def counted(number: int, noun: str) -> str:
    """Return a number with a noun, for messages: ``1 taxel``, ``2 taxels``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def listed(names: Sequence[str]) -> str:
    """Return the first names, for messages: ``a, b, c, d, e and 2 more``."""
    return ", ".join(names[:MAX_NAMED]) + (f" and {len(names) - MAX_NAMED} more" if len(names) > MAX_NAMED else "")
