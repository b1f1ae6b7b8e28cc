"""Run stages in order, skip those whose inputs have not changed, keep the record."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import logging
import math
import platform
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from operator import attrgetter
from pathlib import Path
from typing import Any, Protocol

import msgspec
import psutil

import tidemesh
from tidemesh.errors import InputError
from tidemesh.io.files import atomic, sha256
from tidemesh.pipeline import store
from tidemesh.pipeline.case import Case

log = logging.getLogger(__name__)

_LIBRARIES = (
    "numpy",
    "scipy",
    "numba",
    "pythoncdt",
    "shapely",
    "pyproj",
    "pyogrio",
    "rasterio",
    "netCDF4",
    "matplotlib",
    "utide",
)


class Reporter(Protocol):
    """Hears how a run goes on; every method may be a no-op."""

    def start(self, stage: str, index: int, total: int) -> None:
        """A stage begins."""

    def update(self, fraction: float) -> None:
        """The stage has done this share (0..1) of its work."""

    def finish(self, stage: str, seconds: float, resumed: bool) -> None:
        """A stage is done, or was found done by an earlier run."""


class SilentReporter:
    """Says nothing."""

    def start(self, stage: str, index: int, total: int) -> None:
        """Ignore."""

    def update(self, fraction: float) -> None:
        """Ignore."""

    def finish(self, stage: str, seconds: float, resumed: bool) -> None:
        """Ignore."""


@dataclass
class Context:
    """What a stage may read and where it writes."""

    case: Case
    files: Mapping[str, Path]
    """Input files by key, for instance "domain.shoreline"."""
    folder: Path
    """Where relative paths of the case start."""
    output: Path
    progress: Callable[[float], None] = lambda fraction: None
    report: dict[str, Any] = field(default_factory=dict)
    """Figures of the running stage, for summary.json."""
    written: list[Path] = field(default_factory=list)
    """Files of the running stage, for manifest.json."""
    _values: dict[str, Any] = field(default_factory=dict)

    def __getitem__(self, stage: str) -> Any:
        """Result of an earlier stage, read back from disk when it was skipped."""
        if stage not in self._values:
            self._values[stage] = store.load(_result_path(self.output, stage))
        return self._values[stage]

    def path(self, name: str) -> Path:
        """Path of an output file, entered into the stage's record."""
        path = self.output / name
        path.parent.mkdir(parents=True, exist_ok=True)
        self.written.append(path)
        return path


@dataclass(frozen=True)
class Stage:
    """One step of the method."""

    name: str
    run: Callable[[Context], Any]
    """Returns what later stages need, in data types and plain containers."""
    sections: tuple[str, ...]
    """Sections of the case that it reads, or "section.key"."""
    inputs: tuple[str, ...] = ()
    """Beginnings of the keys of the input files that it reads."""
    needs: tuple[str, ...] = ()
    """Earlier stages whose results it reads."""


@dataclass(frozen=True)
class Run:
    """What a run left behind."""

    output: Path
    summary: dict[str, Any]
    resumed: tuple[str, ...]
    """Stages taken over from an earlier run."""


def run_stages(
    stages: Sequence[Stage],
    case: Case,
    files: Mapping[str, Path],
    output: Path,
    *,
    folder: Path = Path(),
    until: str | None = None,
    reporter: Reporter | None = None,
) -> Run:
    """Run stages in order; leave results, ``summary.json`` and ``manifest.json``.

    A stage is skipped when its key (settings, content of its input files, keys of the
    stages it needs, the program itself) is that of its record and its files are
    still what the record says.

    Raises
    ------
    InputError
        If the stage of ``until`` is unknown or the output cannot be written.
    """
    reporter = reporter or SilentReporter()
    names = [stage.name for stage in stages]
    if until is not None and until not in names:
        raise InputError(f"--until {until}: expected one of {', '.join(names)}")
    last = names.index(until) + 1 if until else len(stages)
    output = Path(output)
    _check_writable(output)

    digests = {key: _digest(path) for key, path in files.items()}
    context = Context(case, files, folder, output)
    keys: dict[str, str] = {}
    records: dict[str, dict[str, Any]] = {}
    resumed = []
    for index, stage in enumerate(stages[:last]):
        keys[stage.name] = _key(stage, case, digests, keys)
        record = _valid_record(output, stage.name, keys[stage.name])
        reporter.start(stage.name, index, last)
        if record is None:
            record = _run_stage(stage, context, keys[stage.name], reporter)
            reporter.finish(stage.name, record["seconds"], False)
        else:
            resumed.append(stage.name)
            reporter.finish(stage.name, record["seconds"], True)
        records[stage.name] = record
    # Later stages of an earlier run still stand if nothing that they read has changed.
    for stage in stages[last:]:
        keys[stage.name] = _key(stage, case, digests, keys)
        record = _valid_record(output, stage.name, keys[stage.name])
        if record is not None:
            records[stage.name] = record

    summary = strict(_summary(case, records))
    _write_json(output / "summary.json", summary)
    manifest = _manifest(case, files, digests, records)
    manifest["outputs"]["summary.json"] = sha256(output / "summary.json")
    _write_json(output / "manifest.json", manifest)
    return Run(output, summary, tuple(resumed))


def _run_stage(
    stage: Stage, context: Context, key: str, reporter: Reporter
) -> dict[str, Any]:
    context.report, context.written = {}, []
    context.progress = reporter.update
    with _PeakMemory() as memory:
        wall, cpu = time.perf_counter(), time.process_time()
        value = stage.run(context)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    context._values[stage.name] = value
    result = _result_path(context.output, stage.name)
    store.save(result, value)
    files = [*context.written, result]
    record = {
        "stage": stage.name,
        "key": key,
        "seconds": round(wall, 3),
        "cpu_seconds": round(cpu, 3),
        "peak_mb": round(memory.peak / 1e6, 1),
        "report": context.report,
        "files": {p.relative_to(context.output).as_posix(): sha256(p) for p in files},
    }
    _write_json(_record_path(context.output, stage.name), record)
    return record


# ---- keys and records -----------------------------------------------------------


def _key(
    stage: Stage, case: Case, digests: Mapping[str, str], keys: Mapping[str, str]
) -> str:
    settings = {s: msgspec.to_builtins(attrgetter(s)(case)) for s in stage.sections}
    content = {
        "stage": stage.name,
        "program": program_fingerprint(),
        "settings": settings,
        "inputs": {k: d for k, d in digests.items() if k.startswith(stage.inputs)},
        "needs": {name: keys[name] for name in stage.needs},
    }
    text = json.dumps(content, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


@cache
def program_fingerprint() -> str:
    """SHA-256 over the package's own source: another program, other results."""
    digest = hashlib.sha256(tidemesh.__version__.encode())
    root = Path(tidemesh.__file__).parent
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _digest(path: Path) -> str:
    """Of a file its content; of a folder (atlases of gigabytes) names, sizes, times."""
    if not path.is_dir():
        return sha256(path)
    digest = hashlib.sha256()
    for inner in sorted(p for p in path.rglob("*") if p.is_file()):
        found = inner.stat()
        name = inner.relative_to(path).as_posix()
        digest.update(f"{name} {found.st_size} {found.st_mtime_ns}\n".encode())
    return digest.hexdigest()


def _record_path(output: Path, stage: str) -> Path:
    return output / "stages" / f"{stage}.json"


def _result_path(output: Path, stage: str) -> Path:
    return output / "stages" / f"{stage}.npz"


def _valid_record(output: Path, stage: str, key: str) -> dict[str, Any] | None:
    try:
        record = json.loads(_record_path(output, stage).read_text(encoding="utf-8"))
        if record["key"] != key:
            return None
        for name, digest in record["files"].items():
            if sha256(output / name) != digest:
                return None
    except (OSError, ValueError, KeyError, InputError):
        return None
    return record


def _check_writable(output: Path) -> None:
    try:
        (output / "stages").mkdir(parents=True, exist_ok=True)
        probe = output / "stages" / ".writable"
        probe.write_bytes(b"")
        probe.unlink()
    except OSError as error:
        raise InputError(
            f"output folder {output} cannot be written ({error.strerror}); "
            "name another with --output"
        ) from None


# ---- summary and manifest -------------------------------------------------------


def _summary(case: Case, records: Mapping[str, dict[str, Any]]) -> dict[str, Any]:
    summary: dict[str, Any] = {"title": case.title, "tidemesh": tidemesh.__version__}
    for record in records.values():
        summary.update(record["report"])
    summary["stages"] = {
        name: {k: record[k] for k in ("seconds", "cpu_seconds", "peak_mb")}
        for name, record in records.items()
    }
    summary["seconds"] = round(sum(r["seconds"] for r in records.values()), 3)
    summary["cpu_seconds"] = round(sum(r["cpu_seconds"] for r in records.values()), 3)
    summary["peak_mb"] = max((r["peak_mb"] for r in records.values()), default=0.0)
    return summary


def _manifest(
    case: Case,
    files: Mapping[str, Path],
    digests: Mapping[str, str],
    records: Mapping[str, dict[str, Any]],
) -> dict[str, Any]:
    outputs: dict[str, str] = {}
    for record in records.values():
        outputs.update(record["files"])
    return {
        "tidemesh": tidemesh.__version__,
        "program_sha256": program_fingerprint(),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "libraries": {name: _version(name) for name in _LIBRARIES},
        "settings": msgspec.to_builtins(case),
        "inputs": {
            key: {"file": path.name, "sha256": digests[key]}
            for key, path in files.items()
        },
        "outputs": dict(sorted(outputs.items())),
    }


def _version(name: str) -> str | None:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def _write_json(path: Path, value: Any) -> None:
    with atomic(path) as temporary:
        text = json.dumps(strict(value), indent=2, allow_nan=False)
        Path(temporary).write_text(text + "\n", encoding="utf-8")


def strict(value: Any) -> Any:
    """Plain values that every JSON reader takes: no arrays, "inf" for infinity."""
    if isinstance(value, Mapping):
        return {str(key): strict(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [strict(inner) for inner in value]
    if hasattr(value, "tolist"):
        return strict(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if value is None or isinstance(value, str | bool | int | float):
        return value
    return str(value)


class _PeakMemory:
    """Largest resident memory of this process while the block runs, by sampling."""

    def __enter__(self) -> _PeakMemory:
        self._process = psutil.Process()
        self.peak = self._process.memory_info().rss
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._sample, daemon=True)
        self._thread.start()
        return self

    def _sample(self) -> None:
        while not self._stop.wait(0.02):
            self.peak = max(self.peak, self._process.memory_info().rss)

    def __exit__(self, *exception: object) -> None:
        self._stop.set()
        self._thread.join()
        self.peak = max(self.peak, self._process.memory_info().rss)
