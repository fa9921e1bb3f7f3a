"""The author's choices as a file: what to cut, where the planes are, which skins."""

import json
import os.path
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ..calibration.response import AnyResponse, Response, response_document, response_from
from ..calibration.response_checks import responses_are_monotone
from ..calibration.validate import other_file
from ..common.atomic_file import write_bytes_safely
from ..common.errors import CalibrationFormatError, InvalidPlan
from ..common.findings import Finding, error
from ..common.schema_check import check, read_schema
from ..common.strict_json import parse, read
from ..geometry.grid.axis import Axis
from ..geometry.grid.grids import Across, Grid, PlanesGrid, Region, Sector, Size, Tolerance, Tube, axis_along
from ..geometry.mesh.cover import CoverSpec, Cut
from ..geometry.sampling.planes import Planes
from .skins import ImportedSkin, Skin, direction_from, skin_document, skins_from

FORMAT, VERSION = "skin-plan", 1

NO_REGION = 'a patch needs either "from" and "to" (a sector of a tube) or "normal" (planes across a face)'


@dataclass(frozen=True)
class Plan:
    """Everything that turns one link's mesh into its calibration."""

    link: str
    mesh: Path
    unit: str
    cover: CoverSpec
    grid: Grid | PlanesGrid
    degree: tuple[int, int]
    skins: tuple[Skin, ...]
    response: AnyResponse = Response()
    chords: bool = False  # whether the mesh's facets are chords of the true surface
    extra: dict[str, Any] = field(default_factory=dict)  # ``x_`` members, kept as they came


def load_plan(path: str | Path) -> Plan:
    """Read a plan file; paths in it become relative to the file's folder.

    Raises
    ------
    CalibrationFormatError
        If the file is missing or breaks the schema; ``findings`` has everything found.
    InvalidPlan
        If its members do not go together.
    """
    path = Path(path)
    document, findings = parse(read(path))
    findings = tuple(findings) or check_plan(document)
    if findings:
        more = f" (and {len(findings) - 1} more: run check)" if len(findings) > 1 else ""
        raise CalibrationFormatError(f"{path.name} is no valid plan: {findings[0]}{more}", findings)
    plan = plan_from(document)
    skins = tuple(
        replace(skin, file=path.parent / skin.file) if isinstance(skin, ImportedSkin) else skin for skin in plan.skins
    )
    return replace(plan, mesh=path.parent / plan.mesh, skins=skins)


def check_plan(document: Any) -> tuple[Finding, ...]:
    """Every place where a document breaks the plan's schema, or its response turns round."""
    other = tuple(other_file(document, FORMAT, VERSION))
    if other:
        return other
    findings = check(document, _schema())
    return (*findings, *responses_are_monotone(document, findings))


def check_plan_wholly(document: Any) -> tuple[Finding, ...]:
    """The same, or what of its members does not go together where each is right."""
    findings = check_plan(document)
    if not findings:
        try:
            plan_from(document)
        except InvalidPlan as problem:
            findings = (error("plan", "", f"cannot be carried out: {problem}"),)
    return findings


def check_frame(frame: Any) -> tuple[Finding, ...]:
    """Every place where the frame of imported taxels breaks the plan's schema."""
    definitions = _schema()["$defs"]
    return check(frame, definitions["frame"] | {"$defs": definitions})


@cache
def _schema() -> dict[str, Any]:
    return read_schema(Path(__file__).with_name("schema.json"))


def plan_from(document: dict[str, Any]) -> Plan:
    """The plan in a document that keeps the schema.

    Raises
    ------
    InvalidPlan
        If its members do not go together.
    """
    cover = document.get("cover", {})
    return Plan(
        link=document["link"],
        mesh=Path(document["mesh"]),
        unit=document["unit"],
        cover=CoverSpec(
            cover.get("shell", "outer"),
            tuple(
                Cut(tuple(c["point"]), direction_from(c["normal"], f"the normal of cut {i} is zero; say what to keep"))
                for i, c in enumerate(cover.get("cuts", ()))
            ),
        ),
        grid=_grid(document["grid"]),
        degree=tuple(document.get("degree", (3, 3))),
        skins=skins_from(document["skins"]),
        response=response_from(document["response"]) if "response" in document else Response(),
        chords=document.get("chords", False),
        extra={k: v for k, v in document.items() if k.startswith("x_")},
    )


def _grid(grid: dict[str, Any]) -> Grid | PlanesGrid:
    if grid["kind"] == "planes":
        u, v = (
            Planes(np.array([p["point"] for p in side]), np.array([p["normal"] for p in side]))
            for side in (grid["u"], grid["v"])
        )
        for name in ("u", "v"):
            for i, plane in enumerate(grid[name]):
                direction_from(plane["normal"], f"the normal of {name}-plane {i} is zero; give its direction")
        return PlanesGrid(u, v, grid["closed"])
    if grid["kind"] == "auto":
        return Grid(_region(grid), Tolerance(grid["tolerance"], grid.get("measure", "mean")))
    if ("m" in grid) == ("lines" in grid):
        raise InvalidPlan('the grid needs either "m" (planes) or "lines", not both and not none')
    region = _region(grid)
    if isinstance(region, Across) and region.axis is not None:  # only its direction counts
        region = replace(region, axis=axis_along(region.axis.direction))
    if (grid["kind"] == "patch") == isinstance(region, Tube):
        raise InvalidPlan(NO_REGION)
    lines = grid.get("lines", grid.get("m", 0) * (2 if grid["kind"] == "tube" else 1))
    return Grid(region, Size(grid["n"], lines), grid.get("spacing", "auto"))


def _region(grid: dict[str, Any]) -> Region:
    """The part of the mesh that a grid is for."""
    both = {"from", "to"} & grid.keys()
    if "normal" in grid and both or len(both) == 1:
        raise InvalidPlan(NO_REGION)
    axis, margin = _axis(grid), grid.get("margin")
    if "normal" in grid:
        message = 'the "normal" of the grid is zero; give the direction the face looks to'
        return Across(axis, margin, normal=direction_from(grid["normal"], message))
    return Sector(axis, margin, start=grid["from"], stop=grid["to"]) if both else Tube(axis, margin)


def _axis(grid: dict[str, Any]) -> Axis | None:
    axis = grid.get("axis", "auto")
    if axis == "auto":
        return None
    direction = direction_from(axis["direction"], 'the "direction" of the axis is zero; give where the link runs to')
    return Axis(tuple(axis["point"]), direction)


def plan_document(plan: Plan) -> dict[str, Any]:
    """The plan as the JSON document that reads back to it."""
    document: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "link": plan.link,
        "mesh": plan.mesh.as_posix(),
        "unit": plan.unit,
        "cover": {
            "shell": plan.cover.shell,
            "cuts": [{"point": [*c.point], "normal": [*c.normal]} for c in plan.cover.cuts],
        },
        "grid": _grid_document(plan.grid),
        "degree": [*plan.degree],
        "skins": [skin_document(skin) for skin in plan.skins],
    }
    if plan.chords:
        document["chords"] = True
    if plan.response != Response():
        document["response"] = response_document(plan.response)
    return document | plan.extra


def _grid_document(grid: Grid | PlanesGrid) -> dict[str, Any]:
    if isinstance(grid, PlanesGrid):
        sides = {
            name: [{"point": p, "normal": q} for p, q in zip(side.points.tolist(), side.normals.tolist())]
            for name, side in (("u", grid.u), ("v", grid.v))
        }
        return {"kind": "planes", **sides, "closed": grid.closed}
    region, axis = grid.region, {"axis": _line(grid.region.axis)}
    normal = {"normal": [*region.normal]} if isinstance(region, Across) else {}
    sector = {"from": region.start, "to": region.stop} if isinstance(region, Sector) else {}
    margin = {} if region.margin is None else {"margin": region.margin}
    if isinstance(grid.size, Tolerance):
        size: dict[str, Any] = {"kind": "auto", "tolerance": grid.size.tolerance, "measure": grid.size.measure}
        return size | axis | sector | normal | margin
    size = {"kind": "tube" if isinstance(region, Tube) else "patch", "n": grid.size.n, "lines": grid.size.lines}
    where = normal | (axis if region.axis else {}) if normal else axis | sector
    return size | {"spacing": grid.spacing} | where | margin


def _line(axis: Axis | None) -> Any:
    return {"point": [*axis.point], "direction": [*axis.direction]} if axis else "auto"


def named_from(plan: Plan, folder: Path) -> Plan:
    """The plan with its files named from a folder, as a plan file in it has them."""

    def named(path: Path) -> Path:
        try:
            return Path(os.path.relpath(path, folder))
        except ValueError:  # on another drive
            return path.absolute()

    skins = tuple(replace(s, file=named(s.file)) if isinstance(s, ImportedSkin) else s for s in plan.skins)
    return replace(plan, mesh=named(plan.mesh), skins=skins)


def save_plan(plan: Plan, path: str | Path) -> None:
    """Write a plan file, whole or not at all; the mesh path is written as it stands in the plan."""
    write_bytes_safely(path, (json.dumps(plan_document(plan), indent=2, ensure_ascii=False) + "\n").encode())
