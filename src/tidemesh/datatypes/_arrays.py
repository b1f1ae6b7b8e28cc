"""Own, read-only copies of the caller's arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
ComplexArray = NDArray[np.complex128]


def own(values: ArrayLike, dtype: type, shape: tuple[int | None, ...], name: str):
    """Copy to a read-only C-ordered array and check its shape (None = any length).

    The copy is what is locked, never the caller's own array.
    """
    array = np.array(values, dtype=dtype, order="C", copy=True)
    fits = array.ndim == len(shape) and all(
        want is None or want == have for want, have in zip(shape, array.shape)
    )
    if not fits:
        wanted = tuple("any" if n is None else n for n in shape)
        raise ValueError(f"{name} must have shape {wanted}, got {array.shape}")
    array.flags.writeable = False
    return array


def own_fields(instance: object, **fields: tuple[type, tuple[int | None, ...]]) -> None:
    """Replace the named fields of a frozen dataclass by their read-only copies."""
    for name, (dtype, shape) in fields.items():
        value = own(getattr(instance, name), dtype, shape, name)
        object.__setattr__(instance, name, value)
