"""Find the part of a sole that can bear load, from what its cells do not feel."""

import numpy as np
from biped import PERIOD
from estimator import SOLE_CENTRE
from shapes import HALF_SIZE, PITCH

from skin_calib_addon.runtime import Frame, Polygon, Skin, convex_hull

Array = np.ndarray
MIN_FORCE = 0.9  # expected on a cell, from which on its silence is evidence [N]: three times the smallest that is felt
SILENCE = 0.048  # time for which a cell must be silent [s]
MIN_LOAD = 60.0  # on the sole, for a plane of its forces [N]
MIN_SPREAD = 0.004  # standard deviation of the places of the cells pressed since the landing: less than two rows [m]
# Silent cells that are pressed for the first time in one frame. More: the sole rolls onto new ground, and nothing is
# evidence.
MAX_CONTRADICTIONS = 3
TOLERANCE = 1e-6  # of cells on the border of a hull [m]


class Foothold:
    """The area of one sole that is not proven void.

    The pressed area is not the supporting area: right after a landing only an edge is pressed, and the rest still can
    be. A cell is pressed if it is active in two frames in a row: noise alone makes single cells active now and then. A
    cell has ground if it was pressed since the landing, and so have all cells in the hull of these. A plane through the
    forces of the cells with ground, zero where they are silent now, says towards which side the sole turns. A cell on
    this side is void if the plane expects a clear force on it, it is lower than the CoP, and it is silent in several
    frames. A silent cell that is higher can hover over the ground. A cell is void no longer once it is pressed, or in
    the hull. The area is the largest rectangle along the sole without void cells. The next foothold is first assumed to
    be like the last one: on a beam, the void cells are the same again.

    Parameters
    ----------
    skin : Skin
        Of the sole.
    period : float
        Between its frames [s].
    """

    def __init__(self, skin: Skin, period: float = PERIOD):
        self.frames = round(SILENCE / period)  # for which a cell must be silent
        self.places = skin.positions[:, :2] - SOLE_CENTRE[:2]  # of the taxels, from the centre of the sole [m]
        self.xs, self.ys = (np.unique(np.round(self.places[:, k] / PITCH * 2)) * PITCH / 2 for k in (0, 1))
        self.column = np.abs(self.places[:, :1] - self.xs).argmin(axis=1)
        self.row = np.abs(self.places[:, 1:] - self.ys).argmin(axis=1)
        self.clear()

    def clear(self) -> None:
        """Assume the full sole."""
        self.void = np.zeros(len(self.places), bool)
        self.area = full_sole()
        self.lift()

    def lift(self) -> None:
        """Expect the next foothold to be like this one, until its cells are pressed."""
        self.active = np.zeros(len(self.places), bool)  # in the last frame
        self.silent = np.zeros(len(self.places), int)  # frames in a row
        self.solid = np.zeros(len(self.places), bool)  # pressed since the landing
        self.inside = np.zeros(len(self.places), bool)  # the hull of these, which supports the foot

    @property
    def centroid(self) -> Array:
        """Where the ZMP is planned (2,), from the centre of the sole [m]."""
        return self.area.centroid

    def update(self, frame: Frame, slope: Array) -> bool:
        """Learn from one frame; return whether the area has changed.

        Parameters
        ----------
        frame : Frame
            Of the sole.
        slope : array, shape (2,)
            By how much the sole rises along its axes, by joints and inertial unit.
        """
        if not frame.known.all() or frame.sets is None:
            return False
        pressed, self.active = frame.sets.active & self.active, frame.sets.active
        if (pressed & ~self.solid & (self.silent > 0)).sum() > MAX_CONTRADICTIONS:
            self.silent[:] = 0
        if (pressed & ~self.solid).any():
            self.solid |= pressed
            normals, offsets = convex_hull(self.places[self.solid]).half_planes
            has_area = len(normals) > 2
            self.inside = (self.places @ normals.T <= offsets + TOLERANCE).all(axis=1) if has_area else self.solid
        expected = np.zeros(len(pressed), bool)
        ground = self.places[self.solid]
        if frame.load > MIN_LOAD and len(ground) and (ground.std(axis=0) > MIN_SPREAD).all():
            terms = np.column_stack((np.ones(len(pressed)), self.places))
            plane, *_ = np.linalg.lstsq(terms[self.solid], frame.forces[self.solid], rcond=None)
            heights = self.places @ slope
            is_low = heights < heights @ frame.forces / frame.forces.sum()
            expected = (terms @ plane > MIN_FORCE) & is_low & ~frame.sets.possible & ~self.inside
        self.silent = np.where(expected, self.silent + 1, 0)
        void = (self.void | (self.silent >= self.frames)) & ~pressed & ~self.inside
        if (void == self.void).all():
            return False
        self.void = void
        self.area = self._rectangle()
        return True

    def _rectangle(self) -> Polygon:
        """Return the rectangle with the most cells and without a void one; its outer sides are those of the sole."""
        grid = np.zeros((len(self.xs), len(self.ys)), int)
        grid[self.column[self.void], self.row[self.void]] = 1
        sums = np.zeros((len(self.xs) + 1, len(self.ys) + 1), int)
        sums[1:, 1:] = grid.cumsum(axis=0).cumsum(axis=1)
        (a, b), (c, d) = (np.triu_indices(n, 1) for n in sums.shape)  # first and last cell, along and across
        a, b = a[:, None], b[:, None]
        void = sums[b, d] - sums[a, d] - sums[b, c] + sums[a, c]
        size = np.where(void == 0, (b - a) * (d - c), 0)
        i, j = np.unravel_index(size.argmax(), size.shape)
        if size[i, j] == 0:
            return Polygon(np.zeros((0, 2)))
        x = _edges(self.xs)[[a[i, 0], b[i, 0]]]
        y = _edges(self.ys)[[c[j], d[j]]]
        return convex_hull(np.array([(p, q) for p in x for q in y]))


def _edges(centres: Array) -> Array:
    """Return the edges of cells: between their centres, and half a cell beyond them at the ends."""
    return np.concatenate(([centres[0] - PITCH / 2], (centres[1:] + centres[:-1]) / 2, [centres[-1] + PITCH / 2]))


def full_sole() -> Polygon:
    """Return the outline of the cells of a sole about its centre: what lies outside of them is not supported."""
    x, y = HALF_SIZE - PITCH / 2
    return convex_hull(np.array(((x, y), (-x, y), (-x, -y), (x, -y))))
