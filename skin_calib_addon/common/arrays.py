"""Frozen arrays: the records of this package hold read-only copies whose shape was checked once."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def freeze(record: object, **shapes: tuple[int | None, ...]) -> None:
    """Replace the named fields of a frozen dataclass by checked, read-only copies.

    Parameters
    ----------
    record : frozen dataclass instance
        Called from its ``__post_init__``.
    **shapes
        Expected shape of each field; None allows any length along that axis.

    Raises
    ------
    ValueError
        If a field has another shape, or a number in it is not finite.
    """
    for name, shape in shapes.items():
        value = np.array(getattr(record, name))
        value = value.astype(np.int64 if value.dtype.kind in "iu" else bool if value.dtype.kind == "b" else np.float64)
        fits = value.ndim == len(shape) and all(want is None or have == want for have, want in zip(value.shape, shape))
        if not fits:
            raise ValueError(f"{type(record).__name__}.{name} has shape {value.shape}, expected {shape}")
        if not np.isfinite(value).all():
            raise ValueError(f"{type(record).__name__}.{name} holds a number that is not finite")
        value.setflags(write=False)
        object.__setattr__(record, name, value)


def unit(vectors: Any) -> Array:
    """Scale vectors to length one along the last axis; a zero vector stays zero."""
    vectors = np.asarray(vectors, float)
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)


def along(vectors: Array, direction: Array) -> Array:
    """Components of many vectors (..., 3) along one direction, shape (...), without waking the threads of BLAS."""
    return vectors[..., 0] * direction[0] + vectors[..., 1] * direction[1] + vectors[..., 2] * direction[2]


def cross(a: Array, b: Array) -> Array:
    """Cross products of vectors of one shape (..., 3): what ``numpy.cross`` gives, in a third of its time."""
    result = np.empty(a.shape)
    (ax, ay, az), (bx, by, bz) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    result[..., 0] = ay * bz - az * by
    result[..., 1] = az * bx - ax * bz
    result[..., 2] = ax * by - ay * bx
    return result


# Multiplications below which OpenBLAS leaves a matrix product on the calling thread, halved to be safe.
SINGLE_THREAD_PRODUCTS = 2**17
MIN_BLOCK_ROWS = 16  # in a piece: with fewer, each number of the second matrix is fetched for next to nothing


def product(a: Array, b: Array) -> Array:
    """The matrix product of two matrices, in pieces that BLAS does not spread over its threads.

    Waking the threads costs more than such a product, and a hundred times more where the processors are busy; limiting
    their number would change the user's process.
    """
    if len(a) * b.size <= SINGLE_THREAD_PRODUCTS:
        return a @ b
    inner, columns = b.shape
    if b.size * MIN_BLOCK_ROWS > SINGLE_THREAD_PRODUCTS and inner >= columns:
        half = inner // 2
        return product(a[:, :half], b[:half]) + product(a[:, half:], b[half:])
    if b.size * MIN_BLOCK_ROWS > SINGLE_THREAD_PRODUCTS:
        half = columns // 2
        return np.concatenate((product(a, b[:, :half]), product(a, b[:, half:])), axis=1)
    rows = SINGLE_THREAD_PRODUCTS // b.size
    return np.concatenate([a[i : i + rows] @ b for i in range(0, len(a), rows)])


def over_rows(rows: Array, matrix: Array) -> Array:
    """The products of many rows (..., k) and a matrix (k, l), shape (..., l), as one ``product``."""
    return product(rows.reshape(-1, rows.shape[-1]), matrix).reshape(*rows.shape[:-1], matrix.shape[1])
