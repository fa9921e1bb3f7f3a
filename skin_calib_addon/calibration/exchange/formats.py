"""List the formats of other programs that can be read or written."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

from ..model import LinkCalibration
from .icub import write_icub
from .mjcf import write_mjcf
from .npz import write_npz
from .pcd import write_pcd
from .ply import write_ply
from .reading import READABLE
from .rsdf import write_rsdf
from .table import write_gentact, write_table
from .tum import write_tum
from .urdf import write_frames, write_sensors
from .usd import write_usd


@dataclass(frozen=True)
class Format:
    """A format of another program; ``write`` raises CalibrationFormatError for content that it cannot represent."""

    name: str
    ending: str  # of its files
    what: str  # program and content
    labels: str  # what identifies a taxel in the file
    write: Callable[[LinkCalibration], bytes]

    @property
    def readable(self) -> bool:
        """Return whether ``import`` can read the format."""
        return self.name in READABLE


_TABLE = (
    Format("csv", ".csv", "table of all data of each taxel", "the id", write_table),
    Format("gentact", ".csv", "table of GenTact", "the channel", write_gentact),
    Format("icub", ".txt", "positions of iCub and YARP skin", "the channel, which is the row", write_icub),
    Format("tum", ".xml", "skin patch of the TUM driver", "the channel plus one", write_tum),
    Format("urdf", ".urdf", "frames fixed to the link", "the id; the order gives the channels", write_frames),
    Format("urdf-tactile", ".urdf", "tactile sensors of tactile_toolbox", "patch.channel", write_sensors),
    Format("mjcf", ".xml", "MuJoCo: touch sensors and tactile meshes", "the id", write_mjcf),
    Format("newton", ".xml", "Newton: MJCF without tactile meshes", "the id", partial(write_mjcf, tactile=False)),
    Format("usd", ".usda", "USD: points with primvars in the link frame", "primvars:taxel:id", write_usd),
    Format("npz", ".npz", "poses for Isaac Lab (DEX-01)", "the id", write_npz),
    Format("ply", ".ply", "point cloud with normals", "the id, in a comment", write_ply),
    Format("pcd", ".pcd", "point cloud of PCL with normals", "the id, in a comment", write_pcd),
    Format(
        "rsdf", ".rsdf", "planar surfaces of mc_rtc, for flat patches", "none: the file contains patches", write_rsdf
    ),
)
FORMATS = {format.name: format for format in _TABLE}
WRITABLE = tuple(FORMATS)


def listed(names: Iterable[str]) -> str:
    """Return a line for each of some formats, for ``--help``."""
    return "\n".join(("formats:", *(f"  {name:13} {FORMATS[name].what} ({FORMATS[name].ending})" for name in names)))
