"""Rerun files: the skin of a link in space, and its force over time, as the viewer of Rerun opens them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..calibration.model import LinkCalibration
from ..common.arrays import Array, IntArray, unit
from ..common.errors import SkinCalibError
from ..runtime import Frame, Skin
from .scene import CELL_COLOUR, CONTACT_COLOUR, COP_COLOUR, POLYGON_COLOURS, SceneMaker

MESH_COLOUR = (0.86, 0.87, 0.89)
BACKGROUND = (1.0, 1.0, 1.0)
EYE_DISTANCE = 0.95  # [1] from the middle of the skin, relative to its size. Larger: the link is smaller in the picture
MIN_MEAN_NORMAL = 0.3  # [1] below which a skin is around its link, and is looked at from its first taxel
LINE_FRACTION = 0.004  # [1] radius of lines, relative to the size of the skin


def rerun_bytes(
    calibration: LinkCalibration,
    skin: Skin,
    frames: Sequence[Frame],
    seconds: Array,
    mesh: tuple[Array, IntArray] | None = None,
) -> bytes:
    """Return frames at times since the first one [s] as a file of Rerun, with vertices and faces of the link [m]."""
    try:
        import rerun as rr
    except ImportError as error:
        raise SkinCalibError(
            "a file of Rerun needs rerun-sdk, which is not installed here: pip install 'skin-calib[view]'"
        ) from error
    maker = SceneMaker(calibration, skin, tuple(frames))
    radius = LINE_FRACTION * maker.size
    file = rr.RecordingStream("skin-calib", recording_id=f"{skin.link} {skin.checksum}")
    stream = file.binary_stream()
    file.send_blueprint(_blueprint(skin, maker, rr))
    if mesh is not None:
        vertices, faces = mesh
        file.log("link/mesh", _mesh(vertices[faces], MESH_COLOUR, rr), static=True)
    file.log("link/cells", _mesh(maker.cells, CELL_COLOUR, rr), static=True)
    file.log("force", rr.SeriesLines(names="sum of the contacts [N]", colors=CONTACT_COLOUR), static=True)
    flags: frozenset[str] = frozenset()
    for number, (frame, time) in enumerate(zip(frames, seconds.tolist())):
        file.set_time("frame", sequence=number)
        file.set_time("time", duration=time)
        scene = maker.scene(frame)
        shown = _mesh(scene.triangles, np.repeat(scene.colours, 3, axis=0), rr) if len(scene.triangles) else None
        file.log("link/touched", rr.Clear(recursive=False) if shown is None else shown)
        arrows = {"origins": scene.tails, "vectors": scene.heads - scene.tails, "radii": 1.5 * radius}
        labels = [f"{contact.force:.2f} N" for contact in frame.contacts]
        file.log("link/contacts", rr.Arrows3D(**arrows, colors=CONTACT_COLOUR, labels=labels))
        file.log("link/cop", rr.Points3D(scene.cop, radii=4 * radius, colors=COP_COLOUR))
        for name, line in scene.polygons.items():
            file.log(f"link/{name}", rr.LineStrips3D([line], radii=radius, colors=POLYGON_COLOURS[name]))
        file.log("force", rr.Scalars(sum(contact.force for contact in frame.contacts)))
        if frame.flags != flags or frame.problem:
            file.log("flags", rr.TextLog(frame.problem or ", ".join(sorted(frame.flags)) or "no flag", level="WARN"))
        flags = frame.flags
    return stream.read() or b""


def _mesh(triangles: Array, colours: Any, rr: Any) -> Any:
    """Return triangles (t, 3, 3) with a colour, or one for each corner; each has its own normal."""
    normals = unit(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]))
    colour = {"albedo_factor": colours} if np.ndim(colours) == 1 else {"vertex_colors": colours}
    return rr.Mesh3D(vertex_positions=triangles.reshape(-1, 3), vertex_normals=np.repeat(normals, 3, axis=0), **colour)


def _blueprint(skin: Skin, maker: SceneMaker, rr: Any) -> Any:
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
        name=f"{skin.link}: taxels up to {maker.largest:.3g} N (dark)",
        background=BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(position=eye, look_target=middle, eye_up=up),
    )
    force = rrb.TimeSeriesView(origin="/", contents=["force"], name="force [N]")
    flags = rrb.TextLogView(origin="/", contents=["flags"], name="flags")
    below = rrb.Horizontal(force, flags, column_shares=[3, 1])
    panels = (
        rrb.TimePanel(timeline="time", play_state="paused", state="collapsed", loop_mode="all"),
        rrb.SelectionPanel(state="collapsed"),
    )
    return rrb.Blueprint(rrb.Vertical(space, below, row_shares=[3, 1]), *panels, rrb.BlueprintPanel(state="collapsed"))
