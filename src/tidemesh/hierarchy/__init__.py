"""Node placement by hierarchies of segments and triangles (paper, section 3.5)."""

from tidemesh.hierarchy.selection import Selection, count_points, select_points
from tidemesh.hierarchy.settings import HierarchySettings

__all__ = ["HierarchySettings", "Selection", "count_points", "select_points"]
