"""The files of a verification."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tidemesh.io.files import atomic
from tidemesh.verification.constants import ConstantsComparison, csv_fields
from tidemesh.verification.gauges import LeftOut
from tidemesh.verification.records import RecordComparison, iso_time


def write_verification(
    folder: str | Path,
    *,
    constants: ConstantsComparison | None = None,
    records: Sequence[RecordComparison] = (),
    left_out: Sequence[LeftOut] = (),
    title: str = "",
) -> list[Path]:
    """Write comparisons: verification.json and .md, constants.csv, records.csv.

    Parameters
    ----------
    folder : path
        Made if it is not there.
    constants : ConstantsComparison, optional
    records : sequence of RecordComparison
    left_out : sequence of LeftOut
        Gauges that were not compared, and why.
    title : str

    Returns
    -------
    paths : list of path
        Files written.

    Raises
    ------
    InputError
        If the folder cannot be written to.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    content: dict[str, Any] = {"title": title} if title else {}
    if constants is not None:
        content["constants"] = constants.as_dict()
    content["records"] = [record.as_dict() for record in records]
    content["left_out"] = [one._asdict() for one in left_out]
    paths = [folder / "verification.json", folder / "verification.md"]
    with atomic(paths[0]) as unfinished:
        text = json.dumps(_plain(content), indent=2, allow_nan=False)
        unfinished.write_text(text + "\n", encoding="utf-8")
    with atomic(paths[1]) as unfinished:
        unfinished.write_text(
            _markdown(constants, records, left_out, title), encoding="utf-8"
        )
    if constants is not None:
        paths.append(folder / "constants.csv")
        _write_csv(
            paths[-1],
            csv_fields(),
            ([_cell(v) for v in asdict(row).values()] for row in constants.rows),
        )
    if records:
        paths.append(folder / "records.csv")
        _write_csv(
            paths[-1],
            ["station", "time_utc", "observed_m", "modelled_m"],
            (
                [record.station, iso_time(second), f"{truth:.4f}", f"{level:.4f}"]
                for record in records
                for second, truth, level in zip(
                    record.time, record.observed, record.modelled
                )
            ),
        )
    return paths


def _write_csv(path: Path, header: list[str], rows) -> None:
    with (
        atomic(path) as unfinished,
        open(unfinished, "w", encoding="utf-8", newline="") as file,
    ):
        table = csv.writer(file, lineterminator="\n")
        table.writerow(header)
        table.writerows(rows)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _plain(value: Any) -> Any:
    """JSON knows no NaN."""
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(one) for one in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _markdown(
    constants: ConstantsComparison | None,
    records: Sequence[RecordComparison],
    left_out: Sequence[LeftOut],
    title: str,
) -> str:
    parts = [f"# {title or 'Verification'}"]
    if constants is not None:
        parts += ["## Harmonic constants", constants.as_markdown().rstrip()]
        parts.append(
            "Errors are modelled less observed; a positive phase error means that the "
            "model is late. The rms error is the root mean square over gauges and time."
        )
    if records:
        parts += ["## Water levels", *(record.as_text() for record in records)]
    if left_out:
        parts.append("## Gauges left out")
        parts.append("\n".join(f"- {one.gauge}: {one.reason}" for one in left_out))
    return "\n\n".join(parts) + "\n"
