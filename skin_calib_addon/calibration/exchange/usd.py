"""Write USD as text, in metres: points with ids and exact doubles below the frame of their link."""

import re

import numpy as np

from ...common.arrays import Array, IntArray
from ..model import LinkCalibration
from .link_taxels import LinkTaxels, refuse_labels, taxels_of

BINARY_USD = (".usdc", ".usdz")  # Format: USD reads no text from files with these endings


def write_usd(calibration: LinkCalibration) -> bytes:
    """Write an Xform for the link, and below it Points for each patch, in the order of the channels.

    Points of USD have single precision. Values with all digits are in ``primvars:taxel:...``: id, position [m], normal,
    tangent, area [m^2], and sigma if it is stated: along the surface [m], along the normal [m], of the normal [rad].
    The ids of USD are the channels, its widths the diameters of discs with the areas of the cells.
    """
    taxels = taxels_of(calibration)
    patches = [patch.name for patch in calibration.patches]
    for names, what in (((calibration.link,), "link"), (patches, "patch"), (taxels.ids, "taxel")):
        refuse_labels(names, what)
    link = identifier(calibration.link)
    lines = [
        f'#usda 1.0\n(\n    defaultPrim = "{link}"\n    metersPerUnit = 1\n    upAxis = "Z"\n)\n',
        f'def Xform "{link}" (\n    displayName = {_text(calibration.link)}\n)\n{{',
    ]
    taken: set[str] = set()
    for patch in patches:
        name = identifier(patch)
        while name in taken:
            name += "_"
        taken.add(name)
        lines += [*_points(taxels, patch, name), ""]
    return ("\n".join(lines[:-1]) + "\n}\n").encode()


def identifier(name: str) -> str:
    """Return a name as USD allows it: other characters become underscores, and no digit is the first."""
    word = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return f"_{word}" if word[:1].isdigit() else word


def _points(taxels: LinkTaxels, patch: str, name: str) -> list[str]:
    """Return the lines of the points of a patch."""
    rows = taxels.of(patch)
    positions, normals, areas = taxels.positions[rows], taxels.normals[rows], taxels.areas[rows]
    values = {
        "point3f[] points": _rows(positions),
        "normal3f[] normals": _rows(normals),
        "float[] widths": _row(2 * np.sqrt(areas / np.pi)),
        "int64[] ids": _row(taxels.channels[rows]),
        "string[] primvars:taxel:id": f"[{', '.join(_text(taxels.ids[row]) for row in rows)}]",
        "point3d[] primvars:taxel:position": _rows(positions),
        "normal3d[] primvars:taxel:normal": _rows(normals),
        "vector3d[] primvars:taxel:tangent": _rows(taxels.tangents[rows]),
        "double[] primvars:taxel:area": _row(areas),
    }
    if np.isfinite(taxels.sigma[rows]).any():
        values["double3[] primvars:taxel:sigma"] = _rows(taxels.sigma[rows])
    of_points = ' (\n            interpolation = "vertex"\n        )'  # a value for each point
    return [
        f'    def Points "{name}" (\n        displayName = {_text(patch)}\n    )\n    {{',
        *(
            f"        {key} = {value}{of_points * (not key.endswith((' ids', ' points')))}"
            for key, value in values.items()
        ),
        "    }",
    ]


def _row(values: Array | IntArray) -> str:
    return f"[{', '.join(map(repr, values.tolist()))}]"


def _rows(values: Array) -> str:
    rows = (f"({', '.join(map(repr, row))})" for row in values.tolist())
    return f"[{', '.join(rows)}]"


def _text(name: str) -> str:
    """Return a name between quotation marks."""
    return '"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"'
