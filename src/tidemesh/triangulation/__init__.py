"""Delaunay, topology, quality and point location on (points, triangles)."""
