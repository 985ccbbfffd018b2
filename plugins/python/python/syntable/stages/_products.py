"""Products that stages provide."""

from __future__ import annotations

import operator
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .._syntable import Mask
from ._calls import _Refused

if TYPE_CHECKING:
    from ._arguments import View

_DTYPES = (
    "bool", "uint8", "uint16", "uint32", "uint64", "int8", "int16", "int32", "int64", "float16", "float32", "float64"
)  # fmt: skip
_MEANINGS = ("", "color", "depth", "normal", "label", "mask")


@dataclass(frozen=True)
class Value:
    """A product with one value per view.

    Args:
        type: ``bool``, ``int``, ``float``, ``str``, ``dict`` (with text as keys) or ``list``.
        doc: What it means, in a sentence.
        unit: Its unit, such as ``"m"``.
    """

    type: type
    doc: str = ""
    unit: str = ""

    def __post_init__(self) -> None:
        if self.type not in (bool, int, float, str, dict, list):
            raise TypeError(f"a value is bool, int, float, str, dict or list, not {self.type!r}")

    @property
    def _form(self) -> dict[str, Any]:
        return {"form": self.type.__name__}

    def _checked(self, value: Any, view: View) -> Any:
        return _plain(value, self.type)


@dataclass(frozen=True)
class Image:
    """A product with a value per pixel of the image: an array, height × width (× channels).

    Args:
        dtype: Element type, such as ``"float32"``, ``"uint8"`` or ``"bool"``.
        channels: Number of channels, 1 to 4; None for an array without a channel axis.
        meaning: ``"color"``, ``"depth"``, ``"normal"``, ``"label"`` or ``"mask"``, for writers and viewers.
        doc: What it means, in a sentence.
        unit: Its unit, such as ``"m"``.
    """

    dtype: str
    channels: int | None = None
    meaning: str = ""
    doc: str = ""
    unit: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "dtype", _dtype(self.dtype))
        if self.channels not in (None, 1, 2, 3, 4) or isinstance(self.channels, bool):
            raise ValueError(f"an image has 1 to 4 channels, or None, not {self.channels!r}")
        if self.meaning not in _MEANINGS:
            raise ValueError(f"a meaning is one of {', '.join(_MEANINGS[1:])}, not {self.meaning!r}")

    @property
    def _form(self) -> dict[str, Any]:
        return {
            "form": "image",
            "dtype": self.dtype,
            "channels": self.channels,
            "meaning": self.meaning or "data",
        }

    def _checked(self, value: Any, view: View) -> Any:
        return _array(value, self.dtype, (*view.shape, *(() if self.channels is None else (self.channels,))))


@dataclass(frozen=True)
class Tensor:
    """A product that is an array, and no image.

    Args:
        dtype: Element type, such as ``"float32"``.
        shape: Its shape, with None for an axis of any length; None for any shape.
        doc: What it means, in a sentence.
        unit: Its unit, such as ``"m"``.
    """

    dtype: str
    shape: tuple[int | None, ...] | None = None
    doc: str = ""
    unit: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "dtype", _dtype(self.dtype))

    @property
    def _form(self) -> dict[str, Any]:
        return {"form": "tensor", "dtype": self.dtype}

    def _checked(self, value: Any, view: View) -> Any:
        return _array(value, self.dtype, self.shape)


@dataclass(frozen=True)
class PerObject:
    """A product with a value for each object: a dict from ids, or an array with a row for each of ``view.ids``.

    An object without an entry has no value.

    Args:
        type: ``bool``, ``int``, ``float``, ``str``, ``dict``, ``list``, or ``st.Mask`` for boolean arrays of height ×
            width.
        doc: What it means, in a sentence.
        unit: Its unit, such as ``"m"``.
    """

    type: type
    doc: str = ""
    unit: str = ""

    def __post_init__(self) -> None:
        if self.type not in (bool, int, float, str, dict, list, Mask):
            raise TypeError(
                f"the value of an object is bool, int, float, str, dict, list or st.Mask, not {self.type!r}"
            )

    @property
    def _form(self) -> dict[str, Any]:
        return {"form": f"{self.type.__name__} per object"}

    def _checked(self, value: Any, view: View) -> Any:
        if not isinstance(value, Mapping):
            if isinstance(value, (str, bytes)) or not hasattr(value, "__len__") or len(value) != len(view.ids):
                raise _Refused(
                    f"a dict from ids, or a value for each of the {len(view.ids)} ids, is expected; "
                    f"found {_found(value)}"
                )
            value = dict(zip(view.ids.tolist(), value))
        known = set(view.ids.tolist()) if view._has_ids else None
        checked = {}
        for id, one in value.items():
            number = _index(id)
            if number is None or not 0 < number < 2**16 or (known is not None and number not in known):
                ids = ", ".join(map(str, sorted(known))) if known else "none" if known is not None else "1 to 65535"
                raise _Refused(f"{id!r} is no object of the view; its ids: {ids}")
            try:
                checked[number] = _mask(one, view.shape) if self.type is Mask else _plain(one, self.type)
            except _Refused as refused:
                raise _Refused(f"object {number}: {refused}") from None
        return checked


_Product = Value | Image | Tensor | PerObject


def _dtype(dtype: Any) -> str:
    try:
        name: str = np.dtype(dtype).name
    except TypeError:
        name = str(dtype)
    if name not in _DTYPES:
        raise ValueError(f"an array of a product has one of the types {', '.join(_DTYPES)}, not {dtype!r}")
    return name


def _index(it: Any) -> int | None:
    if isinstance(it, bool):
        return None
    try:
        return operator.index(it)
    except TypeError:
        return None


def _found(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"an array of {value.dtype} with shape {value.shape}"
    if value is None:
        return "None; does the function return its result?"
    text = repr(value)
    return f"{text if len(text) <= 60 else text[:57] + '…'}, a {type(value).__name__}"


def _as_array(value: Any) -> Any:
    """Arrays of NumPy and tensors of PyTorch as arrays; other values as they are."""
    if hasattr(value, "detach"):
        value = value.detach().cpu()
    return np.asarray(value) if hasattr(value, "__array__") and not isinstance(value, Mask) else value


def _plain(value: Any, kind: type) -> Any:
    given = _as_array(value)
    if isinstance(given, np.ndarray):
        value = given.item() if given.ndim == 0 else given.tolist() if kind is list else given
    fits = {
        bool: isinstance(value, bool),
        int: isinstance(value, int) and not isinstance(value, bool),
        float: isinstance(value, (int, float)) and not isinstance(value, bool),
        str: isinstance(value, str),
        dict: isinstance(value, Mapping) and all(isinstance(key, str) for key in value),
        list: isinstance(value, (list, tuple)),
    }
    if not fits[kind]:
        what = "dict with text as keys" if kind is dict else kind.__name__
        raise _Refused(f"{what} is expected; found {_found(value)}")
    if kind is int and not -(2**63) <= value < 2**63:
        raise _Refused(f"an int has 64 bits; found {_found(value)}")
    if not isinstance(given, np.ndarray):
        _check_parts(value)
    return kind(value)


#: How deep the parts of a value may be nested, as in JSON files that are read back.
_DEPTH = 64


def _check_parts(value: Any) -> None:
    """Refuses a value with parts that no file holds."""
    parts = [(value, 1)]
    while parts:
        part, depth = parts.pop()
        if depth > _DEPTH:
            raise _Refused(f"its parts are nested more than {_DEPTH} deep; does it contain itself?")
        if isinstance(part, Mapping):
            parts.extend((one, depth + 1) for pair in part.items() for one in pair)
        elif isinstance(part, (list, tuple)):
            parts.extend((one, depth + 1) for one in part)
        elif isinstance(part, int) and not -(2**63) <= part < 2**64:
            raise _Refused(f"an int has 64 bits; found {_found(part)}")
        elif isinstance(part, str):
            try:
                part.encode()
            except UnicodeEncodeError:
                raise _Refused(f"a text is valid Unicode; found {part!a}") from None


def _array(value: Any, dtype: str, shape: tuple[int | None, ...] | None) -> Any:
    array = _as_array(value)
    sizes = "any shape" if shape is None else "shape (" + ", ".join("any" if n is None else str(n) for n in shape) + ")"
    expected = f"an array of {dtype} with {sizes} is expected"
    if not isinstance(array, np.ndarray):
        raise _Refused(f"{expected}; found {_found(value)}")
    fits = shape is None or (
        array.ndim == len(shape) and all(want is None or want == got for want, got in zip(shape, array.shape))
    )
    if array.dtype.name != dtype or not fits:
        remedy = f"; convert it with .astype({dtype!r})" if fits else ""
        raise _Refused(f"{expected}; found {_found(array)}{remedy}")
    return array


def _mask(value: Any, shape: tuple[int, int]) -> Mask:
    if isinstance(value, Mask):
        if value.shape != shape:
            raise _Refused(f"a mask of shape {shape} is expected; found {value!r}")
        return value
    return Mask(_array(value, "bool", shape))
