"""Errors that a user can act on: each says what, where, and what to do; the numbers stay on the exception."""


class SkinCalibError(Exception):
    """Base of every error a user can act on.

    Parameters
    ----------
    message : str
        One line: what is wrong, where, and what to do about it.
    **numbers
        The values behind the message, kept as ``numbers`` for programs.
    """

    def __init__(self, message: str, **numbers):
        super().__init__(message)
        self.numbers = numbers


class InvalidMesh(SkinCalibError):
    """The mesh cannot be read, or is no surface in metres."""


class InvalidPlan(SkinCalibError):
    """The plan asks for something that is unknown, missing or impossible."""


class EmptySection(SkinCalibError):
    """A plane cuts too little of the mesh to fit anything there."""


class InvalidKnotVector(SkinCalibError):
    """The knots decrease, or are too few for the degree."""


class UnderdeterminedFit(SkinCalibError):
    """Too few planes or samples for the control points asked for."""


class PoorFit(SkinCalibError):
    """The surface cannot follow the mesh along these lines."""


class OutsideSurface(SkinCalibError):
    """A cell of the skin lies off the fitted surface."""


class CalibrationFormatError(SkinCalibError):
    """A calibration or plan file is not what it must be; ``findings`` lists everything found."""

    def __init__(self, message: str, findings=(), **numbers):
        super().__init__(message, **numbers)
        self.findings = tuple(findings)


class OutputError(SkinCalibError):
    """A file cannot be written; what was there before is untouched."""


class UnknownLink(SkinCalibError):
    """No such link in this calibration."""


class UnknownTaxel(SkinCalibError):
    """No such taxel on this link."""


class InvalidReading(SkinCalibError):
    """A reading does not fit the skin it is given to; ``flag`` is what a frame says of it."""

    def __init__(self, message: str, flag: str, **numbers):
        super().__init__(message, **numbers)
        self.flag = flag


class UnreachableTolerance(SkinCalibError):
    """No surface comes as close to the mesh as was asked for."""


def millimetres(point) -> str:
    """A place (3,) [m] in the link frame, in words for messages."""
    return f"({', '.join(f'{round(float(x) * 1e3, 1) + 0.0:.1f}' for x in point)}) mm"  # no minus zero
