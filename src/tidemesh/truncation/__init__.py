"""Truncation error of a tide on a mesh, and other error indicators (section 3.3)."""

from tidemesh.truncation.hessian import hessian_magnitude, recovered_hessian
from tidemesh.truncation.momentum import error_at, momentum_series
from tidemesh.truncation.recovery import fit_polynomials
from tidemesh.truncation.settings import TruncationSettings
from tidemesh.truncation.wave_equation import wave_equation_error

__all__ = [
    "TruncationSettings",
    "error_at",
    "fit_polynomials",
    "hessian_magnitude",
    "momentum_series",
    "recovered_hessian",
    "wave_equation_error",
]
