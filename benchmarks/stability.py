"""Stability: error to the truth for sharp corners, noise, tilted planes, holes, missing faces and coarse meshes.

Ours, both readings of the paper's method and three peers have the same net. A method fails where it raises, where its
result is not finite or far away, or where its mean distance to the truth is above ``LIMIT``.
"""

import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial

import methods
import numpy as np
import peers
from links import Axis, Fan, Link, has_shapes, shape_link, target_shapes
from measure import Surface, from_truth, timed

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
    missing: float  # fraction of the samples that ours reports as missing
    smallest_area: float  # folds that ours reports: smallest area element over the mean one
    warnings: str  # of ours
    failure: str


@dataclass(frozen=True)
class Panel:
    """A condition, from easy to difficult."""

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
    """Return the wrist sample; only its planes are tilted."""
    return replace(plain_wrist(), margin=TILT_MARGIN)


def with_hole(radius: float) -> Link:
    """Return the wrist sample without the faces within a radius [mm] of a point on it."""
    mesh = plain_wrist().mesh
    centres = mesh.triangles.mean(axis=1)
    point = centres[np.argmax(centres @ (1.0, 1.0, 0.0) - 10 * np.abs(centres[:, 2] - 0.04))]
    return wrist_link(weld(mesh.vertices, mesh.faces[np.linalg.norm(centres - point, axis=1) >= radius * 1e-3]))


def with_faces_missing(percent: float) -> Link:
    """Return the wrist sample without a fraction of its faces, chosen at random."""
    mesh = plain_wrist().mesh
    order = np.random.default_rng(SEED).permutation(len(mesh.faces))
    return wrist_link(weld(mesh.vertices, mesh.faces[np.sort(order[round(percent / 100 * len(order)) :])]))


def sampled(around: float) -> Link:
    """Return the wrist sample with ``around`` vertices around it, and faces of the same shape."""
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
    """Yield all rows; none where the shapes with a known surface are missing."""
    if not has_shapes():
        print("stability needs shapes with a known surface: it is left out", file=sys.stderr)
        return
    present = peers.installed()
    compared = {name: present[name] for name in COMPARED if name in present}
    for panel in PANELS:
        for value in panel.values:
            link = panel.link(value)
            fan = panel.fan(link, value)
            yield row(panel, value, link, methods.PLACED, "", our_fit(panel, link, fan), repeats)
            for name, method in ((methods.LETTER, methods.letter), (methods.STRENGTHENED, methods.strengthened)):
                yield row(panel, value, link, name, "", partial(paper_fit, method, link, fan, panel.lines), 1)
            task = peers.Task(link, fan, PLANES, panel.lines)
            for name, peer in compared.items():
                rows = [
                    row(panel, value, link, name, variant, partial(fit_of_peer, peer, task, words, per_span), 1)
                    for variant, words, per_span in peer.tasks(PLANES * panel.lines)
                ]
                yield min(rows, key=lambda r: np.nan_to_num(r.mean, nan=np.inf))


def paper_fit(method: Callable, link: Link, fan: Fan, lines: int) -> Surface:
    """Fit with one reading of the paper's method."""
    return methods.surface_of_paper(method(link, fan, PLANES, lines))


def fit_of_peer(peer: peers.Peer, task: peers.Task, words: dict, per_span: int) -> Surface:
    """Prepare and fit with one variant of a peer."""
    return peer.prepare(task, words, per_span)()


def our_fit(panel: Panel, link: Link, fan: Fan) -> Callable:
    """Our fit along the panel's planes."""
    if panel.name == "tilt":
        return lambda: methods.ours_fanned(link, fan, PLANES, panel.lines)
    return lambda: methods.ours(link, PLANES, panel.lines)


def row(panel: Panel, value: float, link: Link, method: str, variant: str, fit: Callable, repeats: int) -> Row:
    """Measure one method in one condition; a failure has its reason."""
    missing = area = mean = largest = milliseconds = np.nan
    warned = failure = ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            made, milliseconds = timed(fit, repeats)
        if method == methods.PLACED:
            missing, area, warned = made.missing, made.smallest_area, "; ".join(map(str, made.warnings))
            made = methods.surface_of_ours(made)
        mean, largest = from_truth(link, made)
        if mean > LIMIT:
            failure = f"{mean:.3g} mm from the truth"
    except Exception as error:  # whatever a library raises is its result here
        failure = f"{type(error).__name__}: {error}".replace("\n", " ").strip()
    return Row(panel.name, value, method, variant, mean, largest, milliseconds, missing, area, warned, failure)


def table(rows: list[Row]) -> str:
    """Markdown: the error of every method in every condition, and how often each failed."""
    names = list(dict.fromkeys(r.method for r in rows))
    text = [f"| condition | value | {' | '.join(names)} | ours: missing | warnings |", "|" + "---|" * (len(names) + 4)]
    cells = {(r.panel, r.value, r.method): r for r in rows}
    for panel in PANELS:
        for value in panel.values:
            found = [cells[panel.name, value, name] for name in names]
            figures = [f"failed ({r.failure[:60]})" if r.failure else f"{r.mean:.4f}" for r in found]
            gap = "" if np.isnan(found[0].missing) else f"{found[0].missing:.1%}"
            notes = f"{gap} | {found[0].warnings[:60]}"
            text.append(f"| {panel.name} [{panel.unit}] | {value:g} | {' | '.join(figures)} | {notes} |")
    failed = [sum(bool(r.failure) for r in rows if r.method == name) for name in names]
    text.append(f"| failures | of {len(rows) // len(names)} | {' | '.join(map(str, failed))} | | |")
    return "\n".join(text)
