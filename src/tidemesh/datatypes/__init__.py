"""The few nouns that travel between the rooms."""

from tidemesh.datatypes.domain import LAND, OCEAN, Domain, LedgerEntry, Ring
from tidemesh.datatypes.mesh import BoundaryString, CoastalMesh
from tidemesh.datatypes.raster import Raster, Soundings
from tidemesh.datatypes.size_field import SizeField
from tidemesh.datatypes.tide import TideForcing, TideRecord, TideSolution, TideTable
from tidemesh.datatypes.truncation import TruncationSeries

__all__ = [
    "LAND",
    "OCEAN",
    "BoundaryString",
    "CoastalMesh",
    "Domain",
    "LedgerEntry",
    "Raster",
    "Ring",
    "SizeField",
    "Soundings",
    "TideForcing",
    "TideRecord",
    "TideSolution",
    "TideTable",
    "TruncationSeries",
]
