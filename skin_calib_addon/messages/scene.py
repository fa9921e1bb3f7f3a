"""What a view shows of a frame: touched cells with colours, contacts, polygons and CoP, in the frame of the link."""

from dataclasses import dataclass

import numpy as np

from ..calibration.model import LinkCalibration
from ..common.arrays import Array
from ..runtime import Frame, Skin

# Colours from no force to the largest one, red, green, blue [1]; they differ in brightness, too.
FORCE_COLOURS = np.array(((255, 237, 160), (254, 178, 76), (240, 59, 32), (128, 0, 38))) / 255
UNKNOWN_COLOUR = np.array((0.55, 0.3, 0.85))  # of a taxel without a valid reading
CELL_COLOUR = np.array((0.62, 0.66, 0.72))  # of the other cells
POLYGON_COLOURS = {"outer": (0.45, 0.5, 0.58), "nominal": (0.08, 0.32, 0.75), "guaranteed": (0.1, 0.6, 0.23)}
CONTACT_COLOUR, COP_COLOUR = (0.3, 0.85, 1.0), (0.0, 0.0, 0.0)
CELL_FRACTION = 0.94  # [1] of the size of a cell that is drawn. Larger: narrower gaps between cells
ARROW_FRACTION = 0.25  # [1] length of the arrow of the largest force, relative to the size of the skin
# [1] height of the drawn cells above their positions, relative to the size of the skin; touched ones are twice as high,
# CoP and polygons four times. Larger: they seem to float; smaller: the mesh of the link hides parts of them
LIFT_FRACTION = 0.008


@dataclass(frozen=True, eq=False)
class Scene:
    """What is drawn of one frame."""

    triangles: Array  # (t, 3, 3) of touched cells, and of those without a valid reading [m]
    colours: Array  # (t, 3) of the triangles
    tails: Array  # (c, 3) where the arrow of each contact begins [m]
    heads: Array  # (c, 3) where it ends: on the skin
    cop: Array  # (1, 3) [m], or (0, 3)
    polygons: dict[str, Array]  # closed lines (k, 3) [m]; (0, 3) for an empty polygon


class SceneMaker:
    """Makes the scenes of a skin; forces are relative to the largest one until then."""

    def __init__(self, calibration: LinkCalibration, skin: Skin, frames: tuple[Frame, ...] = ()):
        """Start with the largest force of some frames, so that all have the same colours."""
        self._plane = None if skin.ground is None else skin.ground.plane
        self._normals = skin.normals
        of_patches = (patch.taxels.corners_link.reshape(-1, 3) for patch in calibration.patches)
        corners = np.concatenate([np.empty((0, 3)), *of_patches])  # of cells: one taxel has a size, too
        self.size = float(np.linalg.norm(np.ptp(corners, axis=0))) if len(corners) else 0.0  # [m]
        self._lift = LIFT_FRACTION * self.size
        self._cells: list[Array] = []  # triangles (k - 2, 3, 3) of each taxel
        for patch in calibration.patches:
            taxels = patch.taxels
            centres = taxels.positions_link[:, None]
            lifted = centres + self._lift * taxels.normals_link[:, None]
            corners = lifted + CELL_FRACTION * (taxels.corners_link - centres)
            fans = [corners[:, [0, i, i + 1]] for i in range(1, corners.shape[1] - 1)]
            self._cells += list(np.stack(fans, axis=1))
        self.cells = np.concatenate([np.empty((0, 3, 3)), *self._cells])  # (t, 3, 3) of all taxels
        self.largest = max((float(frame.forces.max(initial=0.0)) for frame in frames), default=0.0)  # of a taxel [N]
        self._strongest = max((c.force for frame in frames for c in frame.contacts), default=0.0)  # contact [N]

    def scene(self, frame: Frame) -> Scene:
        """Return what is drawn of a frame."""
        self.largest = max(self.largest, float(frame.forces.max(initial=0.0)))
        self._strongest = max(self._strongest, *(c.force for c in frame.contacts), 0.0)
        rows = np.flatnonzero(frame.active | ~frame.known).tolist()
        shades = np.linspace(0, self.largest or 1.0, len(FORCE_COLOURS))
        colours = np.stack([np.interp(frame.forces, shades, channel) for channel in FORCE_COLOURS.T], axis=1)
        colours[~frame.known] = UNKNOWN_COLOUR
        counts = [len(self._cells[row]) for row in rows]
        lifted = [self._cells[row] + self._lift * self._normals[row] for row in rows]
        heads = np.array([c.position for c in frame.contacts]).reshape(-1, 3)
        outward = np.array([c.normal for c in frame.contacts]).reshape(-1, 3)
        lengths = np.array([c.force for c in frame.contacts]) * ARROW_FRACTION * self.size / (self._strongest or 1.0)
        return Scene(
            np.concatenate([np.empty((0, 3, 3)), *lifted]),
            np.repeat(colours[rows], counts, axis=0),
            heads + lengths[:, None] * outward,
            heads,
            self._on_ground(np.empty((0, 2)) if frame.cop is None else frame.cop[None]),
            {name: self._on_ground(_closed(getattr(frame.polygon, name).corners)) for name in POLYGON_COLOURS},
        )

    def _on_ground(self, points: Array) -> Array:
        """Return points of the ground (n, 2) in the frame of the link, below the skin."""
        if self._plane is None:
            return np.empty((0, 3))
        return self._plane.spatial(points) - 4 * self._lift * self._plane.axes[2]


def _closed(corners: Array) -> Array:
    return np.concatenate((corners, corners[:1]))
