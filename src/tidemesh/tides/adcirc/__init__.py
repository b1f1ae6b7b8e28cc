"""ADCIRC as a tide engine."""
