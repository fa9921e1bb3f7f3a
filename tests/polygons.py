"""Random polygons for the tests of all that takes one."""

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from skin_calib_addon.runtime import convex_hull

# Two steps of a lattice whose cross product is 1, where rounding a product loses 128.
THIN = [(0, 0), (433494437, 267914296), (267914296, 165580141)]
unit_floats = st.floats(-1, 1)


@st.composite
def polygons(draw, least=3):
    """Draw hulls with an area, of any size, round or flat, with nearly parallel edges; at the origin or not."""
    kind = draw(st.sampled_from(["cloud", "round", "flat", "bent"]))
    n = draw(st.integers(least, 20))
    x, y = (np.array(draw(st.lists(unit_floats, min_size=n, max_size=n))) for _ in range(2))
    if kind == "round":
        points = np.stack((np.cos(3 * x), np.sin(3 * x)), axis=1)
    elif kind == "flat":
        points = np.stack((x, draw(st.sampled_from([1e-3, 1e-6, 1e-8])) * y), axis=1)
    elif kind == "bent":  # a square whose sides bulge by a few steps of the grid
        side, bulge = np.sort(x), 2.0**-29 * np.rint(3 * y)
        points = np.concatenate([np.stack((side, 1 + bulge), axis=1), [(-1, -1), (1, -1), (1, 1), (-1, 1)]])
    else:
        points = np.stack((x, y), axis=1)
    angle = draw(st.sampled_from([0.0, 0.3, 2.0]))
    turned = points @ np.array([(np.cos(angle), np.sin(angle)), (-np.sin(angle), np.cos(angle))])
    polygon = convex_hull(draw(st.sampled_from([1.0, 0.1, 1e-9])) * (turned + draw(st.sampled_from([0.0, 1.0, 30.0]))))
    assume(polygon.kind == "area")
    return polygon


def size_of(polygon):
    """Return the largest coordinate, to which rounding errors are proportional."""
    return np.abs(polygon.corners).max()


round_polygons = st.builds(
    lambda seed, count, thin: convex_hull(np.random.default_rng(seed).normal(size=(count, 2)) @ np.diag((1, thin))),
    st.integers(0, 10**6),
    st.integers(3, 12),
    st.sampled_from([1.0, 0.3]),
)
