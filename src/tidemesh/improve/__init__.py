"""Mesh improvement: smoothing, cleaning (paper, section 3.5)."""

from tidemesh.improve.clean import Cleaned, clean
from tidemesh.improve.mesh import improve_mesh
from tidemesh.improve.settings import ImproveSettings
from tidemesh.improve.smooth import Smoothed, smooth

__all__ = [
    "Cleaned",
    "ImproveSettings",
    "Smoothed",
    "clean",
    "improve_mesh",
    "smooth",
]
