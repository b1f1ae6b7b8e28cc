"""Shared by all tests: the shipped cases and the data beside the repository."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[1]


@pytest.fixture(scope="session")
def examples() -> Path:
    """Folder of the shipped cases."""
    return REPOSITORY / "examples"


@pytest.fixture
def island(tmp_path: Path, examples: Path) -> Path:
    """A fresh copy of the island case; the path of its case file."""
    folder = tmp_path / "island"
    shutil.copytree(examples / "island", folder)
    return folder / "island.toml"
