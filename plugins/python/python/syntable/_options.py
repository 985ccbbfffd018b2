"""Options of stages: a dataclass as a JSON Schema, and tables of recipes as its instances."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import math
import re
import textwrap
import types
import typing
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from . import _toml

__all__ = ["ObjectPool", "OptionError", "Options", "Range"]


class OptionError(Exception):
    """Options that a stage refuses."""


@dataclass(frozen=True)
class Range:
    """Limits of an option, both included: ``Annotated[float, st.Range(0, 1)]``.

    Attributes:
        low: The least value; None for no limit.
        high: The greatest value; None for no limit.
    """

    low: float | None = None
    high: float | None = None

    def __post_init__(self) -> None:
        for limit in (self.low, self.high):
            if limit is not None and (isinstance(limit, bool) or not isinstance(limit, (int, float))):
                raise TypeError(f"a limit is a number, not {limit!r}")
        if self.low is not None and self.high is not None and not self.low <= self.high:
            raise ValueError(f"no number is between {self.low} and {self.high}")


@dataclass(frozen=True)
class _Reference:
    """A text that names a part of the recipe."""

    what: str


ObjectPool = Annotated[str, _Reference("pool:object")]
"""Name of a pool of objects: the type of an option that names an ``[assets.NAME]`` table."""


class Options:
    """The options of a kind.

    Args:
        cls: A dataclass, or None for a kind without options.
        description: The description of the kind.

    Raises:
        TypeError: If it is no dataclass, or a field has a type or default that no recipe can hold.
    """

    def __init__(self, cls: type | None, description: str) -> None:
        if cls is not None and not (isinstance(cls, type) and dataclasses.is_dataclass(cls)):
            raise TypeError(f"options is a dataclass, such as `@dataclass class Options: …`, not {cls!r}")
        self.cls = cls
        self.schema: dict[str, Any] = {"type": "object", "additionalProperties": False, "properties": {}}
        if cls is not None:
            self.schema = _of_dataclass(cls, ())
        self.schema["description"] = description

    def make(self, given: Mapping[str, Any]) -> tuple[Any, str]:
        """The instance for the table of a recipe, and all options as TOML.

        Raises:
            OptionError: If the class refuses them.
        """
        if self.cls is None:
            return None, ""
        made = _made(self.cls, given)
        return made, _toml.document(_dumped(made))


def _of_dataclass(cls: type, above: tuple[type, ...]) -> dict[str, Any]:
    if cls in above:
        raise TypeError(f"{cls.__name__} contains itself, which no table of options can")
    try:
        hints = typing.get_type_hints(cls, include_extras=True)
    except NameError as error:
        raise TypeError(
            f"the types of {cls.__name__} cannot be found: {error}; define it outside of functions"
        ) from None
    docs, properties, required = _docs(cls), {}, []
    for field in _fields(cls):
        place = f"{cls.__name__}.{field.name}"
        schema = _of_type(hints[field.name], place, (*above, cls))
        doc = field.metadata.get("doc") or schema.get("description") or docs.get(field.name)
        if doc is not None:
            schema["description"] = inspect.cleandoc(doc)
        limits = field.metadata.get("range")
        if limits is not None:
            _limit(schema, limits, place)
        default = _default(field)
        if default is dataclasses.MISSING:
            if not _is_optional(hints[field.name]):
                required.append(field.name)
        elif default is not None:
            schema["default"] = _dump(default, place)
        properties[field.name] = schema
    schema = {"type": "object", "additionalProperties": False, "properties": properties}
    if required:
        schema["required"] = required
    return schema


def _fields(cls: type) -> list[dataclasses.Field[Any]]:
    return [field for field in dataclasses.fields(cls) if field.init]


def _default(field: dataclasses.Field[Any]) -> Any:
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return field.default


def _split(hint: Any) -> tuple[Any, tuple[Any, ...], bool]:
    """A type without `Annotated` and `Optional`: the type, its annotations, and whether it is optional."""
    notes: tuple[Any, ...] = ()
    optional = False
    while True:
        if typing.get_origin(hint) is typing.Annotated:
            hint, *more = typing.get_args(hint)
            notes += tuple(more)
        elif typing.get_origin(hint) in (typing.Union, types.UnionType):
            parts = [part for part in typing.get_args(hint) if part is not type(None)]
            if len(parts) != 1:
                return hint, notes, optional
            hint, optional = parts[0], True
        else:
            return hint, notes, optional


def _is_optional(hint: Any) -> bool:
    return _split(hint)[2]


_PLAIN = {bool: "boolean", int: "integer", float: "number", str: "string"}


def _of_type(hint: Any, place: str, above: tuple[type, ...]) -> dict[str, Any]:
    bare, notes, _ = _split(hint)
    schema = _of_bare(bare, place, above)
    for note in notes:
        if isinstance(note, str):
            schema["description"] = note
        elif isinstance(note, Range):
            _limit(schema, note, place)
        elif isinstance(note, _Reference):
            schema["x-syntable-ref"] = note.what
    return schema


def _of_bare(hint: Any, place: str, above: tuple[type, ...]) -> dict[str, Any]:
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if hint in _PLAIN:
        return {"type": _PLAIN[hint]}
    if origin is typing.Literal and all(isinstance(word, str) for word in parts):
        return {"type": "string", "enum": list(parts)}
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return _of_dataclass(hint, above)
    if hint in (list, tuple):
        return {"type": "array"}
    if origin is list and len(parts) == 1:
        return {"type": "array", "items": _of_type(parts[0], f"{place}[]", above)}
    if origin is tuple and len(parts) == 2 and parts[1] is Ellipsis:
        return {"type": "array", "items": _of_type(parts[0], f"{place}[]", above)}
    if origin is tuple and parts:
        items = [_of_type(part, f"{place}[]", above) for part in parts]
        same = all(item == items[0] for item in items)
        length = {"minItems": len(items), "maxItems": len(items)}
        return {"type": "array", "items": items[0] if same else items, **length}
    if hint is dict:
        return {"type": "object", "additionalProperties": True}
    if origin is dict and parts[0] is str:
        return {"type": "object", "additionalProperties": _of_type(parts[1], f"{place}[]", above)}
    raise TypeError(
        f"{place}: a recipe has no {_name(hint)}; use bool, int, float, str, Literal of words, list, tuple, dict, "
        "Optional or a dataclass"
    )


def _name(hint: Any) -> str:
    return hint.__name__ if isinstance(hint, type) else str(hint)


def _limit(schema: dict[str, Any], limits: Any, place: str) -> None:
    if not isinstance(limits, Range):
        raise TypeError(f"{place}: limits are st.Range(low, high), not {limits!r}")
    target = schema
    while target.get("type") == "array" and isinstance(target.get("items"), dict):
        target = target["items"]
    if target.get("type") not in ("integer", "number"):
        raise TypeError(f"{place}: only numbers have limits")
    for keyword, limit in (("minimum", limits.low), ("maximum", limits.high)):
        if limit is not None:
            target[keyword] = limit


def _made(cls: type, given: Mapping[str, Any]) -> Any:
    hints = typing.get_type_hints(cls, include_extras=True)
    fields = {field.name: field for field in _fields(cls)}
    values = {name: _read(hints[name], value) for name, value in given.items()}
    for name, field in fields.items():
        if name not in values and _default(field) is dataclasses.MISSING and _is_optional(hints[name]):
            values[name] = None
    try:
        return cls(**values)
    except (TypeError, ValueError) as error:
        raise OptionError(str(error)) from error


def _read(hint: Any, value: Any) -> Any:
    """A value of a recipe as a field has it."""
    hint, _, _ = _split(hint)
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if hint is float:
        return float(value)
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return _made(hint, value)
    if hint is tuple:
        return tuple(value)
    if origin is list:
        return [_read(parts[0], one) for one in value]
    if origin is tuple:
        kinds = [parts[0]] * len(value) if len(parts) == 2 and parts[1] is Ellipsis else parts
        return tuple(_read(kind, one) for kind, one in zip(kinds, value))
    if origin is dict:
        return {key: _read(parts[1], one) for key, one in value.items()}
    return value


def _dumped(made: Any) -> dict[str, Any]:
    """The fields of a dataclass, without those that are None."""
    values = {field.name: getattr(made, field.name) for field in _fields(type(made))}
    return {name: _dump(value, name) for name, value in values.items() if value is not None}


def _dump(value: Any, place: str) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return _dumped(value)
    if isinstance(value, (list, tuple)):
        return [_dump(one, place) for one in value]
    if isinstance(value, Mapping):
        return {str(key): _dump(one, place) for key, one in value.items()}
    if isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        if not math.isfinite(value):
            raise TypeError(f"{place}: {value} is not finite, so no option can have it")
        return value
    raise TypeError(f"{place}: a recipe cannot hold {value!r}, a {type(value).__name__}")


def _docs(cls: type) -> dict[str, str]:
    """Descriptions of fields: strings below them, or lines of the section `Attributes:` in the class's docstring."""
    docs: dict[str, str] = {}
    for one in reversed(cls.__mro__):
        if dataclasses.is_dataclass(one):
            docs.update(_section(one.__dict__.get("__doc__") or ""))
            docs.update(_strings_below(one))
    return docs


def _strings_below(cls: type) -> dict[str, str]:
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(cls)))
    except (OSError, TypeError, SyntaxError):
        # The source is unknown, as in an interactive session.
        return {}
    body = tree.body[0].body if tree.body and isinstance(tree.body[0], ast.ClassDef) else []
    found = {}
    for field, below in zip(body, body[1:]):
        if (
            isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and isinstance(below, ast.Expr)
            and isinstance(below.value, ast.Constant)
            and isinstance(below.value.value, str)
        ):
            found[field.target.id] = below.value.value
    return found


def _section(doc: str) -> dict[str, str]:
    _, _, section = inspect.cleandoc(doc).partition("Attributes:\n")
    entries = re.findall(r"^    (\w+)[^:\n]*: (.+(?:\n {8,}.+)*)", section.split("\n\n")[0], re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in entries}
