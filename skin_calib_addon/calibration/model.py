"""Records of a calibration: link, mesh, fitted surfaces and taxels. NumPy only."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..common.arrays import Array, IntArray, cross, freeze
from ..common.mesh_uncertainty import MeshUncertainty
from ..common.surface_errors import SurfaceErrors
from ..common.warnings import Warning
from .modality import Modality
from .response import AnyResponse, Response

MAX_CHANNEL = 2**31 - 1  # Contract: a channel fits into a signed 32-bit integer
# Distance of two taxels in pitches below which they are in one place. Larger: more findings in narrow folds.
MIN_TAXEL_DISTANCE = 0.1


@dataclass(frozen=True)
class MeshSource:
    """The calibrated mesh; ``sha256`` is the hash of its geometry in metres, not of the file."""

    file: str
    sha256: str
    vertices: int
    faces: int
    uncertainty: MeshUncertainty | None = None  # of the part from the mesh, which `sigma` contains; None: not stated


@dataclass(frozen=True, eq=False)
class Trusted:
    """Where a surface follows its mesh; elsewhere it is a guess.

    A point is trusted if it is inside the boundary, one of the (up to four) sites around it met the mesh, and none of
    them missed it.
    """

    # Loops of parameters (k, 2): points inside an odd number of them are inside the boundary; without loops all are.
    boundary: tuple[Array, ...] = ()
    # A text for each u of sites even in u and v, with a letter for each v: 1 met the mesh, 0 missed it, - is outside
    # the boundary. In a closed direction the last site is one step before the first. Empty: all met it.
    sites: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class SurfaceModel:
    """A tensor-product B-spline in the link frame.

    In a ``closed`` direction the first ``degree`` control points are repeated at the end. Net and knots can therefore
    be evaluated directly on the domain ``[knots[degree], knots[-degree - 1]]``, which is always ``[0, 1]``.
    """

    name: str
    degree: tuple[int, int]
    knots_u: Array  # (n_u + degree_u + 1,)
    knots_v: Array  # (n_v + degree_v + 1,)
    control_net: Array  # (n_u, n_v, 3) [m]
    closed: tuple[bool, bool]
    errors: SurfaceErrors
    extra: dict[str, Any] = field(default_factory=dict)  # ``x_`` members, unchanged
    trusted: Trusted | None = None  # None: not known

    def __post_init__(self):
        n_u, n_v = (len(k) - d - 1 for k, d in zip((self.knots_u, self.knots_v), self.degree))
        freeze(self, knots_u=(None,), knots_v=(None,), control_net=(n_u, n_v, 3))


@dataclass(frozen=True, eq=False)
class TaxelArray:
    """Taxels of one patch; row i of every field is the same taxel."""

    ids: tuple[str, ...]
    channels: IntArray  # (n,) position of the taxel in a reading
    index: IntArray  # (n, 2) row and column, or the axial coordinates of a board
    uv: Array  # (n, 2) parameters on the surface
    positions_link: Array  # (n, 3) [m]
    normals_link: Array  # (n, 3) unit, out of the robot
    tangents_link: Array  # (n, 3) unit, along the row, perpendicular to the normal
    corners_link: Array  # (n, k, 3) [m], counter-clockwise seen from outside
    areas: Array  # (n,) [m^2]
    neighbours: tuple[tuple[str, ...], ...]
    ports: tuple[tuple[str | None, ...], ...] = ()  # the adjacent board at each side of each board, or None
    quality: dict[str, Array] = field(default_factory=dict)  # e.g. strain (n, 3), gap (n,), tilt (n,)
    # (n,) positions in `LinkCalibration.responses`; empty where all taxels have the response of the link
    responses: IntArray = field(default_factory=lambda: np.empty(0, np.int64))
    # (n, 3) standard uncertainty: along the surface per axis [m], along the normal [m], of the normal in its worst
    # direction [rad]. A row is NaN where nothing can be stated; empty if no taxel has one.
    sigma: Array = field(default_factory=lambda: np.empty((0, 3)))

    def __post_init__(self):
        n = len(self.ids)
        freeze(
            self,
            channels=(n,),
            index=(n, 2),
            uv=(n, 2),
            positions_link=(n, 3),
            normals_link=(n, 3),
            tangents_link=(n, 3),
            corners_link=(n, None, 3),
            areas=(n,),
            responses=(n if len(self.responses) else 0,),
        )
        object.__setattr__(self, "sigma", _checked_sigma(self.sigma, n))
        if len(self.neighbours) != n:
            raise ValueError(f"TaxelArray.neighbours has {len(self.neighbours)} rows, expected {n}")
        if self.ports and len(self.ports) != n:
            raise ValueError(f"TaxelArray.ports has {len(self.ports)} rows, expected {n}")

    @property
    def axes_link(self) -> Array:
        """Return the unit vectors along the row and across it, shape (n, 2, 3)."""
        return np.stack((self.tangents_link, cross(self.normals_link, self.tangents_link)), axis=1)

    @property
    def flat_corners(self) -> Array:
        """Return the corners of each cell relative to its taxel, along the row and across it, shape (n, k, 2) [m]."""
        return np.einsum("nkc,nsc->nks", self.corners_link - self.positions_link[:, None], self.axes_link)

    @property
    def known_sigma(self) -> Array:
        """Return ``sigma`` with a row for each taxel, shape (n, 3); NaN where nothing is stated."""
        return self.sigma if len(self.sigma) else np.full((len(self.ids), 3), np.nan)


def fan_areas(centres: Array, corners: Array) -> Array:
    """Return the area (n,) [m^2] of each cell as the sum of the triangles from its centre to its sides."""
    arms = corners - centres[:, None]
    return np.linalg.norm(np.cross(arms, np.roll(arms, -1, axis=1)), axis=2).sum(axis=1) / 2


def neighbour_rows(ids: Sequence[str], neighbours: Iterable[Sequence[str]]) -> IntArray:
    """Return the rows (k, 2) of each taxel and each of its neighbours, as far as their ids are among these."""
    row_of = {taxel: row for row, taxel in enumerate(ids)}
    pairs = [(row, row_of[other]) for row, others in enumerate(neighbours) for other in others if other in row_of]
    return np.array(pairs, np.int64).reshape(-1, 2)


def _checked_sigma(sigma: Array, n: int) -> Array:
    """Return a read-only copy of the uncertainties of n taxels; a row is known or NaN as a whole."""
    sigma = np.array(sigma, float)
    if sigma.shape not in {(0, 3), (n, 3)}:
        raise ValueError(f"TaxelArray.sigma has shape {sigma.shape}, expected ({n}, 3) or (0, 3)")
    known = ~np.isnan(sigma).all(axis=1)
    if not (np.isfinite(sigma[known]) & (sigma[known] >= 0)).all():
        raise ValueError("TaxelArray.sigma contains a number that is negative or not finite in a row that is not NaN")
    sigma.setflags(write=False)
    return sigma


@dataclass(frozen=True)
class Registration:
    """How exactly a patch is mounted where the calibration says: standard uncertainties, independent of each other."""

    origin: float  # of the anchor along the surface, per axis [m]
    direction: float  # of the rotation about the normal at the anchor [rad]
    anchor: tuple[float, float, float]  # point of the patch that is placed, link frame [m]

    @property
    def covariance(self) -> Array:
        """Covariance (3, 3) of the shift along the rows and across, and of the rotation [m, m, rad]."""
        return np.diag((self.origin**2, self.origin**2, self.direction**2))


@dataclass(frozen=True)
class Touched:
    """How a patch was registered by touches: the motion, its covariance, and what the touches deviate after it."""

    date: str  # of the registration, as 2026-11-29
    session: str  # SHA-256 of the file of the touches; empty: not from a file
    used: int  # touches that the motion explains
    left_out: int  # the others
    shift: tuple[float, float]  # of the anchor along the rows and across [m]; zero if the skin stayed
    turn: float  # counter-clockwise seen from outside [rad]
    covariance: tuple[tuple[float, float, float], ...]  # (3, 3) of shift and turn [m, m, rad]
    anchor: tuple[float, float, float]  # point of the patch that shifts and turns, link frame [m]
    along: float  # rms distance of the touches along the skin from the taxels that felt them [m]
    normal: float | None = None  # rms height over the taxels [m]; None: not measured
    angle: float | None = None  # rms angle from normal to force [rad]; None: not measured

    @property
    def shift_error(self) -> float:
        """Standard uncertainty of the shift in its least certain direction [m]."""
        return float(np.sqrt(np.linalg.eigvalsh(np.array(self.covariance)[:2, :2])[-1]))

    @property
    def turn_error(self) -> float:
        """Standard uncertainty of the rotation [rad]."""
        return float(np.sqrt(self.covariance[2][2]))


@dataclass(frozen=True, eq=False)
class Patch:
    """Taxels that are placed together: a sheet, hexagonal boards, or imported taxels."""

    name: str
    kind: str
    surface: str
    shape: tuple[int, int]
    pitch: tuple[float, float]  # [m]
    taxels: TaxelArray
    extra: dict[str, Any] = field(default_factory=dict)  # ``x_`` members, unchanged
    offset: float = 0.0  # height of the middle plane of the skin above the surface [m]
    registration: Registration | None = None  # which the uncertainties of the taxels assume; None: not stated
    max_load: float | None = None  # largest plausible load [N]; None: by the area
    touches: Touched | None = None  # by which it was registered; None: by none


@dataclass(frozen=True, eq=False)
class LinkCalibration:
    """The calibrated skin of one link, in the link frame and SI units."""

    link: str
    mesh: MeshSource
    surfaces: tuple[SurfaceModel, ...]
    patches: tuple[Patch, ...]
    response: AnyResponse = Response()  # of all taxels without their own response
    generator: str = ""
    extra: dict[str, Any] = field(default_factory=dict)  # top-level ``x_`` members, unchanged
    responses: tuple[AnyResponse, ...] = ()  # of single taxels, see `TaxelArray.responses`
    warnings: tuple[Warning, ...] = ()  # of fit and placement
    modalities: tuple[Modality, ...] = ()  # further quantities that taxels measure

    @property
    def taxel_count(self) -> int:
        """Number of taxels of all patches."""
        return sum(len(patch.taxels.ids) for patch in self.patches)
