"""What limits the error of a fit, for the message that a tolerance cannot be met."""

import numpy as np

from .chords import facet_sagittas
from .diagnosis import maximum_deviation, nearest_names
from .surface_fit import SurfaceFit
from .undercut import deepest_undercut

# [fraction of the rows] whose outside consists of several parts, above which parts limit the error. Larger: rarer.
MAX_PARTS_FRACTION = 0.2
# [cosine] mean between the rays and the normals of the facets below which an axis is oblique. Larger: more often.
MIN_MEAN_COSINE = 0.8
# [1] ratio of the error to the sagitta of the facets up to which the facets limit it. Larger: more often.
MAX_FACET_RATIO = 2.0


def limit_of(fit: SurfaceFit, found_axis: bool, tolerance: float, measure: str = "mean") -> tuple[str, str]:
    """Return why a surface is not nearer to the mesh, and what to do.

    Parameters
    ----------
    fit : SurfaceFit
        The nearest surface.
    found_axis : bool
        Whether the axis was found from the mesh.
    tolerance : float
        The tolerance that is not met [m].
    measure : "mean" or "max"
        The distance that it limits.

    Returns
    -------
    cause, advice : str
        Parts of a sentence: "because ...", and an imperative.
    """
    lines, basis, samples = fit.lines, fit.basis, fit.samples
    if fit.smallest_area <= 0:
        return "because the surface folds over itself", "increase the margin, or give the axis"
    slope = np.abs((samples.rays * fit.mesh.face_normals[samples.faces]).sum(axis=2))
    known = ~np.isnan(samples.residuals)
    if found_axis and slope[known].mean() < MIN_MEAN_COSINE:
        return "because the axis that was found is oblique to the surface", "give the axis"
    undercut, place = deepest_undercut(fit.mesh, lines, basis, samples, fit.surface)
    if undercut > tolerance:
        return (
            f"because the section folds back behind itself {place.words}",
            "cut the undercut away, or move the axis so that each ray meets the section once",
        )
    if samples.parts.mean() > MAX_PARTS_FRACTION:
        row = int(np.argmax(samples.parts))
        name = nearest_names(lines, basis, (row, 0)).split(" and ")[0]
        return (
            f"because the outside of the sections consists of several parts, as near {name}",
            "cut away the parts without skin",
        )
    distance = np.abs(samples.residuals * slope)
    facets = np.where(known, facet_sagittas(fit.mesh)[samples.faces], 0.0)
    worst = np.unravel_index(int(np.nanargmax(distance)), distance.shape)
    is_facet = (
        distance[worst] <= MAX_FACET_RATIO * facets[worst]
        if measure == "max"
        else distance[known].mean() <= MAX_FACET_RATIO * facets[known].mean()
    )
    if is_facet:
        return "because the mesh is faceted", "refine the mesh"
    _, place = maximum_deviation(fit.mesh, lines, basis, samples, tolerance)
    return f"because the mesh has steps or edges, the largest {place.words}", "cut them away"
