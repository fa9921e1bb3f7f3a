"""Defects of a mesh before anything is fitted to it: parts, holes, edges and winding, and which of them matter."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from ...common.arrays import Array, BoolArray, IntArray, freeze, unit
from ...common.errors import counted, listed
from ...common.warnings import Warning
from ..components import components
from .outliers import without_outliers
from .shells import is_outer, shells, without_doubled
from .triangle_mesh import TriangleMesh, weld, without_gaps

# [1] height of a face to the mesh size below which its normal is only rounding. Larger: more faces are reported as
# flat.
FLAT_FACE_RATIO = 1e-7
# [cosine] A part whose faces point inward by more than this on average is inside out. Larger: fewer parts are reported.
INWARD_COSINE = 0.2
# [fraction of the area] Faces back to back give a warning above this fraction, and what can be seen says which of them
# is outside. Larger: fewer warnings, less time; small parts that are doubled can be wound inward.
MAX_DOUBLED_FRACTION = 0.01


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The findings on a mesh. A part is connected over edges with two faces, as in the cover."""

    mesh: TriangleMesh
    dropped: int  # faces with two equal corners, and repeated faces; reading removes them
    flat: int  # faces with nearly no height
    doubled: BoolArray  # (f,) whether another face has the same corners
    part: IntArray  # (f,) number of the part of each face
    seen: BoolArray  # (f,) whether the part of a face is outer; others are mostly within the convex hull of these
    joined: int  # number of parts if every edge connected all its faces
    rims: IntArray  # (e, 2) vertices of the edges with one face
    rim_face: IntArray  # (e,) the face of each rim
    hole: IntArray  # (e,) number of the hole of each rim; holes with a common vertex are one
    branching: IntArray  # (b, 2) vertices of the edges with more than two faces
    flipped: BoolArray  # (f,) whether a normal is opposite to most of its part
    inward: tuple[int, ...]  # visible parts with inward normals
    one_sided: int  # number of parts without an outside, like a Moebius strip

    def __post_init__(self):
        faces, rims = len(self.mesh.faces), len(self.rims)
        freeze(self, doubled=(faces,), part=(faces,), seen=(faces,), flipped=(faces,), branching=(None, 2))
        freeze(self, rims=(None, 2), rim_face=(rims,), hole=(rims,))

    @property
    def parts(self) -> int:
        """Return the number of parts."""
        return int(self.part.max()) + 1

    @property
    def inner(self) -> int:
        """Return the number of parts that are mostly within the convex hull of others."""
        return len(np.unique(self.part[~self.seen]))

    def holes(self) -> Array:
        """Return the length of the rim of each visible hole, the longest first [m]."""
        ends = self.mesh.vertices[self.rims]
        lengths = np.bincount(self.hole, np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))
        outer = np.bincount(self.hole, self.seen[self.rim_face]) > 0
        return np.sort(lengths[outer])[::-1]

    def edges(self) -> IntArray:
        """Return the edges to highlight: rims of visible holes, and edges with more than two faces, shape (k, 2)."""
        return np.concatenate((self.rims[self.seen[self.rim_face]], self.branching))

    def findings(self) -> tuple[Warning, ...]:
        """Return all findings; a warning affects the fit, a note does not."""
        return (
            *self._size(),
            *without_outliers(self.mesh)[1],
            *self._parts(),
            *self._holes(),
            *self._edges(),
            *self._winding(),
            *self._faces(),
        )

    def _size(self) -> Iterator[Warning]:
        sides = " x ".join(f"{side * 1e3:.4g}" for side in np.ptp(self.mesh.vertices, axis=0))
        yield _finding("mesh-size", f"{counted(len(self.mesh.faces), 'face')}, {sides} mm")

    def _parts(self) -> Iterator[Warning]:
        if self.parts == 1:
            yield _finding("parts", "One connected part")
            return
        what = f"{self.parts} connected parts, {self.inner or 'none'} of them mostly within the convex hull of others"
        outer = self.parts - self.inner > 1
        keep = "Outer leaves these out, also where they can be seen." if self.inner else ""
        cut = "Cut away those without skin." if outer else ""
        yield _finding("parts", what, False, f"{keep} {cut}".strip())

    def _holes(self) -> Iterator[Warning]:
        lengths = self.holes()
        if not len(lengths):
            yield _finding("holes", "No hole")
            return
        sizes = listed([f"{length * 1e3:.4g}" for length in lengths])
        advice = "Ends may be open. Elsewhere the fit has no data: fill the holes, or keep the skin away from them."
        what = f"{counted(len(lengths), 'hole')}, circumference {sizes} mm"
        yield _finding("holes", what, len(lengths) > 2, advice)  # a tube has two ends

    def _edges(self) -> Iterator[Warning]:
        if not len(self.branching):
            return
        split = self.parts > self.joined
        advice = "One surface may be counted as several parts there." if split else ""
        merge = "Delete the faces that protrude, or those inside." if split else ""
        what = f"{counted(len(self.branching), 'edge')} with more than two faces"
        yield _finding("branching-edges", what, split, f"{advice} {merge}".strip())

    def _winding(self) -> Iterator[Warning]:
        advice = "No effect on tubes. For sectors, faces and boards recalculate the normals outside (Shift-N)."
        flipped = int((self.flipped & self.seen).sum())
        if flipped:
            yield _finding("flipped-faces", f"{counted(flipped, 'face')} with a flipped normal", True, advice)
        if self.inward:
            yield _finding("inward-part", f"{counted(len(self.inward), 'part')} with inward normals", True, advice)
        if self.one_sided:
            what = f"{counted(self.one_sided, 'part')} with one side only"
            yield _finding("one-sided-part", what, True, "It has no outside, like a Moebius strip: cut it open.")

    def _faces(self) -> Iterator[Warning]:
        if self.dropped:
            yield _finding("dropped-faces", f"{counted(self.dropped, 'face')} without area or repeated, left out")
        if self.flat:
            yield _finding("flat-faces", f"{counted(self.flat, 'face')} with nearly no height")
        doubled = int(self.doubled.sum())
        if doubled:
            matters = (self.mesh.face_areas * self.doubled).sum() > MAX_DOUBLED_FRACTION * self.mesh.face_areas.sum()
            advice = "A wall without thickness has no outside: delete one side." if matters else ""
            yield _finding("back-to-back", f"{counted(doubled, 'face')} back to back", bool(matters), advice)


def _finding(code: str, message: str, affects_fit: bool = False, advice: str = "") -> Warning:
    return Warning(code, "warning" if affects_fit else "note", message, advice=advice)


def diagnose(vertices: Any, faces: Any) -> Diagnosis:
    """Diagnose a mesh as it was read, before equal vertices are merged and useless faces are removed."""
    mesh = without_gaps(weld(vertices, faces))
    half, face, numbers, edge, faces_at = _edges(mesh)
    edges = np.column_stack(np.divmod(numbers, len(mesh.vertices)))
    on_rim = faces_at[edge] == 1
    part, seen = shells(mesh), is_outer(mesh)
    flipped, one_sided = _sides(mesh, part)
    rims, single = half[on_rim], without_doubled(mesh)[1]
    return Diagnosis(
        mesh=mesh,
        dropped=len(np.asarray(faces).reshape(-1, 3)) - len(mesh.faces),
        flat=int((2 * mesh.face_areas <= FLAT_FACE_RATIO * mesh.size * mesh.longest_sides).sum()),
        doubled=np.bincount(single)[single] > 1,
        part=part,
        seen=seen,
        joined=int(components(len(mesh.faces) + len(numbers), face, len(mesh.faces) + edge).max()) + 1,
        rims=rims,
        rim_face=face[on_rim],
        hole=_holes(len(mesh.vertices), rims),
        branching=edges[faces_at > 2],
        flipped=flipped,
        inward=_inward(mesh, part, seen, flipped),
        one_sided=one_sided,
    )


@lru_cache(maxsize=4)  # repeated fits, as in the window, keep it
def coherent(mesh: TriangleMesh) -> TriangleMesh:
    """Return a mesh whose faces are wound as most of their part; the same mesh if all are."""
    if not mesh.disagreeing.any():
        return mesh
    flipped, _ = _sides(mesh, shells(mesh))
    if not flipped.any():
        return mesh
    return TriangleMesh(mesh.vertices, np.where(flipped[:, None], mesh.faces[:, ::-1], mesh.faces))


def _edges(mesh: TriangleMesh) -> tuple[IntArray, IntArray, IntArray, IntArray, IntArray]:
    """Return directed edges, their faces, the numbers of edges, the index of each directed one, and the counts."""
    half = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    numbers, edge, faces_at = np.unique(
        half.min(axis=1) * len(mesh.vertices) + half.max(axis=1), return_inverse=True, return_counts=True
    )
    return half, np.repeat(np.arange(len(mesh.faces)), 3), numbers, edge, faces_at


def edges_at(segments: Array, vertices: Array, edges: IntArray) -> BoolArray:
    """Return which edges (e, 2) have their ends at the ends of a segment (2, 3), to the bit."""
    points = np.concatenate((np.asarray(segments).reshape(-1, 3), vertices)) + 0.0  # no minus zero
    vertex = np.unique(points, axis=0, return_inverse=True)[1].reshape(-1)
    wanted, given = vertex[: 2 * len(segments)].reshape(-1, 2), vertex[2 * len(segments) :][edges]
    first, second = (pair.min(axis=1) * len(points) + pair.max(axis=1) for pair in (wanted, given))
    return np.isin(second, first)


def _holes(vertices: int, rims: IntArray) -> IntArray:
    """Return the number of the hole of each rim: rims with a common vertex belong to one hole."""
    labels = components(vertices, rims[:, 0], rims[:, 1])[rims[:, 0]]
    return np.unique(labels, return_inverse=True)[1].astype(np.int64)


def _sides(mesh: TriangleMesh, part: IntArray) -> tuple[BoolArray, int]:
    """Return which faces have a normal opposite to most of their part (by area), and the number of one-sided parts.

    Adjacent faces agree if they traverse their edge in opposite directions. Each face has two nodes: as it is, and
    reversed. Nodes that agree are connected. A part whose two nodes are connected to each other has one side only.
    """
    n = len(mesh.faces)
    (one, other), against = mesh.adjacency, mesh.disagreeing
    first = np.concatenate((one, one + n))
    second = np.concatenate((other + n * against, other + n * ~against))
    label = components(2 * n, first, second)
    _, root = np.unique(part, return_index=True)
    one_sided = label[:n] == label[n:]
    reversed_ = (label[:n] != label[root][part]) & ~one_sided
    reversed_area, area = np.bincount(part, mesh.face_areas * reversed_), np.bincount(part, mesh.face_areas)
    return reversed_ ^ ((reversed_area > area / 2)[part] & ~one_sided), len(np.unique(part[one_sided]))


def _inward(mesh: TriangleMesh, part: IntArray, seen: BoolArray, flipped: BoolArray) -> tuple[int, ...]:
    """Return the visible parts whose faces point to their centre, after flipped faces are reversed."""
    areas, centres = mesh.face_areas, mesh.triangles.mean(axis=1)
    area = np.maximum(np.bincount(part, areas), np.finfo(float).tiny)
    centre = np.column_stack([np.bincount(part, areas * x) for x in centres.T]) / area[:, None]
    outward = (unit(centres - centre[part]) * mesh.face_normals).sum(axis=1) * np.where(flipped, -1, 1)
    mean_cosine = np.bincount(part, areas * outward) / area
    return tuple(np.flatnonzero((mean_cosine < -INWARD_COSINE) & (np.bincount(part, seen) > 0)).tolist())
