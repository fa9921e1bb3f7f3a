"""What a calibration is, in words and numbers: the summary of a fit, the table of a file."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .calibration.model import LinkCalibration
from .deviation import DistanceStatistics
from .laying import Laid
from .pipeline import Calibrated
from .skin.board_taxels import angles
from .skin.imported import Distances

# What is told of boards, in metres.
BOARD_LENGTHS = ("pitch_error", "gap", "collision", "overhang")


def summary(result: Calibrated, path: Path) -> str:
    """A dozen lines about one fit: what, how far off, how it sits, how long."""
    fit, seconds, errors = result.fit, result.seconds, result.fit.errors
    n, m = fit.lines.origins.shape[:2]
    taxels = sum(len(p.taxels.ids) for p in result.calibration.patches)
    mesh = result.calibration.mesh
    return "\n".join(
        (
            f"link             {result.calibration.link}",
            f"mesh             {mesh.file}: {mesh.faces} faces; cover {len(result.cover.faces)} faces",
            f"surface          {n} x {m} control points, degree {fit.surface.degree}, {fit.passes} passes, "
            f"{fit.missing:.1%} of the samples missing",
            f"surface to mesh  {_millimetres(errors.surface_to_mesh)}",
            f"mesh to surface  {_millimetres(errors.mesh_to_surface)}",
            f"Hausdorff        {errors.hausdorff * 1e3:.4f} mm",
            f"taxels           {taxels} in {len(result.calibration.patches)} patches",
            *(line for laid in result.laid for line in _how_it_sits(laid)),
            "time             " + ", ".join(f"{name} {s * 1e3:.1f} ms" for name, s in seconds.items()),
            f"calibration      {path}",
        )
    )


def _how_it_sits(laid: Laid) -> Iterator[str]:
    """A line or two about a patch: the strain of a sheet and how it closes, the worst of the boards."""
    quality, name = laid.patch.taxels.quality, f"{laid.patch.name[:16]:16} "
    if "strain" in quality:
        strain = np.abs(quality["strain"]).max(axis=0)
        yield f"{name}strain at most {strain[:2].max():.2%}, shear {np.rad2deg(strain[2]):.2f} degrees"
    if laid.closure is not None:
        gaps = 1e3 * laid.closure.gaps
        yield f"{name}{laid.closure.of} close with gaps of {gaps.min():.2f} to {gaps.max():.2f} mm"
    if laid.imported is not None:
        before = laid.imported.before
        yield f"{name}to the surface {_millimetres(before.surface)}"
    if "pitch_error" in quality:
        worst = {key: 1e3 * np.abs(quality[key]).max() for key in BOARD_LENGTHS if key in quality}
        lengths = ", ".join(f"{key.replace('_', ' ')} {value:.2f}" for key, value in worst.items())
        yield f"{name}tilt at most {np.rad2deg(quality['tilt'].max()):.1f} degrees; at most {lengths} mm"


def _distances(distances: Distances) -> dict[str, Any]:
    of = {"surface": distances.surface, "mesh": distances.mesh}
    return {name: {"mean": d.mean, "rms": d.rms, "max": d.max} for name, d in of.items() if d is not None}


def _patch_document(laid: Laid) -> dict[str, Any]:
    """How one patch sits, for the report."""
    taxels = laid.patch.taxels
    document: dict[str, Any] = {
        "name": laid.patch.name,
        "kind": laid.patch.kind,
        "taxels": len(taxels.ids),
        "area": {"min": taxels.areas.min(), "mean": taxels.areas.mean(), "max": taxels.areas.max()},
    }
    for key, values in sorted(taxels.quality.items()):
        document[key] = {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
    if laid.imported is not None:
        document["distances"] = {name: _distances(getattr(laid.imported, name)) for name in ("before", "after")}
    if laid.closure is not None:
        closure = laid.closure
        document["closure"] = {"of": closure.of, "gaps": closure.gaps.tolist(), "steps": closure.steps.tolist()}
    if taxels.ports:
        row = {taxel: i for i, taxel in enumerate(taxels.ids)}
        pairs = [(i, row[b]) for i, beside in enumerate(taxels.neighbours) for b in beside if i < row.get(b, -1)]
        tilts = angles(taxels.normals_link, np.array(pairs, int).reshape(-1, 2))
        document["tilts"] = [[taxels.ids[a], taxels.ids[b], t] for (a, b), t in zip(pairs, tilts.tolist())]
    return document


def _millimetres(d: DistanceStatistics) -> str:
    return f"mean {d.mean * 1e3:.4f}, rms {d.rms * 1e3:.4f}, max {d.max * 1e3:.4f} mm"


def report_document(result: Calibrated) -> dict[str, Any]:
    """Errors, sizes and times of one fit as JSON; metres and seconds."""
    fit = result.fit
    errors = {
        name: {"mean": d.mean, "rms": d.rms, "max": d.max}
        for name, d in (
            ("mesh_to_surface", fit.errors.mesh_to_surface),
            ("surface_to_mesh", fit.errors.surface_to_mesh),
        )
    }
    return {
        "link": result.calibration.link,
        "control_points": int(np.prod(fit.lines.origins.shape[:2])),
        "passes": fit.passes,
        "missing": fit.missing,
        "settled": fit.settled,
        "noise": fit.noise,
        "condition": fit.condition,
        "dropped_loops": int(fit.dropped_loops.max()),
        "leave_one_out": fit.leave_one_out().tolist(),
        "doubts": list(result.doubts),
        "worst": {"uv": fit.worst[0].tolist(), "point": fit.worst[1].tolist(), "distance": fit.worst[2]},
        "smallest_area": fit.smallest_area,
        "errors": errors | {"hausdorff": fit.errors.hausdorff},
        "taxels": sum(len(p.taxels.ids) for p in result.calibration.patches),
        "patches": [_patch_document(laid) for laid in result.laid],
        "seconds": result.seconds,
    }


def table(calibration: LinkCalibration) -> str:
    """What a calibration file holds, for a person to read."""
    mesh = calibration.mesh
    lines = [
        f"link      {calibration.link}",
        f"mesh      {mesh.file}: {mesh.vertices} vertices, {mesh.faces} faces",
        f"by        {calibration.generator}",
    ]
    for s in calibration.surfaces:
        lines.append(
            f"surface   {s.name}: {s.control_net.shape[0]} x {s.control_net.shape[1]} control points, degree {s.degree}"
        )
        lines.append(f"          surface to mesh: {_millimetres(s.errors.surface_to_mesh)}")
    for p in calibration.patches:
        t = p.taxels
        channels = f"channels {t.channels.min()} to {t.channels.max()}" if len(t.ids) else "no channels"
        lines.append(f"patch     {p.name}: {p.kind} of {p.shape[0]} x {p.shape[1]}, {len(t.ids)} taxels, {channels}")
        for name, values in t.quality.items():
            largest = np.abs(values).max(axis=0)
            lines.append(f"          largest {name}: {np.array2string(np.atleast_1d(largest), precision=4)}")
    return "\n".join(lines)
