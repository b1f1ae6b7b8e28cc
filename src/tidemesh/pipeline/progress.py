"""Progress on the terminal, with time left per stage."""

from __future__ import annotations

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

_WORDS = {
    "domain": "domain",
    "base_grid": "base grid and depths",
    "tide": "tide",
    "truncation": "truncation error",
    "sizing": "sizes for the budget",
    "mesh": "mesh",
    "check": "tide on the mesh",
    "figures": "figures",
}


class RichReporter:
    """One bar a stage on standard error; a context manager."""

    def __init__(self) -> None:
        self._progress = Progress(
            TextColumn("{task.description:<24}"),
            BarColumn(bar_width=24),
            TextColumn("{task.percentage:>3.0f}%"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            TextColumn("{task.fields[note]}"),
            console=Console(stderr=True),
        )
        self._task: TaskID | None = None

    def __enter__(self) -> RichReporter:
        self._progress.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._progress.stop()

    def start(self, stage: str, index: int, total: int) -> None:
        """Open the stage's bar."""
        words = f"{index + 1}/{total} {_WORDS.get(stage, stage)}"
        self._task = self._progress.add_task(words, total=1.0, note="")

    def update(self, fraction: float) -> None:
        """Move the bar."""
        if self._task is not None:
            self._progress.update(self._task, completed=min(max(fraction, 0.0), 1.0))

    def finish(self, stage: str, seconds: float, resumed: bool) -> None:
        """Fill the bar."""
        if self._task is not None:
            note = "unchanged" if resumed else ""
            self._progress.update(self._task, completed=1.0, note=note)
