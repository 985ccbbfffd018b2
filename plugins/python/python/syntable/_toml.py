"""Python values as TOML."""

from __future__ import annotations

import datetime
import math
import os
import re
from collections.abc import Mapping
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+\Z")
_ESCAPES = {'"': '\\"', "\\": "\\\\", "\b": "\\b", "\t": "\\t", "\n": "\\n", "\f": "\\f", "\r": "\\r"}


def value(it: Any, place: str = "") -> str:
    """A value as TOML on one line.

    Args:
        it: None-free nesting of bool, int, float, str, path, date, list, tuple, dict, and NumPy's numbers and arrays.
        place: Its key, for errors.
    """
    if hasattr(it, "tolist") and not isinstance(it, (list, tuple)):
        it = it.tolist()
    if isinstance(it, bool):
        return "true" if it else "false"
    if isinstance(it, int):
        return str(it)
    if isinstance(it, float):
        return repr(it) if math.isfinite(it) else ("nan" if math.isnan(it) else "inf" if it > 0 else "-inf")
    if isinstance(it, str):
        return text(it)
    if isinstance(it, os.PathLike):
        return text(os.fspath(it))
    if isinstance(it, (datetime.datetime, datetime.date, datetime.time)):
        return it.isoformat()
    if isinstance(it, Mapping):
        fields = (f"{key(name)} = {value(field, _inside(place, name))}" for name, field in it.items())
        inner = ", ".join(fields)
        return f"{{ {inner} }}" if inner else "{}"
    if isinstance(it, (list, tuple, range)):
        return "[" + ", ".join(value(one, f"{place}[{index}]") for index, one in enumerate(it)) + "]"
    at = f"{place}: " if place else ""
    if it is None:
        raise TypeError(f"{at}TOML has no None; leave the key out")
    raise TypeError(f"{at}a recipe cannot hold a {type(it).__name__}: {it!r}")


def text(it: str) -> str:
    """Text as a TOML string."""
    escaped = "".join(
        _ESCAPES.get(char) or (f"\\u{ord(char):04X}" if ord(char) < 32 or ord(char) == 127 else char) for char in it
    )
    return f'"{escaped}"'


def key(it: Any) -> str:
    """A key, in quotes if necessary."""
    if not isinstance(it, str):
        raise TypeError(f"a key of a recipe is text, not {it!r}")
    return it if _BARE.match(it) else text(it)


def document(it: Mapping[str, Any]) -> str:
    """A dict as a TOML document, with tables under headers, for people to read."""
    lines: list[str] = []
    _table(it, (), lines)
    return "\n".join(lines).strip() + "\n"


def _table(it: Mapping[str, Any], path: tuple[str, ...], lines: list[str]) -> None:
    tables = {name: one for name, one in it.items() if isinstance(one, Mapping) or _is_tables(one)}
    plain = {name: one for name, one in it.items() if name not in tables}
    for name, one in plain.items():
        lines.append(f"{key(name)} = {value(one, '.'.join((*path, str(name))))}")
    for name, one in tables.items():
        header = ".".join(key(part) for part in (*path, name))
        for table in one if _is_tables(one) else [one]:
            lines.append("")
            lines.append(f"[[{header}]]" if _is_tables(one) else f"[{header}]")
            _table(table, (*path, name), lines)


def _is_tables(it: Any) -> bool:
    return isinstance(it, (list, tuple)) and len(it) > 0 and all(isinstance(one, Mapping) for one in it)


def _inside(place: str, name: Any) -> str:
    return f"{place}.{name}" if place else str(name)
