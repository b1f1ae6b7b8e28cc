"""The whole program: case file, stages, run record."""
