"""Array types, checks of record fields, and small vector operations."""

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
ComplexArray = NDArray[np.complex128]
AnyArray = TypeVar("AnyArray", Array, BoolArray)
COVARIANCE_ROUNDING = 1e-9  # [1] of a correlation. Larger: matrices that are no covariances pass.


def freeze(record: object, **shapes: tuple[int | None, ...]) -> None:
    """Replace the named fields of a frozen dataclass with checked, read-only copies."""
    for name, shape in shapes.items():
        value = np.array(getattr(record, name))
        value = value.astype(np.int64 if value.dtype.kind in "iu" else bool if value.dtype.kind == "b" else np.float64)
        fits = value.ndim == len(shape) and all(want is None or have == want for have, want in zip(value.shape, shape))
        if not fits:
            raise ValueError(f"{type(record).__name__}.{name} has shape {value.shape}, expected {shape}")
        if not np.isfinite(value).all():
            raise ValueError(f"{type(record).__name__}.{name} contains a number that is not finite")
        value.setflags(write=False)
        object.__setattr__(record, name, value)


def lock(*values: object) -> None:
    """Make arrays read-only; other values stay as they are."""
    for value in values:
        if isinstance(value, np.ndarray):
            value.setflags(write=False)


def locked(array: AnyArray) -> AnyArray:
    """Make an array read-only, and return it."""
    array.setflags(write=False)
    return array


def unmasked(values: Any) -> Array:
    """Return numbers in double precision; those that a masked array masks are NaN."""
    if isinstance(values, np.ma.MaskedArray):
        values = np.ma.filled(values.astype(float), np.nan)
    return np.asarray(values, float)


def some(flags: BoolArray) -> bool:
    """Return whether a flag is set, of an array or of one number; NumPy takes long for one number."""
    return bool(flags.any()) if flags.ndim else bool(flags)


def is_covariance(matrix: Array) -> bool:
    """Return whether a square matrix is symmetric and positive semidefinite, within rounding."""
    scale = np.sqrt(np.abs(np.outer(np.diag(matrix), np.diag(matrix))))
    scaled = matrix / np.where(scale > 0, scale, 1.0)
    is_symmetric = np.abs(scaled - scaled.T).max() <= COVARIANCE_ROUNDING
    return bool(is_symmetric and np.linalg.eigvalsh(scaled).min() >= -COVARIANCE_ROUNDING)


def unit(vectors: Any) -> Array:
    """Scale vectors to unit length along the last axis; a zero vector stays zero."""
    vectors = np.asarray(vectors, float)
    length = norms(vectors)[..., None]
    return vectors / np.where(length > 0, length, 1.0)


def tangential(vectors: Array, normals: Array) -> Array:
    """Return unit vectors along the parts of vectors (n, 3) that are perpendicular to unit normals (n, 3)."""
    return unit(vectors - (vectors * normals).sum(axis=1, keepdims=True) * normals)


def norms(vectors: Array) -> Array:
    """Return the lengths (...) of vectors (..., d): ``numpy.linalg.norm`` along the last axis, three times as fast."""
    first, *others = np.moveaxis(vectors, -1, 0)
    squares = first * first
    for x in others:
        squares = squares + x * x
    return np.sqrt(squares)


def along(vectors: Array, direction: Array) -> Array:
    """Return the components (...) of vectors (..., 3) along one direction, without starting the threads of BLAS."""
    return vectors[..., 0] * direction[0] + vectors[..., 1] * direction[1] + vectors[..., 2] * direction[2]


def usual_size(deviations: Array) -> Array:
    """Return the standard deviation of normal deviations from zero (n, ...), by their median, whatever outliers do."""
    return np.asarray(1.4826 * np.median(np.abs(deviations), axis=0))


def row_order(rows: Array | IntArray) -> IntArray:
    """Return the order (n,) of rows (n, d) by their first number, then by the second, and so on; the order is stable.

    Rows of which most are in order already, without equal first numbers, take hardly any time.
    """
    order = np.argsort(rows[:, 0], kind="stable")
    first = rows[order, 0]
    same = first[1:] == first[:-1]
    tied = np.flatnonzero(np.append(same, False) | np.append(False, same))
    order[tied] = order[tied][np.lexsort(rows[order[tied]].T[::-1])]
    return order


def cross(a: Array, b: Array) -> Array:
    """Return cross products (..., 3); equal to ``numpy.cross`` and three times as fast."""
    result = np.empty(a.shape)
    (ax, ay, az), (bx, by, bz) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    result[..., 0] = ay * bz - az * by
    result[..., 1] = az * bx - ax * bz
    result[..., 2] = ax * by - ay * bx
    return result


def distinct(values: IntArray) -> IntArray:
    """Return the different values (k,) in ascending order: of many, ``np.unique`` takes six times as long."""
    ordered = np.sort(values, axis=None)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])] if len(ordered) else ordered


def ranges(first: IntArray | int, counts: IntArray) -> IntArray:
    """Return the whole numbers of ranges, one range after the other."""
    ends = np.cumsum(counts)
    numbers: IntArray = np.arange(int(counts.sum())) + np.repeat(first - ends + counts, counts)
    return numbers


# [1] length of a vector of an author, or of a mean of unit vectors, below which it has no direction. Larger: more
# directions are refused.
MIN_DIRECTION_LENGTH = 1e-6


def pairs_of(u: Array, v: Array) -> Array:
    """Return every pair (k * l, 2) of two lists of numbers, with the second one changing faster."""
    return np.column_stack((np.repeat(u, len(v)), np.tile(v, len(u))))
