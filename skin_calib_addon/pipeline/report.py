"""Describe a calibration as text and as JSON: summary of a fit, report, table of a file."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..calibration.model import LinkCalibration, MeshSource, Patch, TaxelArray, Touched, neighbour_rows
from ..calibration.response import AnyResponse, ResponseTable
from ..calibration.robot_set import RobotSet
from ..common.arrays import Array
from ..common.errors import counted, listed, millimetres
from ..common.findings import printable
from ..common.surface_errors import DistanceStatistics
from ..common.warnings import to_document
from ..geometry.fit.fitting import leave_one_out
from ..geometry.fit.surface_fit import SurfaceFit
from ..geometry.mesh.cover import single_faces
from ..geometry.mesh.triangle_mesh import TriangleMesh
from ..geometry.mesh.visibility import visibility
from ..skin.imported import Distances
from ..skin.neighbours import angles
from .calibrate import Calibrated
from .place_skins import PlacedSkin

# Reported qualities of boards that are lengths [m].
COUNTED = "(parallel faces at any distance)"  # which parts of the mesh count for the errors from mesh to surface
BOARD_LENGTHS = ("pitch_error", "gap", "collision", "overhang")


def summary(result: Calibrated, path: Path) -> str:
    """Return a summary of one fit: sizes, errors, placement, time."""
    seconds = result.seconds
    mesh = result.calibration.mesh
    return "\n".join(
        (
            f"link             {result.calibration.link}",
            f"mesh             {mesh.file}: {mesh.faces} faces; cover {len(result.cover.faces)} faces{_off(mesh)}",
            *(line for name in result.fits for line in _surface_summary(result, name)),
            f"taxels           {result.taxels} in {len(result.calibration.patches)} patches",
            *(line for placed in result.placed for line in _patch_summary(placed)),
            "time             " + ", ".join(f"{name} {s * 1e3:.1f} ms" for name, s in seconds.items()),
            f"calibration      {path}",
        )
    )


def _off(mesh: MeshSource) -> str:
    """Describe the deviation of the part from its mesh, which the uncertainties contain; empty if none is stated."""
    stated = mesh.uncertainty
    if stated is None:
        return ""
    deviation, length = stated.standard_deviation * 1e3, stated.correlation_length * 1e3
    return f"; part deviates by {deviation:.3g} mm, correlated over {length:.3g} mm"


def _surface_summary(result: Calibrated, name: str) -> Iterator[str]:
    """Yield lines about a surface: its cover, size and errors."""
    fit = result.fits[name]
    n, m = fit.lines.origins.shape[:2]
    if len(result.fits) > 1:
        yield f"on surface       {name}, cover {len(result.covers[name].faces)} faces"
    yield (
        f"surface          {n} x {m} control points, degree {fit.surface.degree}, {fit.iterations} iterations, "
        f"{fit.missing:.1%} of the samples missing"
    )
    yield f"surface to mesh  {_millimetres(fit.errors.surface_to_mesh)}"
    yield f"mesh to surface  {_millimetres(fit.errors.mesh_to_surface)} {COUNTED}"
    yield f"Hausdorff        {fit.errors.hausdorff * 1e3:.4f} mm"


def _patch_summary(placed: PlacedSkin) -> Iterator[str]:
    """Yield lines about a patch: strain and gaps of a sheet, largest deviations of boards."""
    quality, name = placed.patch.taxels.quality, f"{placed.patch.name:16} "
    if "strain" in quality:
        strain = np.abs(quality["strain"]).max(axis=0)
        yield f"{name}strain at most {strain[:2].max():.2%}, shear {np.rad2deg(strain[2]):.2f} degrees"
    if placed.disabled is not None:
        yield f"{name}disabled taxels: {listed(placed.disabled.taxels.ids)}"
    if np.isfinite(placed.patch.taxels.sigma).any():
        yield name + _uncertainty(placed.patch.taxels)
    if placed.closure is not None:
        gaps = 1e3 * placed.closure.gaps
        yield f"{name}{placed.closure.of} close with gaps of {gaps.min():.2f} to {gaps.max():.2f} mm"
    if placed.imported is not None:
        before = placed.imported.before
        yield f"{name}to the surface {_millimetres(before.surface)}"
        fit = placed.imported.fit
        if fit is not None and fit.nearby is not None:
            near = fit.nearby
            yield (
                f"{name}heights above the mesh deviate by {near.before * 1e3:.3f} mm (rms), and by "
                f"{near.after * 1e3:.3f} mm after the best motion of {np.rad2deg(near.angle):.1f} degrees and "
                f"{near.shift * 1e3:.1f} mm"
            )
    if "pitch_error" in quality:
        worst = {key: 1e3 * np.abs(quality[key]).max() for key in BOARD_LENGTHS if key in quality}
        lengths = ", ".join(f"{key.replace('_', ' ')} {value:.2f}" for key, value in worst.items())
        yield f"{name}tilt at most {np.rad2deg(quality['tilt'].max()):.1f} degrees; at most {lengths} mm"


def _distances(distances: Distances) -> dict[str, Any]:
    of = {"surface": distances.surface, "mesh": distances.mesh}
    return {name: {"mean": d.mean, "rms": d.rms, "max": d.max} for name, d in of.items() if d is not None}


def _patch_document(placed: PlacedSkin) -> dict[str, Any]:
    """Return data about one patch for the report."""
    taxels = placed.patch.taxels
    document: dict[str, Any] = {
        "name": placed.patch.name,
        "kind": placed.patch.kind,
        "taxels": len(taxels.ids),
        "area": {"min": taxels.areas.min(), "mean": taxels.areas.mean(), "max": taxels.areas.max()},
    }
    if placed.disabled is not None:
        document["disabled"] = list(placed.disabled.taxels.ids)
    for key, values in sorted(taxels.quality.items()):
        document[key] = {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
    if placed.imported is not None:
        document["distances"] = {name: _distances(getattr(placed.imported, name)) for name in ("before", "after")}
        fit = placed.imported.fit
        if fit is not None and fit.nearby is not None:
            names = ("before", "after", "angle", "shift")
            document["registration"] = {name: getattr(fit.nearby, name) for name in names}
    if placed.closure is not None:
        closure = placed.closure
        document["closure"] = {"of": closure.of, "gaps": closure.gaps.tolist(), "steps": closure.steps.tolist()}
    if taxels.ports:
        pairs = neighbour_rows(taxels.ids, taxels.neighbours)
        pairs = pairs[pairs[:, 0] < pairs[:, 1]]
        tilts = angles(taxels.normals_link, pairs).tolist()
        document["tilts"] = [[taxels.ids[a], taxels.ids[b], t] for (a, b), t in zip(pairs.tolist(), tilts)]
    return document


def _millimetres(d: DistanceStatistics) -> str:
    return f"mean {d.mean * 1e3:.4f}, rms {d.rms * 1e3:.4f}, max {d.max * 1e3:.4f} mm"


def report_document(result: Calibrated) -> dict[str, Any]:
    """Return errors, sizes and times of one fit as a JSON value, in metres and seconds.

    The members of the first surface are at the top level; ``surfaces`` has those of all, if there are several.
    """
    surfaces = [{"name": name} | _surface_document(fit) for name, fit in result.fits.items()]
    several = {"surfaces": surfaces} if len(surfaces) > 1 else {}
    first = {key: value for key, value in surfaces[0].items() if key != "name"}
    return {
        "link": result.calibration.link,
        **first,
        **several,
        "warnings": to_document(result.warnings),
        "taxels": result.taxels,
        "patches": [_patch_document(placed) for placed in result.placed],
        "seconds": result.seconds,
    }


def _surface_document(fit: SurfaceFit) -> dict[str, Any]:
    """Return errors and sizes of one surface."""
    errors = {
        name: {"mean": d.mean, "mean_uncertainty": d.uncertainty, "rms": d.rms, "max": d.max}
        for name, d in (
            ("mesh_to_surface", fit.errors.mesh_to_surface),
            ("surface_to_mesh", fit.errors.surface_to_mesh),
        )
    }
    return {
        "control_points": int(np.prod(fit.lines.origins.shape[:2])),
        "iterations": fit.iterations,
        "missing": fit.missing,
        "converged": fit.converged,
        "noise": fit.noise,
        "condition": fit.condition,
        "dropped_loops": int(fit.dropped_loops.max()),
        "leave_one_out": leave_one_out(fit).tolist(),
        "worst": {"uv": fit.worst[0].tolist(), "point": fit.worst[1].tolist(), "distance": fit.worst[2]},
        "smallest_area": fit.smallest_area,
        "errors": errors | {"hausdorff": fit.errors.hausdorff},
    }


def robot_table(robot: RobotSet, calibrations: Mapping[str, LinkCalibration]) -> str:
    """Return a table of the links of a robot, a line for each and one for all."""
    rows: list[tuple[str, ...]] = [
        ("link", "parent", "patches", "taxels", "channels", "chains", "bus", "area", "mean error", "warnings")
    ]
    total, total_area = 0, 0.0
    buses: dict[str | None, Counter[str]] = {}
    for link in robot.links:
        numbers: tuple[str, ...] = ("", "", "", "", link.bus or "", "", "", "not readable")
        if calibration := calibrations.get(link.link):
            channels = np.concatenate([np.empty(0, int), *(p.taxels.channels for p in calibration.patches)])
            errors = [s.errors.surface_to_mesh.mean for s in calibration.surfaces]
            area = covered_area(calibration)
            total, total_area = total + len(channels), total_area + area
            for bus in link.buses(calibration).values():
                buses.setdefault(bus, Counter())["channels"] += 1
            for chain in link.chains:
                buses.setdefault(chain.bus or link.bus, Counter())["chains"] += 1
            sizes = [chain.boards for chain in link.chains]
            chains = f"{len(sizes)} of {_span(sizes)} boards" if sizes else ""
            numbers = (
                str(len(calibration.patches)),
                str(len(channels)),
                f"{channels.min()} to {channels.max()}" if len(channels) else "",
                chains,
                ", ".join(sorted({bus for bus in link.buses(calibration).values() if bus})),
                f"{area * 1e4:.1f} cm²",
                f"{max(errors) * 1e3:.4f} mm" if errors else "",
                str(len(calibration.warnings) or ""),
            )
        rows.append((link.link, link.parent or "", *numbers))
    widths = [max(map(len, column)) for column in zip(*rows)]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in rows)
    counts = f"{counted(len(robot.links), 'link')}, {counted(total, 'taxel')}"
    of_buses = (
        f"{f'bus {bus}' if bus else 'no bus named'}: {counted(found['chains'], 'chain')} of boards, "
        f"{counted(found['channels'], 'channel')}"
        for bus, found in sorted(buses.items(), key=lambda item: (item[0] is None, item[0]))
        if found["chains"] or bus
    )
    return "\n".join((*lines, *of_buses, f"{robot.robot}: {counts}, {total_area * 1e4:.0f} cm²"))


def _span(sizes: Sequence[int]) -> str:
    return f"{min(sizes)} to {max(sizes)}" if min(sizes) < max(sizes) else str(sizes[0])


def covered_area(calibration: LinkCalibration) -> float:
    """Return the area of all cells of a link [m^2]."""
    return sum(float(patch.taxels.areas.sum()) for patch in calibration.patches)


def seen_area(mesh: TriangleMesh) -> float:
    """Return the area of a mesh that can be seen from outside [m^2]."""
    mesh = single_faces(mesh)
    return float(visibility(mesh).fractions @ mesh.face_areas)


def area_table(areas: Mapping[str, tuple[float, float]]) -> str:
    """Return a table of the areas of a robot, a line for each link and one for all."""
    total = tuple(sum(column) for column in zip((0.0, 0.0), *areas.values()))
    lines = []
    for link, (cells, seen) in (*areas.items(), ("all links", total)):
        percent = 100 * cells / seen if seen else 0
        lines.append(f"cells cover {cells * 1e4:7.1f} of {seen * 1e4:7.1f} cm² seen, {percent:3.0f} %  {link}")
    return "\n".join(lines)


def table(calibration: LinkCalibration) -> str:
    """Return the content of a calibration file as readable text."""
    mesh, responses = calibration.mesh, calibration.responses
    own = f"; {len(responses)} more for single taxels" if responses else ""
    lines = [
        f"link      {calibration.link}",
        f"mesh      {mesh.file}: {mesh.vertices} vertices, {mesh.faces} faces{_off(mesh)}",
        f"by        {calibration.generator}",
        f"response  {_response(calibration.response)}{own}",
    ]
    count = sum(len(patch.taxels.ids) for patch in calibration.patches)
    for modality in calibration.modalities:
        which = "all" if modality.channels is None else f"{len(modality.channels)} of"
        response = _response(modality.response, modality.unit)
        lines.append(f"modality  {modality.name}: {response}; {which} {count} taxels")
    for s in calibration.surfaces:
        # distinct ones, as in the summary: a closed direction repeats its first ones at the end
        n, m = (size - d * c for size, d, c in zip(s.control_net.shape, s.degree, s.closed))
        closed = "".join(f", closed in {name}" for name, is_closed in zip("uv", s.closed) if is_closed)
        lines += (
            f"surface   {s.name}: {n} x {m} control points, degree {s.degree}{closed}",
            f"          surface to mesh: {_millimetres(s.errors.surface_to_mesh)}",
            f"          mesh to surface: {_millimetres(s.errors.mesh_to_surface)} {COUNTED}",
        )
    for p in calibration.patches:
        lines += _patch_lines(p)
    return "\n".join(map(printable, lines))


def _patch_lines(patch: Patch) -> Iterator[str]:
    """Yield kind, cells, channels and position of a patch, and the largest value of each quality."""
    taxels = patch.taxels
    least, most = int(taxels.channels.min()), int(taxels.channels.max())
    channels = f"channels {least} to {most}" + (", not all" if most - least >= len(taxels.ids) else "")
    cells = f"{patch.shape[0]} x {patch.shape[1]}"
    yield f"patch     {patch.name}: {patch.kind} of {cells}, {len(taxels.ids)} taxels, {channels}"
    pitch = " x ".join(f"{1e3 * length:.2f}" for length in patch.pitch)
    height = f", {1e3 * patch.offset:.2f} mm above it" if patch.offset else ""
    areas = 1e6 * taxels.areas
    yield f"          on {patch.surface}{height}; pitch {pitch} mm; areas {areas.min():.2f} to {areas.max():.2f} mm^2"
    low, high = (millimetres(f(taxels.corners_link.reshape(-1, 3), axis=0)) for f in (np.min, np.max))
    yield f"          from {low} to {high}"
    if np.isfinite(taxels.sigma).any():
        yield f"          {_uncertainty(taxels)}"
    if patch.touches is not None:
        yield from (f"          {line}" for line in registered(patch.touches))
    for name, values in sorted(taxels.quality.items()):
        for what, column, factor, unit in _columns(name, values):
            worst = int(np.abs(column).argmax())
            yield f"          largest {what}: {column[worst] * factor:.4g} {unit}, at {taxels.ids[worst]}"


def registered(touched: Touched) -> tuple[str, str]:
    """Return two lines: when and by what a patch was registered, and how well."""
    x, y, turn = (round(number, 2) + 0.0 for number in (*(1e3 * s for s in touched.shift), np.rad2deg(touched.turn)))
    session = f", session {touched.session[:8]}" if touched.session else ""
    deviations = [f"{1e3 * touched.along:.2f} mm along"]
    deviations += [] if touched.normal is None else [f"{1e3 * touched.normal:.2f} mm normal"]
    deviations += [] if touched.angle is None else [f"{np.rad2deg(touched.angle):.1f} degrees"]
    return (
        f"registered {touched.date} by {touched.used} touches, {touched.left_out} left out{session}",
        f"moved by {x:.2f}, {y:.2f} +- {1e3 * touched.shift_error:.2f} mm and {turn:.2f} +- "
        f"{np.rad2deg(touched.turn_error):.2f} degrees; touches deviate by {', '.join(deviations)} (rms)",
    )


def _uncertainty(taxels: TaxelArray) -> str:
    """Describe the mean and the largest uncertainty of some taxels; some are known."""
    known = taxels.sigma[np.isfinite(taxels.sigma).all(axis=1)] * (1e3, 1e3, 180 / np.pi)
    parts = (
        f"{mean:.3g} (at most {most:.3g}) {unit}"
        for mean, most, unit in zip(known.mean(axis=0), known.max(axis=0), ("mm along", "mm normal", "degrees"))
    )
    unknown = len(taxels.ids) - len(known)
    return f"uncertainty {', '.join(parts)}" + (f"; unknown of {unknown} taxels" if unknown else "")


def _columns(name: str, values: Array) -> Iterator[tuple[str, Array, float, str]]:
    """Yield name, values, factor and unit of each component of a quality."""
    if name == "strain":
        yield "strain along", values[:, 0], 100, "%"
        yield "strain across", values[:, 1], 100, "%"
        yield "shear", values[:, 2], 180 / np.pi, "degrees"
    elif name == "size":
        yield "size along", values[:, 0], 1e3, "mm"
        yield "size across", values[:, 1], 1e3, "mm"
    else:
        yield name.replace("_", " "), values, *((180 / np.pi, "degrees") if name == "tilt" else (1e3, "mm"))


def _response(response: AnyResponse, unit: str = "N") -> str:
    """Describe a response as text."""
    if isinstance(response, ResponseTable):
        readings, forces = response.readings, response.forces
        ends = f"readings {readings[0]:g} to {readings[-1]:g}, {min(forces):g} to {max(forces):g} {unit}"
        return f"table of {len(readings)} rows, {ends}"
    powers = ("", " I", *(f" I^{k}" for k in range(2, len(response.coefficients))))
    terms = [f"{factor:g}{power}" for factor, power in zip(response.coefficients, powers) if factor]
    ends = f", readings {response.range[0]:g} to {response.range[1]:g}" if response.range else ""
    return f"{' + '.join(terms).replace('+ -', '- ') or '0'} {unit} for a reading I{ends}"
