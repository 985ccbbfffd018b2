"""Checks of arguments."""

from __future__ import annotations

import os
from typing import Any


def path(value: Any, name: str) -> str:
    """A path as text.

    Raises:
        TypeError: If it is none.
    """
    if isinstance(value, (str, os.PathLike)):
        text = os.fspath(value)
        if isinstance(text, str):
            return text
    raise TypeError(f"{name} is a path, not {value!r}")


def optional_path(value: Any, name: str) -> str | None:
    """The same, or None."""
    return None if value is None else path(value, name)


def whole(value: Any, name: str, least: int, most: int = 2**63 - 1) -> int:
    """An integer.

    Raises:
        TypeError: If it is not an integer.
        ValueError: If it is out of range.
    """
    if isinstance(value, bool) or not hasattr(value, "__index__"):
        raise TypeError(f"{name} is an integer, not {value!r}")
    number = int(value.__index__())
    if not least <= number <= most:
        ends = f"at least {least}" if most == 2**63 - 1 else f"between {least} and {most}"
        raise ValueError(f"{name} is {ends}, not {number}")
    return number
