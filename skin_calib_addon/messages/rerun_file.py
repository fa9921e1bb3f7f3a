"""Rerun files: the skin of a link in space, and its force over time, as the viewer of Rerun opens them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..calibration.model import LinkCalibration
from ..common.arrays import Array, IntArray, unit
from ..common.packages import optional_package
from ..runtime import Frame, Skin
from .scene import CELL_COLOUR, CONTACT_COLOUR, COP_COLOUR, POLYGON_COLOURS, SceneMaker

MESH_COLOUR = (0.86, 0.87, 0.89)
BACKGROUND = (1.0, 1.0, 1.0)
EYE_DISTANCE = 0.95  # [1] from the middle of the skin, relative to its size. Larger: the link is smaller in the picture
MIN_MEAN_NORMAL = 0.3  # [1] below which a skin is around its link, and is looked at from its first taxel
LINE_FRACTION = 0.004  # [1] radius of lines, relative to the size of the skin


class RerunView:
    """Shows the skin of a link, frame by frame: in a file, or in a viewer (``recording.spawn()``)."""

    def __init__(
        self,
        calibration: LinkCalibration,
        skin: Skin,
        frames: Sequence[Frame] = (),
        mesh: tuple[Array, IntArray] | None = None,
    ):
        """Log what does not change; colours are relative to the largest force in some frames, or until then.

        ``mesh`` has vertices (n, 3) [m] and faces (m, 3) of the link.
        """
        with optional_package("a view of Rerun needs rerun-sdk", "view"):
            import rerun as rr
        self._rr, self._maker = rr, SceneMaker(calibration, skin, tuple(frames))
        self._flags: frozenset[str] = frozenset()
        self._count = 0
        self.recording: Any = rr.RecordingStream("skin-calib")  # an id of its own: viewers merge those with the same
        self.recording.send_blueprint(_blueprint(skin, self._maker, not frames, rr))
        if mesh is not None:
            vertices, faces = mesh
            self.recording.log("link/mesh", _mesh(vertices[faces], MESH_COLOUR, rr), static=True)
        self.recording.log("link/cells", _mesh(self._maker.cells, CELL_COLOUR, rr), static=True)
        lines = rr.SeriesLines(names="sum of the contacts [N]", colors=CONTACT_COLOUR)
        self.recording.log("force", lines, static=True)

    def add(self, frame: Frame, time: float) -> None:
        """Log a frame at a time [s]."""
        rr, log = self._rr, self.recording.log
        self.recording.set_time("frame", sequence=self._count)
        self.recording.set_time("time", duration=time)
        scene, radius = self._maker.scene(frame), LINE_FRACTION * self._maker.size
        shown = _mesh(scene.triangles, np.repeat(scene.colours, 3, axis=0), rr) if len(scene.triangles) else None
        log("link/touched", rr.Clear(recursive=False) if shown is None else shown)
        arrows = {"origins": scene.tails, "vectors": scene.heads - scene.tails, "radii": 1.5 * radius}
        labels = [f"{contact.force:.2f} N" for contact in frame.contacts]
        log("link/contacts", rr.Arrows3D(**arrows, colors=CONTACT_COLOUR, labels=labels))
        log("link/cop", rr.Points3D(scene.cop, radii=4 * radius, colors=COP_COLOUR))
        for name, line in scene.polygons.items():
            log(f"link/{name}", rr.LineStrips3D([line], radii=radius, colors=POLYGON_COLOURS[name]))
        unknown = float("nan")  # a gap of the line
        log("force", rr.Scalars(unknown if frame.problem else sum(contact.force for contact in frame.contacts)))
        if frame.flags != self._flags or frame.problem:
            log("flags", rr.TextLog(frame.problem or ", ".join(sorted(frame.flags)) or "no flag", level="WARN"))
        self._flags, self._count = frame.flags, self._count + 1


def rerun_bytes(
    calibration: LinkCalibration,
    skin: Skin,
    frames: Sequence[Frame],
    seconds: Array,
    mesh: tuple[Array, IntArray] | None,
) -> bytes:
    """Return frames at times since the first one [s] as a file of Rerun."""
    view = RerunView(calibration, skin, frames, mesh)
    stream = view.recording.binary_stream()
    for frame, time in zip(frames, seconds.tolist()):
        view.add(frame, time)
    return stream.read() or b""


def _mesh(triangles: Array, colours: Any, rr: Any) -> Any:
    """Return triangles (t, 3, 3) with a colour, or one for each corner; each has its own normal."""
    normals = unit(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]))
    colour = {"albedo_factor": colours} if np.ndim(colours) == 1 else {"vertex_colors": colours}
    return rr.Mesh3D(vertex_positions=triangles.reshape(-1, 3), vertex_normals=np.repeat(normals, 3, axis=0), **colour)


def _blueprint(skin: Skin, maker: SceneMaker, is_live: bool, rr: Any) -> Any:
    """Return what the viewer opens: the skin from outside, the force over time below it, and flags."""
    import rerun.blueprint as rrb

    corners = maker.cells.reshape(-1, 3)
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    front = skin.normals.mean(axis=0)
    front = unit(front if np.linalg.norm(front) > MIN_MEAN_NORMAL else skin.normals[0])
    flat = corners - middle - np.outer((corners - middle) @ front, front)
    along = np.linalg.svd(flat, full_matrices=False)[2][0]  # the longest direction is horizontal in the picture
    up = np.cross(front, along)
    up = up if up[np.abs(up).argmax()] > 0 else -up
    eye = middle + EYE_DISTANCE * maker.size * unit(front + 0.5 * up + 0.3 * along)
    space = rrb.Spatial3DView(
        origin="link",
        name=skin.link + (f": taxels up to {maker.largest:.3g} N (dark)" if maker.largest else ""),
        background=BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(position=eye, look_target=middle, eye_up=up),
    )
    force = rrb.TimeSeriesView(origin="/", contents=["force"], name="force [N]")
    flags = rrb.TextLogView(origin="/", contents=["flags"], name="flags")
    below = rrb.Horizontal(force, flags, column_shares=[3, 1])
    panels = (
        rrb.TimePanel(
            timeline="time", state="collapsed", play_state="following" if is_live else "paused", loop_mode="off"
        ),
        rrb.SelectionPanel(state="collapsed"),
    )
    return rrb.Blueprint(rrb.Vertical(space, below, row_shares=[3, 1]), *panels, rrb.BlueprintPanel(state="collapsed"))
