"""From a shoreline to the domain (paper, section 3.1)."""

from tidemesh.boundary.distance import distance_to_land
from tidemesh.boundary.domain import build_domain
from tidemesh.boundary.settings import DomainSettings
from tidemesh.boundary.spacing import enforce_spacing

__all__ = ["DomainSettings", "build_domain", "distance_to_land", "enforce_spacing"]
