"""The case file: read, override, check."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from datetime import date
from pathlib import Path
from typing import Annotated, Any

import msgspec

from tidemesh.basegrid.settings import BaseGridSettings, DepthSettings
from tidemesh.boundary.settings import DomainSettings
from tidemesh.errors import FormatError, InputError
from tidemesh.hierarchy.settings import HierarchySettings
from tidemesh.improve.settings import ImproveSettings
from tidemesh.sizing.settings import SizingSettings
from tidemesh.tides.adcirc.settings import AdcircSettings
from tidemesh.tides.settings import TideSettings
from tidemesh.tides.time_domain.settings import SimulationSettings
from tidemesh.truncation.settings import TruncationSettings

_STRICT = {"frozen": True, "kw_only": True, "forbid_unknown_fields": True}


class AtlasSettings(msgspec.Struct, **_STRICT):
    """A global atlas that the user owns, read through pyTMD."""

    directory: str
    """Folder of the atlas files, as pyTMD expects them below it."""
    model: str
    """Name in pyTMD's data base, for instance "GOT5.5", "FES2014", "TPXO9-atlas-v5"."""


class GaugeFitSettings(msgspec.Struct, **_STRICT):
    """Boundary values fitted to harmonic constants at coastal gauges."""

    table: str
    """Table of harmonic constants at the gauges."""
    smoothness: Annotated[float, msgspec.Meta(gt=0.0)] | None = None
    """Weight of the smoothness of the boundary values; left out: the weight with the
    least leave-one-out error."""
    max_distance_km: Annotated[float, msgspec.Meta(gt=0.0)] = 3.0
    """Farthest that a gauge may lie outside the mesh; farther ones are left out."""
    outlier: Annotated[float, msgspec.Meta(gt=1.0)] | None = None
    """Leave out gauges, the worst first, whose leave-one-out error is more than so many
    times the median (gauges in creeks that the mesh does not hold); left out: keep
    all."""


class ForcingSettings(msgspec.Struct, **_STRICT):
    """Where the tide on the ocean boundary comes from: table, atlas or gauges."""

    table: str | None = None
    """Table of harmonic constants: longitude, latitude, constituent, amplitude (m),
    Greenwich phase (degrees). Beside ``from_gauges``, the first guess."""
    atlas: AtlasSettings | None = None
    """A global atlas instead of a table."""
    from_gauges: GaugeFitSettings | None = None
    """Fitted to gauges on the coast; needs no atlas."""
    gauges: str | None = None
    """Harmonic constants at gauges, to set the solution beside; not used otherwise."""

    def __post_init__(self) -> None:
        if self.from_gauges is None and (self.table is None) == (self.atlas is None):
            raise ValueError(
                "forcing needs one of table, atlas and from_gauges: harmonic constants "
                "on the ocean boundary, a global atlas, or gauges on the coast"
            )


class OutputSettings(msgspec.Struct, **_STRICT):
    """What is written."""

    figures: bool = True
    resolution_dpi: Annotated[int, msgspec.Meta(ge=50, le=600)] = 150


class Case(msgspec.Struct, **_STRICT):
    """Everything that decides a mesh: one section a stage."""

    title: str = ""
    domain: DomainSettings
    base_grid: BaseGridSettings
    depth: DepthSettings
    forcing: ForcingSettings
    tide: TideSettings = TideSettings()
    adcirc: AdcircSettings = AdcircSettings()
    simulation: SimulationSettings = SimulationSettings()
    truncation: TruncationSettings = TruncationSettings()
    sizing: SizingSettings = SizingSettings()
    hierarchy: HierarchySettings = HierarchySettings()
    improve: ImproveSettings = ImproveSettings()
    output: OutputSettings = OutputSettings()

    def __post_init__(self) -> None:
        if not self.depth.sources:
            raise ValueError(
                "depth.sources is empty: name at least one raster or file of soundings"
            )


def read_case(path: str | Path, overrides: Sequence[str] = ()) -> Case:
    """Read a case file.

    Parameters
    ----------
    path : path
        A TOML file; see ``tidemesh init`` for a commented one.
    overrides : sequence of "section.key=value"
        Replace single values; a value is written as in TOML, bare words are strings.

    Raises
    ------
    InputError
        If the file is missing, or a key or value is not as expected.
    FormatError
        If the file is not TOML.
    """
    data, text = read_toml(path, overrides)
    return decode_case(data, name=str(path), text=text)


def read_toml(
    path: str | Path, overrides: Sequence[str] = ()
) -> tuple[dict[str, Any], str]:
    """Read a case file into plain dictionaries, and its text for messages.

    Raises
    ------
    InputError
        If the file is missing or cannot be read, or an override is not written so.
    FormatError
        If the file is not TOML.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(
            f"{path}: no such case file; `tidemesh init DIR` writes one to start from"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        found = re.search(r"\(at line (\d+)", str(error))
        line = int(found[1]) if found else None
        raise FormatError(f"not valid TOML: {error}", path, line) from None
    apply_overrides(data, overrides)
    return data, text


def apply_overrides(data: dict[str, Any], overrides: Sequence[str]) -> None:
    """Replace single values of a case, "section.key=value", in place.

    Raises
    ------
    InputError
        If one is not written so.
    """
    for override in overrides:
        _apply(data, override)


def decode_case(
    data: dict[str, Any], *, kind: type = Case, name: str = "case", text: str = ""
) -> Any:
    """Turn plain dictionaries into a checked `Case`, or another struct of sections.

    Raises
    ------
    InputError
        Naming key, value, expectation and, for unknown keys, the nearest valid key.
    """
    data = _dates_as_text(data)
    try:
        return msgspec.convert(data, kind)
    except msgspec.ValidationError as error:
        raise InputError(_explain(str(error), data, name, text, kind)) from None


def _dates_as_text(value: Any) -> Any:
    """TOML has dates without quotes; ours are text."""
    if isinstance(value, dict):
        return {key: _dates_as_text(item) for key, item in value.items()}
    return value.isoformat() if isinstance(value, date) else value


def _apply(data: dict[str, Any], override: str) -> None:
    key, equals, value = override.partition("=")
    names = key.strip().split(".")
    if not equals or not all(names):
        raise InputError(
            f'--set {override}: expected "section.key=value", '
            'for instance "sizing.nodes=5000"'
        )
    try:
        parsed = tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        parsed = value.strip()
    for name in names[:-1]:
        data = data.setdefault(name, {})
        if not isinstance(data, dict):
            raise InputError(f"--set {override}: {name} is not a section")
    data[names[-1]] = parsed


# ---- messages -------------------------------------------------------------------


def _explain(message: str, data: dict, name: str, text: str, root: type) -> str:
    """Rewrite msgspec's message with key, value, expectation and nearest key."""
    reason, _, place = message.partition(" - at `")
    steps = _steps(place.rstrip("`"))
    dotted = _dotted(steps)
    unknown = re.search(r"unknown field `(.+)`", reason)
    if unknown:
        key = unknown[1]
        valid = sorted(_valid_keys(steps, data, root))
        near = difflib.get_close_matches(key, valid, n=1, cutoff=0.5)
        hint = f'did you mean "{near[0]}"? ' if near else ""
        full = f"{dotted}.{key}" if dotted else key
        line = _line(text, [*steps, key])
        section = f"[{dotted}]" if dotted else "a case"
        return (
            f"{name}: {line}{full}: unknown key; {hint}"
            f"keys of {section}: {', '.join(valid)}"
        )
    missing = re.search(r"missing required field `(.+)`", reason)
    if missing:
        full = f"{dotted}.{missing[1]}" if dotted else missing[1]
        return f"{name}: {_line(text, steps)}{full}: required key is missing"
    value = data
    for step in steps:
        try:
            value = value[step]
        except (KeyError, IndexError, TypeError):
            break
    if reason.startswith("Invalid"):
        allowed = _allowed_values(steps, data, root)
        near = difflib.get_close_matches(str(value), allowed, n=1, cutoff=0.5)
        hint = f'; did you mean "{near[0]}"?' if near else ""
        reason = "expected one of " + ", ".join(f'"{a}"' for a in allowed) + hint
    else:
        reason = reason.replace("`", "")
        reason = reason[:1].lower() + reason[1:]
    place = f"{dotted} = {_short(value)}" if dotted else "the case"
    return f"{name}: {_line(text, steps)}{place}: {reason}"


def _short(value: object) -> str:
    shown = f'"{value}"' if isinstance(value, str) else repr(value)
    return shown if len(shown) <= 60 else shown[:57] + "..."


def _steps(place: str) -> list[str | int]:
    parts = re.findall(r"\.([A-Za-z_]\w*)|\[(\d+)\]", place)
    return [int(index) if index else name for name, index in parts]


def _dotted(steps: Sequence[str | int]) -> str:
    text = "".join(f"[{s}]" if isinstance(s, int) else f".{s}" for s in steps)
    return text.removeprefix(".")


def _line(text: str, steps: Sequence[str | int]) -> str:
    """Words "line N: " for the key in the file, or for the section above it."""
    section: list[str] = []
    names = [s for s in steps if isinstance(s, str)]
    best = None
    for number, row in enumerate(text.splitlines(), start=1):
        header = re.match(r"\s*\[+\s*([^\]]+?)\s*\]+", row)
        if header:
            section = header[1].split(".")
            if names and section == names:
                best = best or number
            continue
        key = re.match(r"\s*([\w.]+)\s*=", row)
        if key and [*section, *key[1].split(".")] == names:
            return f"line {number}: "
    return f"line {best}: " if best else ""


def _types(steps: Sequence[str | int], data: Any, root: type) -> Iterator[Any]:
    """Every msgspec type that the place may have, tagged unions resolved."""
    found = [msgspec.inspect.type_info(root)]
    for step in steps:
        found = [kind for one in found for kind in _expand(one, data)]
        nexts = []
        for one in found:
            if isinstance(one, msgspec.inspect.StructType) and isinstance(step, str):
                nexts += [f.type for f in one.fields if f.encode_name == step]
            elif isinstance(step, int):
                inner = getattr(one, "item_type", None)
                inner = inner or (getattr(one, "item_types", None) or [None])[0]
                nexts += [inner] if inner is not None else []
        try:
            data = data[step]
        except (KeyError, IndexError, TypeError):
            data = None
        found = nexts
    for one in found:
        yield from _expand(one, data)


def _expand(kind: Any, data: Any) -> list[Any]:
    if isinstance(kind, msgspec.inspect.UnionType):
        kinds = list(kind.types)
        tagged = [
            k
            for k in kinds
            if isinstance(k, msgspec.inspect.StructType)
            and isinstance(data, dict)
            and data.get(k.tag_field) == k.tag
        ]
        return tagged or kinds
    return [kind]


def _valid_keys(steps: Sequence[str | int], data: Any, root: type) -> set[str]:
    keys: set[str] = set()
    for kind in _types(steps, data, root):
        if isinstance(kind, msgspec.inspect.StructType):
            keys.update(field.encode_name for field in kind.fields)
            if kind.tag_field:
                keys.add(kind.tag_field)
    return keys


def _allowed_values(steps: Sequence[str | int], data: Any, root: type) -> list[str]:
    allowed: list[str] = []
    for kind in _types(steps, data, root):
        if isinstance(kind, msgspec.inspect.LiteralType):
            allowed += [str(v) for v in kind.values]
    if allowed or not steps:
        return allowed
    # The tag of a union is no field of its own: list the tags instead.
    for kind in _types(steps[:-1], {}, root):
        if isinstance(kind, msgspec.inspect.StructType) and kind.tag_field == steps[-1]:
            allowed.append(str(kind.tag))
    return allowed


# ---- files ----------------------------------------------------------------------


def input_files(case: Case, folder: str | Path) -> dict[str, Path]:
    """Files named by a case: "domain.shoreline" -> path, relative ones below folder.

    Raises
    ------
    InputError
        If a file does not exist, naming the key.
    """
    return find_files(_named_files(case), folder)


def find_files(named: Iterable[tuple[str, str]], folder: str | Path) -> dict[str, Path]:
    """Paths of (key, name), relative ones below a folder.

    Raises
    ------
    InputError
        If one does not exist, naming the key.
    """
    folder = Path(folder)
    found: dict[str, Path] = {}
    for key, name in named:
        path = Path(name)
        path = path if path.is_absolute() else folder / path
        wanted = "folder" if key.endswith(".directory") else "file"
        if not (path.is_dir() if wanted == "folder" else path.is_file()):
            raise InputError(
                f"{key}: no such {wanted}: {path} (paths are relative to the case file)"
            )
        found[key] = path
    return found


def _named_files(case: Case) -> Iterator[tuple[str, str]]:
    yield "domain.shoreline", case.domain.shoreline
    for index, region in enumerate(case.domain.regions):
        if region.shoreline:
            yield f"domain.regions[{index}].shoreline", region.shoreline
    ocean_file = getattr(case.domain.ocean, "file", None)
    if ocean_file:
        yield "domain.ocean.file", ocean_file
    for index, source in enumerate(case.depth.sources):
        yield f"depth.sources[{index}].path", source.path
    yield from tide_files(case.forcing, case.tide, case.adcirc)


def tide_files(
    forcing: ForcingSettings | None,
    tide: TideSettings,
    adcirc: AdcircSettings | None = None,
) -> Iterator[tuple[str, str]]:
    """Files by key that the tide of a case reads."""
    if forcing is not None:
        if forcing.table:
            yield "forcing.table", forcing.table
        if forcing.atlas:
            yield "forcing.atlas.directory", forcing.atlas.directory
        if forcing.from_gauges:
            yield "forcing.from_gauges.table", forcing.from_gauges.table
        if forcing.gauges:
            yield "forcing.gauges", forcing.gauges
    if tide.friction_file:
        yield "tide.friction_file", tide.friction_file
    if adcirc is not None and adcirc.batch_template and tide.engine == "adcirc":
        yield "adcirc.batch_template", adcirc.batch_template
