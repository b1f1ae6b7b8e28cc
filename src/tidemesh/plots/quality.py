"""Element quality."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from tidemesh.datatypes import CoastalMesh
from tidemesh.plots.maps import BLUE, GREEN, VERMILION, new_axis
from tidemesh.triangulation.quality import shape_quality


def quality_histogram(mesh: CoastalMesh, *, axis: Axes | None = None) -> Axes:
    """Number of elements by shape quality, the mean and the least marked.

    Parameters
    ----------
    mesh : CoastalMesh
    axis : Axes, optional

    Returns
    -------
    Axes
    """
    axis = new_axis(axis)
    q = shape_quality(mesh.points, mesh.triangles)
    # A logarithmic axis, since a mesh is as good as its few worst elements.
    axis.hist(np.clip(q, 0.0, 1.0), bins=50, range=(0.0, 1.0), color=BLUE, log=True)
    for value, name, colour in (
        (q.mean(), "mean", GREEN),
        (q.min(), "least", VERMILION),
    ):
        axis.axvline(value, color=colour, linewidth=1.5, label=f"{name} {value:.3f}")
    axis.set_xlim(0.0, 1.02)
    axis.set_box_aspect(0.6)
    axis.set_xlabel("element quality q (1 = equilateral)")
    axis.set_ylabel("elements")
    axis.legend(loc="upper left")
    axis.set_title(f"Quality of {len(q):,} elements: {np.mean(q < 0.6):.2%} below 0.6")
    return axis
