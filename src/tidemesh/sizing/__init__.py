"""Section 3.4: from the error of the tide to the allowed node spacing."""

from tidemesh.sizing.budget import BudgetLevel, expected_nodes, find_level
from tidemesh.sizing.extrapolate import harmonic_extension, smooth_logarithm
from tidemesh.sizing.gradation import limit_gradation
from tidemesh.sizing.limits import (
    boundary_spacing,
    clip,
    feature_width,
    spacing_limits,
)
from tidemesh.sizing.radii import allowable_spacing, error_at_spacing, smallest_root
from tidemesh.sizing.rules import RULES, RuleInputs, SizeRule, build_rule, power_rule
from tidemesh.sizing.settings import SizeRegion, SizingSettings
from tidemesh.sizing.sizes import (
    allowable_sizes,
    choose_level,
    error_level,
    level_at_spacing,
    size_builder,
)

__all__ = [
    "RULES",
    "BudgetLevel",
    "RuleInputs",
    "SizeRegion",
    "SizeRule",
    "SizingSettings",
    "allowable_sizes",
    "allowable_spacing",
    "boundary_spacing",
    "build_rule",
    "choose_level",
    "clip",
    "error_at_spacing",
    "error_level",
    "expected_nodes",
    "feature_width",
    "find_level",
    "harmonic_extension",
    "level_at_spacing",
    "limit_gradation",
    "power_rule",
    "size_builder",
    "smallest_root",
    "smooth_logarithm",
    "spacing_limits",
]
