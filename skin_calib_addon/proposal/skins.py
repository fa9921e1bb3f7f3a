"""The skin that an author wants on a robot, and its placement on a proposed surface."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..calibration.model import TaxelArray
from ..common.arrays import Array, BoolArray
from ..common.errors import InvalidPlan, SkinCalibError
from ..common.strict_json import parse, read
from ..common.text import real
from ..common.warnings import point_of
from ..geometry.fit.surface_fit import SurfaceFit
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..pipeline.place_skins import place_skin, sheet_patch
from ..plan.document import skins_from
from ..plan.file import check_part
from ..plan.skins import BoardSkin, SheetSkin
from ..skin.between import overlaps
from ..skin.boards.overlap import largest_apart
from ..skin.lattice import SIDE, HexLattice
from ..skin.sheet.landmarks import Landmark
from ..skin.single_taxels import SingleTaxel
from ..skin.warnings import STRAIN_LIMIT
from .boards import boards_on, open_cells
from .candidates import DECIMALS
from .chains import MIN_CHAIN
from .link_points import LinkPoints
from .surfaces import MIN_CELLS
from .trial import site_steps

FORMS = (
    'Write "hexagons:16.3mm" (length of a side), "sheet:6x22x10mm" (rows, columns, pitch), or the name of a file. '
    'More: "hexagons:8mm,gap=0.5mm,thickness=3mm,chain=3" (of at least 3 boards), "sheet:6x22x10mm,thickness=3mm".'
)
DEFAULT_SKIN = "hexagons:8mm"  # on eight real links these cover twice the area that boards of TUM cover


@dataclass(frozen=True)
class SkinChoice:
    """The skin for all surfaces of a robot."""

    template: SheetSkin | BoardSkin
    text: str  # as the author wrote it
    chain: int = MIN_CHAIN  # boards of the shortest chain, unless a link has no longer one
    is_wanted: bool = False  # whether the author named the links: they may be of any size

    @property
    def least_area(self) -> float:
        """Return the free area that a link needs [m^2]."""
        lattice = self.template.lattice
        if self.is_wanted:
            return 0.0
        return (MIN_CELLS if isinstance(lattice, HexLattice) else lattice.rows * lattice.columns) * self.cell

    @property
    def cell(self) -> float:
        """Return the area of a cell [m^2]."""
        lattice = self.template.lattice
        return lattice.area if isinstance(lattice, HexLattice) else float(np.prod(lattice.pitch))


class Form(NamedTuple):
    """Kind and size of a skin that a text describes."""

    kind: str  # "hexagons", "sheet" or "file"
    length: float = 0.0  # of a side, or pitch [mm]
    rows: int = 1
    columns: int = 1
    gap: float | None = None  # between boards [mm]; None: the usual one
    thickness: float | None = None  # of a board or sheet [mm]; None: none
    chain: int | None = None  # boards of the shortest chain; None: the usual number

    @property
    def text(self) -> str:
        """The text that describes boards or a sheet."""
        size = f"{self.rows}x{self.columns}x" if self.kind == "sheet" else ""
        more = (f",{name}={v:g}mm" for name in ("gap", "thickness") if (v := getattr(self, name)) is not None)
        chain = "" if self.chain is None else f",chain={self.chain}"
        return f"{self.kind}:{size}{self.length:g}mm{''.join(more)}{chain}"


def form_of(text: str) -> Form:
    """Return kind and size of a skin; a text that states none is the name of a file."""
    if text == "hexagons":
        return Form("hexagons", 1e3 * SIDE)
    found = re.fullmatch(
        r"(hexagons|sheet):(?:(\d+)x(\d+)x)?(\d+(?:\.\d*)?)mm(?:,gap=(-?\d+(?:\.\d*)?)mm)?(?:,thickness=(\d+(?:\.\d*)?)mm)?"
        r"(?:,chain=(\d{1,4}))?",
        text,
    )
    if found is None or (found[1] == "sheet") != bool(found[2]) or found[1] == "sheet" and (found[5] or found[7]):
        return Form("file")
    gap, thickness = (None if word is None else real(word) for word in found.groups()[4:6])
    chain = None if found[7] is None else int(found[7])
    return Form(found[1], real(found[4]), int(found[2] or 1), int(found[3] or 1), gap, thickness, chain)


def parse_skin(text: str) -> SkinChoice:
    """Return the skin that a text describes. Its taxels are in the middle of a thickness."""
    form = form_of(text)
    length = round(form.length * 1e-3, 9)  # [m]
    more = {} if form.thickness is None else {"offset": round(form.thickness * 5e-4, 9)}
    if form.kind == "hexagons":
        gap = 0.0 if form.gap is None and length != SIDE else form.gap
        more |= {} if gap is None else {"gap": round(gap * 1e-3, 9)}
        choice = _choice({"kind": "hexagons", "side": length} | more, text)
        return choice if form.chain is None else replace(choice, chain=form.chain)
    if form.kind == "sheet":
        size_of = {"rows": form.rows, "columns": form.columns, "pitch": [length, length]}
        return _choice({"kind": "sheet"} | size_of | more, text)
    if text.endswith(".json"):
        document, findings = parse(read(Path(text)))
        if findings or not isinstance(document, dict) or document.get("kind") not in ("sheet", "hexagons"):
            raise InvalidPlan(f"{text} has no sheet or hexagons, as in the skins of a plan. {FORMS}")
        return _choice(document, text)
    raise InvalidPlan(f"{text!r} is not a skin. {FORMS}")


def _choice(document: dict[str, Any], text: str) -> SkinChoice:
    """Return the skin of a document, without the place that it has there; raise InvalidPlan if no plan may have it."""
    defaults: dict[str, Any] = {"name": "skin"}
    if document["kind"] == "sheet":
        defaults |= {"direction": [1, 0, 0]} | ({} if "landmarks" in document else {"origin": "center"})
    try:
        for finding in check_part(defaults | document, document["kind"]):
            raise InvalidPlan(f"{finding.pointer} {finding.message}")
        (skin,) = skins_from([defaults | document])
    except InvalidPlan as problem:
        raise InvalidPlan(f"{text} is not a skin as in a plan: {problem}. {FORMS}") from problem
    if isinstance(skin, SheetSkin):
        skin = replace(skin, origin=None, first_channel=None, registration=None, touches=None, landmarks=(), trim=True)
    else:
        assert isinstance(skin, BoardSkin)
        skin = replace(skin, origin=None, first_channel=None, registration=None, touches=None, choice="fill")
    return SkinChoice(skin, text)


def skin_on(choice: SkinChoice, fit: SurfaceFit, surface: str) -> tuple[SheetSkin | BoardSkin, TaxelArray]:
    """Return a skin for a surface, and its taxels."""
    template = replace(choice.template, name=surface, surface=surface)
    return boards_on(template, fit) if isinstance(template, BoardSkin) else _sheet_on(template, fit)


def _sheet_on(template: SheetSkin, fit: SurfaceFit) -> tuple[SheetSkin, TaxelArray]:
    """Return the sheet in the middle of a surface, along its longer side or across it; one that is too large fails."""
    uv, point, tangents = widest_place(fit)
    lengths = np.array([iso_length(fit, uv, axis) for axis in (0, 1)])
    rows, columns = template.lattice.rows, template.lattice.columns
    pitch = template.lattice.pitch
    sizes = [(int(lengths[1 - along] / pitch[0]), int(lengths[along] / pitch[1])) for along in (0, 1)]
    most = max(sizes, key=lambda size: size[0] * size[1])
    problem: SkinCalibError = InvalidPlan(
        f"The sheet has {rows} x {columns} cells, and {most[0]} x {most[1]} fit. State a smaller one."
        if min(most) > 0
        else "The surface is smaller than a cell."
    )
    for along in np.argsort(lengths)[::-1].tolist():
        if sizes[along][0] < rows or sizes[along][1] < columns:
            continue
        mark = Landmark((rows // 2, columns // 2), point)
        direction = tuple(np.round(tangents[along], DECIMALS).tolist())
        skin = replace(template, landmarks=(mark,), direction=direction)
        try:
            return skin, place_skin(skin, fit, 0).patch.taxels
        except SkinCalibError as error:
            problem = error
    raise problem


def apart(mesh: TriangleMesh, on: LinkPoints, sheets: Sequence[tuple[SheetSkin, TaxelArray]]) -> list[BoolArray]:
    """Return which cells of the sheets of a link can be used, for each sheet: seen, free, and without overlaps.

    Cells that a flat sheet cannot take are left out, too: those with more strain than a warning allows.
    """
    disabled = [{single.taxel for single in skin.taxels if not single.enabled} for skin, _ in sheets]
    kept = np.array([f"{i}.{j}" not in off for off, (_, t) in zip(disabled, sheets) for i, j in t.index], bool)
    strain = np.concatenate([np.abs(t.quality["strain"][:, :2]).max(axis=1) for _, t in sheets])
    kept &= open_cells(mesh, on, [t for _, t in sheets]) & (strain <= STRAIN_LIMIT)
    row = {id: k for k, id in enumerate(id for _, taxels in sheets for id in taxels.ids)}
    patches = [sheet_patch(skin, taxels) for skin, taxels in sheets]
    pairs = [(row[a], row[b]) for one, other in combinations(patches, 2) for a, b, _ in overlaps(one, other)]
    conflicts = np.array([pair for pair in pairs if kept[list(pair)].all()], np.int64).reshape(-1, 2)
    kept &= largest_apart(len(kept), conflicts)
    return np.split(kept, np.cumsum([len(taxels.ids) for _, taxels in sheets])[:-1])


def without_cells(skin: SheetSkin, taxels: TaxelArray, kept: BoolArray) -> SheetSkin:
    """Return a sheet whose other cells are disabled."""
    off = {f"{i}.{j}" for i, j in taxels.index[~kept]}
    others = tuple(single for single in skin.taxels if single.taxel not in off)
    return replace(skin, taxels=(*others, *(SingleTaxel(name, enabled=False) for name in sorted(off))))


def widest_place(fit: SurfaceFit) -> tuple[Array, tuple[float, float, float], Array]:
    """Return the place of a surface that is farthest from its boundary: parameters, point, unit tangents (2, 3)."""
    from scipy import ndimage

    n, m = (8 * k for k in fit.offsets.shape)
    u, v = np.linspace(0, 1, n), np.linspace(0, 1, m, endpoint=not fit.lines.closed)
    uv = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1)
    trusted = fit.is_trusted(uv.reshape(-1, 2)).reshape(n, m)
    points = fit.surface.grid_points(u, v)
    # Around a tube the mask continues; the other edges are boundaries.
    wide = np.pad(np.tile(trusted, (1, 3)), ((1, 1), (0, 0))) if fit.lines.closed else np.pad(trusted, 1)
    first = m if fit.lines.closed else 1
    steps = site_steps(np.where(trusted[..., None], points, np.nan))
    depth = ndimage.distance_transform_edt(wide, sampling=steps)[1:-1, first : first + m]
    i, j = np.unravel_index(int(depth.argmax()), depth.shape)
    derivatives = fit.surface.derivatives(uv[i, j][None])
    tangents = np.stack((derivatives[1, 0][0], derivatives[0, 1][0]))
    return uv[i, j], point_of(np.round(points[i, j], DECIMALS)), tangents / np.linalg.norm(tangents, axis=1)[:, None]


def iso_length(fit: SurfaceFit, uv: Array, axis: int) -> float:
    """Return the length of the curve of a surface through a place, along u (0) or v (1), inside the boundary [m]."""
    fine = np.linspace(0, 1, 200)
    curve = np.tile(uv, (len(fine), 1))
    curve[:, axis] = fine
    inside = fit.is_trusted(curve)
    steps = np.linalg.norm(np.diff(fit.surface.points(curve), axis=0), axis=1)
    return float(steps[inside[1:] & inside[:-1]].sum())
