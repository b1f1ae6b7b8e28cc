"""The whole program: case file, stages, run record."""

from tidemesh.pipeline.case import Case, decode_case, read_case
from tidemesh.pipeline.run import run_case
from tidemesh.pipeline.runner import Run

__all__ = ["Case", "Run", "decode_case", "read_case", "run_case"]
