"""What is odd about a mesh before anything is fitted to it: parts, holes, edges, winding, and what of it matters."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ...common.arrays import Array, BoolArray, IntArray, freeze, unit
from ...common.warnings import Warning
from .cover import is_seen, shells
from .triangle_mesh import TriangleMesh, weld

# A face that is lower than this share of the mesh's size has no side to look to.
FLAT_FACE_RATIO = 1e-7
# A part whose faces look, in the mean, by more than this towards its middle is inside out; a flat one does neither.
INWARD_COSINE = 0.2
# The two ends of a tube; each hole beyond them is one in the skin.
TUBE_ENDS = 2
# Faces back to back do no harm where they are less than this share of the area.
MAX_DOUBLED_FRACTION = 0.01
# Holes that are listed one by one.
MAX_LISTED_HOLES = 4


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What was found on a mesh. A part is what is joined over edges of two faces, as the cover takes it."""

    mesh: TriangleMesh
    dropped: int  # faces with two equal corners, and repeated ones: reading leaves them out
    flat: int  # faces without a height
    doubled: BoolArray  # (f,) whether a face has another one on its back
    part: IntArray  # (f,) number of the part of each face
    seen: BoolArray  # (f,) whether the part of a face is seen from outside; others are inner parts
    joined: int  # parts there would be if every shared edge joined
    rims: IntArray  # (e, 2) edges of one face: vertices
    rim_face: IntArray  # (e,) that face
    hole: IntArray  # (e,) number of the hole of each rim; holes that touch are one
    branching: IntArray  # (b, 2) edges of more than two faces
    flipped: BoolArray  # (f,) whether a face looks the other way than most of its part
    turned: tuple[int, ...]  # parts that are seen and look inward as a whole
    one_sided: int  # parts that have no outside, like a Moebius strip

    def __post_init__(self):
        faces, rims = len(self.mesh.faces), len(self.rims)
        freeze(self, doubled=(faces,), part=(faces,), seen=(faces,), flipped=(faces,), branching=(None, 2))
        freeze(self, rims=(None, 2), rim_face=(rims,), hole=(rims,))

    @property
    def parts(self) -> int:
        """How many parts there are."""
        return int(self.part.max()) + 1

    @property
    def inner(self) -> int:
        """How many of them lie inside others."""
        return len(np.unique(self.part[~self.seen]))

    def holes(self) -> Array:
        """Length of the rim of each hole in what is seen, the longest first [m]."""
        ends = self.mesh.vertices[self.rims]
        lengths = np.bincount(self.hole, np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))
        outer = np.bincount(self.hole, self.seen[self.rim_face]) > 0
        return np.sort(lengths[outer])[::-1]

    def edges(self) -> IntArray:
        """What to look at: rims of holes in what is seen, and edges of more than two faces, shape (k, 2)."""
        return np.concatenate((self.rims[self.seen[self.rim_face]], self.branching))

    def findings(self) -> tuple[Warning, ...]:
        """Return everything that was found; a warning affects the fit, a note does not."""
        return (*self._size(), *self._parts(), *self._holes(), *self._edges(), *self._winding(), *self._faces())

    def _size(self) -> Iterator[Warning]:
        sides = " x ".join(f"{side * 1e3:.4g}" for side in np.ptp(self.mesh.vertices, axis=0))
        yield _finding("mesh-size", f"{count(len(self.mesh.faces), 'face')}, {sides} mm")

    def _parts(self) -> Iterator[Warning]:
        if self.parts == 1:
            yield _finding("parts", "One connected part")
            return
        what = f"{self.parts} connected parts, {self.inner or 'none'} of them inside others"
        outer = self.parts - self.inner > 1
        keep = "Inner parts count only where all parts are kept." if self.inner else ""
        cut = "Cut away those without skin." if outer else ""
        yield _finding("parts", what, False, f"{keep} {cut}".strip())

    def _holes(self) -> Iterator[Warning]:
        lengths = self.holes()
        if not len(lengths):
            yield _finding("holes", "No hole")
            return
        listed = ", ".join(f"{length * 1e3:.4g}" for length in lengths[:MAX_LISTED_HOLES]) + (
            ", ..." if len(lengths) > MAX_LISTED_HOLES else ""
        )
        advice = "Ends may be open. Elsewhere the fit has no data: fill the holes, or keep the skin away from them."
        what = f"{count(len(lengths), 'hole')}, circumference {listed} mm"
        yield _finding("holes", what, len(lengths) > TUBE_ENDS, advice)

    def _edges(self) -> Iterator[Warning]:
        if not len(self.branching):
            return
        split = self.parts > self.joined
        advice = "One surface may be counted as several parts there." if split else ""
        merge = "Delete the faces that protrude, or those inside." if split else ""
        what = f"{count(len(self.branching), 'edge')} with more than two faces"
        yield _finding("branching-edges", what, split, f"{advice} {merge}".strip())

    def _winding(self) -> Iterator[Warning]:
        advice = "No effect on tubes. For sectors, faces and boards recalculate the normals outside (Shift-N)."
        flipped = int((self.flipped & self.seen).sum())
        if flipped:
            yield _finding("flipped-faces", f"{count(flipped, 'face')} with a flipped normal", True, advice)
        if self.turned:
            yield _finding("inward-part", f"{count(len(self.turned), 'part')} with inward normals", True, advice)
        if self.one_sided:
            what = f"{count(self.one_sided, 'part')} with one side only"
            yield _finding("one-sided-part", what, True, "It has no outside, like a Moebius strip: cut it open.")

    def _faces(self) -> Iterator[Warning]:
        if self.dropped:
            yield _finding("dropped-faces", f"{count(self.dropped, 'face')} without area or repeated, left out")
        if self.flat:
            yield _finding("flat-faces", f"{count(self.flat, 'face')} with nearly no height")
        doubled = int(self.doubled.sum())
        if doubled:
            matters = (self.mesh.face_areas * self.doubled).sum() > MAX_DOUBLED_FRACTION * self.mesh.face_areas.sum()
            advice = "A wall without thickness has no outside: delete one side." if matters else ""
            yield _finding("back-to-back", f"{count(doubled, 'face')} back to back", bool(matters), advice)


def _finding(code: str, message: str, affects_fit: bool = False, advice: str = "") -> Warning:
    return Warning(code, "warning" if affects_fit else "note", message, advice=advice)


def diagnose(vertices: Any, faces: Any) -> Diagnosis:
    """Look at a mesh as it came, before equal vertices are merged and useless faces dropped.

    Parameters
    ----------
    vertices : array, shape (v, 3)
        [m], link frame.
    faces : array of int, shape (f, 3)

    Raises
    ------
    InvalidMesh
        As :func:`weld` does.
    """
    mesh = weld(vertices, faces)
    half = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    face = np.repeat(np.arange(len(mesh.faces)), 3)
    numbers, edge, faces_at = np.unique(
        half.min(axis=1) * len(mesh.vertices) + half.max(axis=1), return_inverse=True, return_counts=True
    )
    edges = np.column_stack(np.divmod(numbers, len(mesh.vertices)))
    on_rim = faces_at[edge] == 1
    part, seen = shells(mesh), is_seen(mesh)
    flipped, one_sided = _sides(mesh, part, half, edge, face, faces_at)
    rims = half[on_rim]
    return Diagnosis(
        mesh=mesh,
        dropped=len(np.asarray(faces).reshape(-1, 3)) - len(mesh.faces),
        flat=int(_is_flat(mesh).sum()),
        doubled=_doubled(mesh.faces),
        part=part,
        seen=seen,
        joined=_joined(len(mesh.faces), edge, face),
        rims=rims,
        rim_face=face[on_rim],
        hole=_holes(len(mesh.vertices), rims),
        branching=edges[faces_at > 2],
        flipped=flipped,
        turned=_turned(mesh, part, seen, flipped),
        one_sided=one_sided,
    )


def edges_at(segments: Array, vertices: Array, edges: IntArray) -> BoolArray:
    """Which edges (e, 2) between vertices (v, 3) have both ends where an edge of ``places`` (k, 2, 3) has, shape (e,).

    Places are the same to the bit, or another.
    """
    points = np.concatenate((np.asarray(segments).reshape(-1, 3), vertices)) + 0.0  # no minus zero
    vertex = np.unique(points, axis=0, return_inverse=True)[1].reshape(-1)
    wanted, given = vertex[: 2 * len(segments)].reshape(-1, 2), vertex[2 * len(segments) :][edges]
    first, second = (pair.min(axis=1) * len(points) + pair.max(axis=1) for pair in (wanted, given))
    return np.isin(second, first)


def count(number: int, thing: str) -> str:
    """ "1 face", "2 faces"."""
    return f"{number} {thing}{'' if number == 1 else 's'}"


def _is_flat(mesh: TriangleMesh) -> BoolArray:
    corners = mesh.triangles
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return 2 * mesh.face_areas <= FLAT_FACE_RATIO * mesh.size * longest


def _doubled(faces: IntArray) -> BoolArray:
    """Faces whose three corners are those of another one, which must look the other way: equal ones were merged."""
    corners = np.sort(faces, axis=1)
    order = np.lexsort(corners.T)
    same = (corners[order[1:]] == corners[order[:-1]]).all(axis=1)
    found = np.zeros(len(faces), bool)
    found[order[1:][same]] = found[order[:-1][same]] = True
    return found


def _joined(faces: int, edge: IntArray, face: IntArray) -> int:
    """Parts where every edge joins all its faces."""
    order = np.argsort(edge, kind="stable")
    edge, face = edge[order], face[order]
    same = edge[1:] == edge[:-1]
    return _components(faces, face[:-1][same], face[1:][same])[0]


def _holes(vertices: int, rims: IntArray) -> IntArray:
    """Number of the hole of each rim: rims that share a vertex belong to one."""
    labels = _components(vertices, rims[:, 0], rims[:, 1])[1][rims[:, 0]]
    return np.unique(labels, return_inverse=True)[1].astype(np.int64)


def _sides(
    mesh: TriangleMesh, part: IntArray, half: IntArray, edge: IntArray, face: IntArray, faces_at: IntArray
) -> tuple[BoolArray, int]:
    """Which faces look the other way than most of their part (by area), and how many parts have one side only.

    Neighbours agree where they run along their edge in opposite directions. Each face stands for two nodes, as it is
    and turned over; what agrees is joined, and a part whose two nodes are joined to each other has one side.
    """
    n = len(mesh.faces)
    order = np.argsort(edge, kind="stable")
    order = order[faces_at[edge[order]] == 2].reshape(-1, 2)
    one, other = face[order[:, 0]], face[order[:, 1]]
    against = half[order[:, 0], 0] == half[order[:, 1], 0]
    first = np.concatenate((one, one + n))
    second = np.concatenate((other + n * against, other + n * ~against))
    label = _components(2 * n, first, second)[1]
    _, root = np.unique(part, return_index=True)
    one_sided = label[:n] == label[n:]
    turned = (label[:n] != label[root][part]) & ~one_sided
    turned_area, area = np.bincount(part, mesh.face_areas * turned), np.bincount(part, mesh.face_areas)
    return turned ^ ((turned_area > area / 2)[part] & ~one_sided), len(np.unique(part[one_sided]))


def _turned(mesh: TriangleMesh, part: IntArray, seen: BoolArray, flipped: BoolArray) -> tuple[int, ...]:
    """Parts that are seen and whose faces, the flipped ones turned back, look towards their middle."""
    areas, centres = mesh.face_areas, mesh.triangles.mean(axis=1)
    area = np.maximum(np.bincount(part, areas), np.finfo(float).tiny)
    centre = np.column_stack([np.bincount(part, areas * x) for x in centres.T]) / area[:, None]
    outward = (unit(centres - centre[part]) * mesh.face_normals).sum(axis=1) * np.where(flipped, -1, 1)
    look = np.bincount(part, areas * outward) / area
    return tuple(np.flatnonzero((look < -INWARD_COSINE) & (np.bincount(part, seen) > 0)).tolist())


def _components(nodes: int, first: IntArray, second: IntArray) -> tuple[int, IntArray]:
    graph = coo_array((np.ones(len(first)), (first, second)), shape=(nodes, nodes))
    number, labels = connected_components(graph, directed=False)
    return int(number), labels.astype(np.int64)
