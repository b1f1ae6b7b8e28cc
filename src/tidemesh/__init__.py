"""Meshes for tide models, sized by tidal truncation error."""

__version__ = "0.1.0"
