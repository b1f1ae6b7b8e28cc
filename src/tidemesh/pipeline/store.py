"""Stage results on disk, without loss: what a later run resumes from."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np

from tidemesh import datatypes
from tidemesh.geometry.projection import Projection
from tidemesh.io.files import atomic

_TYPES = {
    name: getattr(datatypes, name) for name in datatypes.__all__ if name[0].isupper()
}
_TYPES = {name: kind for name, kind in _TYPES.items() if isinstance(kind, type)}
_TYPES["Projection"] = Projection


def save(path: str | Path, value: Any) -> None:
    """Write data types, arrays, and plain containers of them to one .npz file.

    The bytes depend on the value alone.
    """
    arrays: dict[str, np.ndarray] = {}
    tree = _pack(value, arrays)
    text = json.dumps(tree, allow_nan=True).encode()
    with atomic(path) as temporary, open(temporary, "wb") as file:
        np.savez(file, tree=np.frombuffer(text, dtype=np.uint8), **arrays)


def load(path: str | Path) -> Any:
    """Read what `save` wrote."""
    with np.load(path, allow_pickle=False) as stored:
        tree = json.loads(stored["tree"].tobytes().decode())
        return _unpack(tree, stored)


def _pack(value: Any, arrays: dict[str, np.ndarray]) -> Any:
    if isinstance(value, np.ndarray):
        name = f"a{len(arrays)}"
        arrays[name] = value
        return {"array": name}
    if isinstance(value, np.generic):
        return value.item()
    if dataclasses.is_dataclass(value):
        fields = {
            f.name: _pack(getattr(value, f.name), arrays)
            for f in dataclasses.fields(value)
        }
        return {"type": type(value).__name__, "fields": fields}
    if isinstance(value, tuple):
        return {"tuple": [_pack(v, arrays) for v in value]}
    if isinstance(value, list):
        return [_pack(v, arrays) for v in value]
    if isinstance(value, dict):
        return {"dict": {str(k): _pack(v, arrays) for k, v in value.items()}}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise TypeError(f"cannot store a {type(value).__name__}")


def _unpack(tree: Any, stored: Any) -> Any:
    if isinstance(tree, list):
        return [_unpack(v, stored) for v in tree]
    if not isinstance(tree, dict):
        return tree
    if "array" in tree:
        return stored[tree["array"]]
    if "tuple" in tree:
        return tuple(_unpack(v, stored) for v in tree["tuple"])
    if "dict" in tree:
        return {k: _unpack(v, stored) for k, v in tree["dict"].items()}
    fields = {k: _unpack(v, stored) for k, v in tree["fields"].items()}
    return _TYPES[tree["type"]](**fields)
