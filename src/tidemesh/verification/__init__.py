"""Modelled against observed tides (paper, section 4)."""
