"""Points, polylines, polygons, projection; no meshes, no tides."""
