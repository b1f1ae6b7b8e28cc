"""Imports point down, and rooms of one row are strangers (CONTRIBUTING.md)."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1] / "src" / "tidemesh"
ROWS = (
    ("geometry", "constants", "errors"),
    ("datatypes",),
    ("triangulation", "io"),
    (
        "boundary",
        "basegrid",
        "tides",
        "truncation",
        "sizing",
        "hierarchy",
        "improve",
        "verification",
        "plots",
    ),
    ("pipeline",),
    ("cli",),
)
ROW = {room: number for number, row in enumerate(ROWS) for room in row}


def imported_rooms(path: Path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        for name in names:
            package, _, rest = name.partition(".")
            room = rest.partition(".")[0]
            if package == "tidemesh" and room in ROW:
                yield room


@pytest.mark.parametrize("room", ROW)
def test_imports_point_down(room):
    files = sorted((ROOT / room).rglob("*.py")) or [ROOT / f"{room}.py"]
    for path in files:
        for other in imported_rooms(path):
            # Geometry, constants and errors are one ground floor.
            below = ROW[other] < ROW[room] or (ROW[other] == ROW[room] == 0)
            assert other == room or below, f"{path.name} imports {other}"


def test_every_room_has_its_row():
    rooms = {p.name for p in ROOT.iterdir() if (p / "__init__.py").exists()}
    rooms |= {p.stem for p in ROOT.glob("*.py")} - {"__init__"}
    assert rooms == set(ROW)
