"""Check one surface of a calibration.

The arguments of a check are the surface and its members that `needs` names.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..common.arrays import Array
from ..common.findings import Finding, error, show, warning
from .parts import STORED_ROUNDING, Part, needs

MAX_LINK_DISTANCE = 20.0  # [m] from the link frame. Larger: numbers in millimetres pass.
# Larger values of the next three accept surfaces that other programs wrote less precisely.


@needs("control_net")
def _net_is_rectangular(surface: Part, net: list[Any]) -> Iterator[Finding]:
    for index, row in enumerate(net):
        if len(row) != len(net[0]):
            message = f"contains {len(row)} control points, but the first row has {len(net[0])}"
            yield error("length", surface.at("control_net", index), message, row)


@needs("degree", "knots", "control_net")
def _knots_fit(surface: Part, degree: Array, knots: list[list[float]], net: Array) -> Iterator[Finding]:
    """Check that the number of knots matches net and degree, that they do not decrease, and their domain [0, 1]."""
    for axis, (d, n, row) in enumerate(zip(degree.astype(int), net.shape, knots)):
        where = surface.at("knots", axis)
        drops = np.flatnonzero(np.diff(np.array(row, float)) < 0)
        if n <= d:
            message = f"has {n} control points in {'uv'[axis]}; degree {d} needs at least {d + 1}"
            yield error("length", surface.at("control_net"), message)
        elif len(row) != n + d + 1:
            message = f"must have {n + d + 1} knots ({n} control points + degree {d} + 1), not {len(row)}"
            yield error("length", where, message, row)
        elif len(drops):
            at = int(drops[0]) + 1
            message = f"is {show(row[at])}, less than the previous knot ({show(row[at - 1])}); knots must not decrease"
            yield error("knots-decrease", surface.at("knots", axis, at), message, row[at])
        elif abs(row[d]) > STORED_ROUNDING or abs(row[n] - 1) > STORED_ROUNDING:
            message = f"must span [0, 1] from knot {d} to knot {n}, not [{show(row[d])}, {show(row[n])}]"
            yield error("knots-domain", where, message, row)


@needs("degree", "closed", "control_net")
def _closed_is_closed(surface: Part, degree: Array, closed: list[bool], net: Array) -> Iterator[Finding]:
    size = np.ptp(net.reshape(-1, 3), axis=0).max()
    for axis, d in enumerate(degree.astype(int)):
        along = np.moveaxis(net, axis, 0)
        if closed[axis] and len(along) > d:
            gap = np.abs(along[:d] - along[-d:]).max()
            if not gap <= STORED_ROUNDING * size:
                message = (
                    f"is closed in {'uv'[axis]}, but its last {d} points deviate from its first {d} by {gap:.3g} m"
                )
                yield error("open-seam", surface.at("control_net"), message)


@needs("control_net")
def _net_is_in_metres(surface: Part, net: Array) -> Iterator[Finding]:
    farthest = np.abs(net).max()
    if farthest > MAX_LINK_DISTANCE:
        message = f"has points {farthest:.6g} m from the link frame; divide lengths by 1000 if they are in millimetres"
        yield error("units", surface.at("control_net"), message)


@needs("errors")
def _errors_agree(surface: Part, errors: dict[str, Any]) -> Iterator[Finding]:
    """Check mean <= rms <= max, and that the Hausdorff distance is the larger maximum."""
    for name in ("mesh_to_surface", "surface_to_mesh"):
        mean, rms, most = (float(errors[name][key]) for key in ("mean", "rms", "max"))
        if not mean <= rms * (1 + STORED_ROUNDING) <= most * (1 + 2 * STORED_ROUNDING):
            message = f"has mean {show(mean)}, rms {show(rms)}, max {show(most)}; they must not decrease in this order"
            yield warning("errors", surface.at("errors", name), message, errors[name])
    largest = max(errors[name]["max"] for name in ("mesh_to_surface", "surface_to_mesh"))
    if abs(errors["hausdorff"] - largest) > STORED_ROUNDING * largest:
        message = f"is {show(errors['hausdorff'])}, but the larger maximum is {show(largest)}"
        yield warning("errors", surface.at("errors", "hausdorff"), message, errors["hausdorff"])


@needs("control_net", "errors")
def _errors_are_in_metres(surface: Part, net: Array, errors: dict[str, Any]) -> Iterator[Finding]:
    """Check that the distance between mesh and surface is smaller than the surface."""
    size = float(np.linalg.norm(np.ptp(net.reshape(-1, 3), axis=0)))
    if errors["hausdorff"] > size:
        message = f"is {errors['hausdorff']:.4g} m, but the size of the surface is {size:.4g} m; their units differ"
        yield error("units", surface.at("errors", "hausdorff"), message, errors["hausdorff"])


@needs("trusted")
def _trusted_is_in_domain(surface: Part, trusted: dict[str, Any] | None) -> Iterator[Finding]:
    """Check that the corners of the boundary are parameters of the surface, and that the sites are a rectangle."""
    for index, loop in enumerate(trusted["boundary"] if trusted else ()):
        outside = np.flatnonzero((np.abs(np.array(loop, float) - 0.5) > 0.5).any(axis=1))
        if len(outside):
            at = int(outside[0])
            yield error(
                "value", surface.at("trusted", "boundary", index, at), "is outside of [0, 1] x [0, 1]", loop[at]
            )
    rows = trusted["sites"] if trusted else []
    if len({len(row) for row in rows}) > 1:
        yield error("length", surface.at("trusted", "sites"), "has rows of different lengths")


SHAPE_CHECKS = (_net_is_rectangular,)
CHECKS = (_knots_fit, _closed_is_closed, _net_is_in_metres, _errors_agree, _errors_are_in_metres, _trusted_is_in_domain)
