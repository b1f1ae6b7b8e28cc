"""Write docs/case.md: every key of a case file, from the settings in the code."""

from __future__ import annotations

import ast
import inspect
import json
import sys
import textwrap
from pathlib import Path

import msgspec

from tidemesh.pipeline.case import Case

OUTPUT = Path(__file__).with_name("case.md")


def main() -> str:
    """The page as text."""
    lines = [
        "# The case file",
        "",
        "Every key, its kind and default. Made from the code by",
        "`docs/make_case_reference.py`; `tidemesh init` writes a commented case.",
    ]
    for name, kind, default in _fields(Case):
        structs = list(_structs(kind))
        if not structs:
            lines += ["", f"`{name}`: {_kind(kind)}, default {_default(default)}."]
            continue
        lines += ["", f"## [{name}]"]
        for struct in structs:
            lines += _table(struct, name)
    return "\n".join(lines) + "\n"


def _table(struct: type, section: str) -> list[str]:
    words = _docstrings(struct)
    lines = ["", inspect.getdoc(struct).splitlines()[0], ""]
    lines += ["| key | kind | default | |", "| --- | --- | --- | --- |"]
    tag = struct.__struct_config__.tag
    if tag:
        field = struct.__struct_config__.tag_field
        lines.append(f'| `{field}` | `"{tag}"` | required | |')
    inner = []
    for name, kind, default in _fields(struct):
        shown = _default(default)
        text = words.get(name, "").replace("|", "\\|")
        lines.append(f"| `{name}` | {_kind(kind)} | {shown} | {text} |")
        inner += [(one, f"{section}.{name}") for one in _structs(kind)]
    for one, where in inner:
        tag = one.__struct_config__.tag
        title = f'### {where}, kind = "{tag}"' if tag else f"### {where}"
        lines += ["", title, *_table(one, where)]
    return lines


def _default(value: object) -> str:
    if value is msgspec.NODEFAULT:
        return "required"
    if value is None:
        return ""
    return f"`{json.dumps(value)}`"


def _fields(struct: type):
    for field in msgspec.structs.fields(struct):
        default = field.default
        if field.default_factory is not msgspec.NODEFAULT:
            default = field.default_factory()
        yield field.encode_name, msgspec.inspect.type_info(field.type), default


def _structs(kind):
    if isinstance(kind, msgspec.inspect.StructType):
        yield kind.cls
    for name in ("types", "item_types"):
        for one in getattr(kind, name, ()):
            yield from _structs(one)
    if getattr(kind, "item_type", None) is not None:
        yield from _structs(kind.item_type)


def _kind(kind) -> str:
    if isinstance(kind, msgspec.inspect.Metadata):
        return _kind(kind.type)
    if isinstance(kind, msgspec.inspect.LiteralType):
        return " or ".join(f'`"{value}"`' for value in kind.values)
    if isinstance(kind, msgspec.inspect.UnionType):
        words = [_kind(one) for one in kind.types]
        return " or ".join(dict.fromkeys(word for word in words if word != "none"))
    if isinstance(kind, msgspec.inspect.StructType):
        return "table"
    if isinstance(kind, msgspec.inspect.TupleType):
        return f"array of {len(kind.item_types)}"
    if getattr(kind, "item_type", None) is not None:
        return "array"
    names = {"IntType": "integer", "StrType": "string", "BoolType": "boolean"}
    name = type(kind).__name__
    word = names.get(name, name.removesuffix("Type").lower())
    bounds = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}
    limits = [
        f"{sign} {getattr(kind, bound):g}"
        for bound, sign in bounds.items()
        if getattr(kind, bound, None) is not None
    ]
    return " ".join([word, ", ".join(limits)]).strip()


def _docstrings(struct: type) -> dict[str, str]:
    """The string below each field in the source."""
    found: dict[str, str] = {}
    for base in reversed(struct.__mro__):
        if not issubclass(base, msgspec.Struct) or base is msgspec.Struct:
            continue
        tree = ast.parse(textwrap.dedent(inspect.getsource(base))).body[0]
        for field, text in zip(tree.body, tree.body[1:]):
            if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr):
                found[field.target.id] = " ".join(ast.literal_eval(text.value).split())
    return found


if __name__ == "__main__":
    OUTPUT.write_text(main(), encoding="utf-8")
    sys.stdout.write(f"wrote {OUTPUT.name}\n")
