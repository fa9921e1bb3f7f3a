"""Stability: error to the truth as corners sharpen, noise grows, planes tilt, holes open, faces go, vertices thin out.

Ours beside the paper's method and three peers, all with the same net. Where a method raises, gives what is no surface,
or is further than ``LIMIT`` from the truth on the mean, it has failed.
"""

import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache

import methods
import numpy as np
import peers
from links import Axis, Fan, Link, has_shapes, shape_link, target_shapes
from measure import from_truth, timed

from skin_calib_addon.geometry import weld

LIMIT = 5.0  # [mm]
PLANES, LINES, CORNER_LINES = 10, 20, 24
SEED = 1
WRIST_AXIS = Axis((0.0032, 0.0008, 0.0), (0.0, 0.0, 1.0))
TILT_MARGIN = 0.016  # [m] so that the first and the last plane of the widest fan stay on the mesh
COMPARED = ("splipy", "SciPy Rect, smoothing", "geomdl")


@dataclass(frozen=True)
class Row:
    """One method in one condition; distances to the truth [mm]."""

    panel: str
    value: float
    method: str
    variant: str
    mean: float
    max: float
    milliseconds: float
    missing: float  # share of the samples that ours says are missing
    smallest_area: float  # what ours says of folds: least area element over the mean one
    doubts: str  # what ours tells its author to look at
    failure: str


@dataclass(frozen=True)
class Panel:
    """A condition that gets worse from value to value."""

    name: str
    unit: str
    values: tuple[float, ...]
    link: Callable[[float], Link]
    lines: int = LINES

    def fan(self, link: Link, value: float) -> Fan:
        """The region and planes at a value."""
        return replace(link.fan, tilt=np.deg2rad(value)) if self.name == "tilt" else link.fan


def wrist_link(mesh=None, **size) -> Link:
    """The wrist sample, or another mesh of the same truth."""
    link = shape_link("wrist sample", target_shapes().wrist(**size), WRIST_AXIS)
    return link if mesh is None else replace(link, mesh=mesh)


@cache
def plain_wrist() -> Link:
    """The wrist sample as it is."""
    return wrist_link()


def square(radius: float) -> Link:
    """The rounded square with another corner radius [mm]."""
    axis = Axis((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    return shape_link("rounded square", target_shapes().rounded_square(rc=radius), axis)


def noisy(sigma: float) -> Link:
    """The wrist sample with its vertices moved along their normals by Gaussian noise [mm]."""
    mesh = plain_wrist().mesh
    normals = np.zeros_like(mesh.vertices)
    for corner in mesh.faces.T:
        np.add.at(normals, corner, mesh.face_normals * mesh.face_areas[:, None])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    shift = np.random.default_rng(SEED).normal(0.0, sigma * 1e-3, len(normals))
    return wrist_link(weld(mesh.vertices + shift[:, None] * normals, mesh.faces))


def tilted(_: float) -> Link:
    """The wrist sample; its planes are tilted, not it."""
    return replace(plain_wrist(), margin=TILT_MARGIN)


def with_hole(radius: float) -> Link:
    """The wrist sample without the faces within a radius [mm] of a place on it."""
    mesh = plain_wrist().mesh
    centres = mesh.triangles.mean(axis=1)
    place = centres[np.argmax(centres @ (1.0, 1.0, 0.0) - 10 * np.abs(centres[:, 2] - 0.04))]
    return wrist_link(weld(mesh.vertices, mesh.faces[np.linalg.norm(centres - place, axis=1) >= radius * 1e-3]))


def with_faces_missing(percent: float) -> Link:
    """The wrist sample without a share of its faces, chosen at random."""
    mesh = plain_wrist().mesh
    order = np.random.default_rng(SEED).permutation(len(mesh.faces))
    return wrist_link(weld(mesh.vertices, mesh.faces[np.sort(order[round(percent / 100 * len(order)) :])]))


def sampled(around: float) -> Link:
    """The wrist sample with so many vertices around it, and as many along it as keeps its faces' shape."""
    return wrist_link(nt=int(around), nz=max(4, round(0.52 * around)))


PANELS = (
    Panel("corner radius", "mm", (8.0, 5.0, 3.0, 2.0, 1.0, 0.5, 0.25, 0.1), square, CORNER_LINES),
    Panel("noise", "mm, one sigma", (0.0, 0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0), noisy),
    Panel("tilt", "degrees from first to last plane", (0.0, 5.0, 10.0, 20.0, 30.0, 40.0), tilted),
    Panel("hole", "mm, radius", (0.0, 3.0, 6.0, 10.0, 15.0, 20.0, 25.0), with_hole),
    Panel("missing faces", "%", (0.0, 1.0, 3.0, 10.0, 20.0, 30.0, 40.0), with_faces_missing),
    Panel("sampling", "vertices around", (400, 200, 100, 50, 36, 24, 18, 12), sampled),
)


def measure(repeats: int) -> Iterator[Row]:
    """All rows; none where the shapes with a truth are not there."""
    if not has_shapes():
        print("stability is measured against a truth: it is left out", file=sys.stderr)
        return
    present = peers.installed()
    compared = {name: present[name] for name in COMPARED if name in present}
    for panel in PANELS:
        for value in panel.values:
            link = panel.link(value)
            fan = panel.fan(link, value)
            yield row(panel, value, link, "ours", "", our_fit(panel, link, fan), repeats)
            fit = lambda: methods.surface_of_paper(methods.paper(link, fan, PLANES, panel.lines))  # noqa: B023, E731
            yield row(panel, value, link, "paper, good parameters", "", fit, 1)
            task = peers.Task(link, fan, PLANES, panel.lines)
            for name, peer in compared.items():
                rows = [
                    row(panel, value, link, name, variant, lambda p=prepare: p()(), 1)
                    for variant, prepare in peer.tasks(task)
                ]
                yield min(rows, key=lambda r: np.nan_to_num(r.mean, nan=np.inf))


def our_fit(panel: Panel, link: Link, fan: Fan) -> Callable:
    """Our fit along the panel's planes."""
    if panel.name == "tilt":
        return lambda: methods.ours_fanned(link, fan, PLANES, panel.lines)
    return lambda: methods.ours(link, PLANES, panel.lines)


def row(panel: Panel, value: float, link: Link, method: str, variant: str, fit: Callable, repeats: int) -> Row:
    """One method in one condition, measured; what fails says why."""
    missing = area = mean = largest = milliseconds = np.nan
    doubts = failure = ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            made, milliseconds = timed(fit, repeats)
        if method == "ours":
            missing, area, doubts = made.missing, made.smallest_area, "; ".join(map(str, made.warnings))
            made = methods.surface_of_ours(made)
        mean, largest = from_truth(link, made)
        if mean > LIMIT:
            failure = f"{mean:.3g} mm from the truth"
    except Exception as error:  # whatever a library raises is its result here
        failure = f"{type(error).__name__}: {error}".replace("\n", " ").strip()
    return Row(panel.name, value, method, variant, mean, largest, milliseconds, missing, area, doubts, failure)


def table(rows: list[Row]) -> str:
    """Markdown: the error of every method in every condition, and how often each failed."""
    names = list(dict.fromkeys(r.method for r in rows))
    text = [f"| condition | value | {' | '.join(names)} | ours: missing | doubts |", "|" + "---|" * (len(names) + 4)]
    cells = {(r.panel, r.value, r.method): r for r in rows}
    for panel in PANELS:
        for value in panel.values:
            found = [cells[panel.name, value, name] for name in names]
            figures = [f"failed ({r.failure[:60]})" if r.failure else f"{r.mean:.4f}" for r in found]
            gap = "" if np.isnan(found[0].missing) else f"{found[0].missing:.1%}"
            text.append(
                f"| {panel.name} [{panel.unit}] | {value:g} | {' | '.join(figures)} | {gap} | {found[0].doubts[:60]} |"
            )
    failed = [sum(bool(r.failure) for r in rows if r.method == name) for name in names]
    text.append(f"| failures | of {len(rows) // len(names)} | {' | '.join(map(str, failed))} | | |")
    return "\n".join(text)
