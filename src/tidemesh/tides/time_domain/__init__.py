"""Nonlinear tides in the time domain (paper, section 4)."""
