"""Taxel files for tests, written from formulas in the formats of other programs."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

RADIUS = 0.03  # [m]


def points_round(count, radius=RADIUS):
    """Return points on a helix about z, and their outward directions; the first ones have short numbers."""
    angle = 2 * np.pi * np.arange(count) / 12
    outward = np.column_stack((np.cos(angle), np.sin(angle), 0 * angle)).round(15)
    return (radius * outward + np.outer(np.arange(count), (0, 0, 0.001))).round(9), outward


def matrix(degrees, axis="z"):
    """Return a rotation about an axis."""
    return Rotation.from_euler(axis, degrees, degrees=True).as_matrix().round(12)


def icub_text(rows, entries=None, head="name\tl_arm\nspatial_sampling\ttaxel\n"):
    """Return a positions file: rows ``x y z nx ny nz``, and the entries of its table."""
    made = f"taxel2Repr ( {entries} )\n" if entries else ""
    return head + made + "[calibration]\n" + "".join(" ".join(f"{x:.17g}" for x in row) + "\n" for row in rows)


def csv_text(positions, normals=None, tangents=None):
    """Return a table of positions, optionally with directions."""
    given = [("xyz", "", positions), ("xyz", "n", normals), ("xyz", "t", tangents)]
    given = [(axes, prefix, vectors) for axes, prefix, vectors in given if vectors is not None]
    header = ",".join(prefix + axis for axes, prefix, _ in given for axis in axes)
    rows = np.column_stack([vectors for _, _, vectors in given])
    return "\n".join((header, *(",".join(repr(float(x)) for x in row) for row in rows))) + "\n"


@dataclass(frozen=True)
class Cell:
    """A board of a patch."""

    id: int
    position: np.ndarray
    rotation: np.ndarray
    ports: tuple[int, ...]


CELLS = (
    Cell(5, np.zeros(3), np.eye(3), (0, 0, 4, 6)),
    Cell(6, np.array((-0.0239, -0.0141, -0.0008)), matrix(4, "y"), (5, 0, 0, 7)),
    Cell(7, np.array((-0.0476, -0.0285, -0.0027)), matrix(30) @ matrix(5, "y"), (6, 0, 16383, 0)),
)
NOWHERE = (np.eye(3), (0.0, 0.0, 0.0))


def tum_text(cells, base=NOWHERE, beyond=NOWHERE):
    """Return a patch with the pose of its root cell in the base frame."""
    places = "".join(
        f"<{name}>{_pose(shift, turn)}</{name}>\n"
        for name, (turn, shift) in (("tf_rootCell_base", base), ("tf_base_dh", beyond))
    )
    boards = "".join(
        f'<cell id="{c.id}" patch="2" segment="1"><rootCellId>5</rootCellId>\n<neighbors id="{c.id}" size="4">'
        + "".join(f'<neighbor port="{k + 1}" id="{n}"/>' for k, n in enumerate(c.ports))
        + f"</neighbors>\n{_pose(c.position, c.rotation)}</cell>\n"
        for c in cells
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<!DOCTYPE scfg>\n<SkinConfig numberOfCells="3">\n'
        '<patchDriverSettings patchId="2" prefix="/"/>\n'
        f'<patchExtrinsics patchId="2" baseFrame="world" dhFrame="" jointId="0">\n{places}</patchExtrinsics>\n'
        f"{boards}</SkinConfig>"
    )


def _pose(shift, turn):
    parts = (("pos", np.reshape(shift, (3, 1))), ("rot", turn))
    return "".join(
        f'<{name}><matrix rows="3" cols="{values.shape[1]}">\n'
        + "".join(
            f'<element row="{i}" col="{j}">{float(values[i, j])!r}</element>\n' for i, j in np.ndindex(values.shape)
        )
        + f"</matrix></{name}>\n"
        for name, values in parts
    )


def robot_text(places, extra=""):
    """Return a URDF of a forearm with a body, and fixed frames with names and positions."""
    frames = "".join(
        f'<link name="{name}"/>\n<joint name="{name}_joint" type="fixed"><origin xyz="{x!r} {y!r} {z!r}" rpy="0 0 0"/>'
        f'<parent link="forearm"/><child link="{name}"/></joint>\n'
        for name, (x, y, z) in places.items()
    )
    body = '<link name="forearm"><visual><geometry><mesh filename="a.stl"/></geometry></visual></link>'
    return f'<?xml version="1.0"?>\n<!-- <tum> -->\n<robot name="arm">\n{body}\n{frames}{extra}</robot>\n'


SENSOR = """<robot name="arm"><link name="wrist"/>
<sensor name="cuff" update_rate="100"><parent link="wrist"/><origin xyz="0 0 0.1" rpy="0 0 1.5707963267948966"/>
<tactile channel="cuff">
<taxel idx="4" xyz="0.03 0 0" rpy="0 1.5707963267948966 0"><geometry><box size="1 1 1"/></geometry></taxel>
<taxel idx="2" xyz="0 0.03 0" rpy="-1.5707963267948966 0 0"/>
</tactile></sensor>
<sensor name="camera" update_rate="20"><parent link="wrist"/><camera/></sensor>
</robot>
"""


def ply_text(positions, normals=None):
    """Return a PLY point cloud as text, with faces at the end."""
    names = ("x", "y", "z") + (() if normals is None else ("nx", "ny", "nz"))
    properties = "".join(f"property float {name}\n" for name in names)
    rows = positions if normals is None else np.column_stack((positions, normals))
    points = "".join(" ".join(repr(float(x)) for x in row) + "\n" for row in rows)
    head = f"ply\nformat ascii 1.0\ncomment by hand\nelement vertex {len(rows)}\n{properties}"
    return f"{head}element face 1\nproperty list uchar int vertex_indices\nend_header\n{points}3 0 1 2\n"


def pcd_text(positions, fields="x y z"):
    """Return a PCD point cloud as text."""
    count = len(fields.split())
    each = "".join(f"{name}{count * f' {word}'}\n" for name, word in (("SIZE", 4), ("TYPE", "F"), ("COUNT", 1)))
    head = f"# .PCD v0.7\nVERSION 0.7\nFIELDS {fields}\n{each}"
    head += f"WIDTH {len(positions)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(positions)}\nDATA ascii\n"
    return head + "".join(" ".join(repr(float(x)) for x in row) + "\n" for row in positions)
