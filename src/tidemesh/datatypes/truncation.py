"""Localised truncation error as a series in the spacing (paper, Eq. 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tidemesh.datatypes._arrays import BoolArray, ComplexArray, own_fields


@dataclass(frozen=True, eq=False)
class TruncationSeries:
    """Coefficients of error = second * Delta**2 + fourth * Delta**4 at every node.

    One component for the paper's scalar sum tau_x + tau_y, two (x, y) for the vector
    form; norms are taken over the components.
    """

    second: ComplexArray
    """(n_c, n_components, n_points) 1/(m s2)."""
    fourth: ComplexArray
    """(n_c, n_components, n_points) 1/(m3 s2)."""
    known: BoolArray
    """(n_points,) True where the estimator is defined."""

    def __post_init__(self) -> None:
        own_fields(self, second=(np.complex128, (None, None, None)))
        own_fields(
            self,
            fourth=(np.complex128, self.second.shape),
            known=(np.bool_, (self.second.shape[2],)),
        )
