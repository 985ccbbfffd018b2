"""Checks of arguments."""

from __future__ import annotations

import operator
import os
from typing import Any

import numpy as np


def path(value: Any, name: str) -> str:
    """A path as text.

    Raises:
        TypeError: If it is none.
        ValueError: If it is empty.
    """
    if isinstance(value, (str, os.PathLike)):
        text = os.fspath(value)
        if text == "":
            raise ValueError(f"{name} is an empty path; the current folder is '.'")
        if isinstance(text, str):
            return text
    raise TypeError(f"{name} is a path, not {value!r}")


def optional_path(value: Any, name: str) -> str | None:
    """The same, or None."""
    return None if value is None else path(value, name)


def shard_text(shard: Any) -> str | None:
    """A shard as the command takes it: ``3/10``, ``auto`` or ``auto/10``.

    Raises:
        TypeError: If it is neither text nor a pair of integers.
    """
    if shard is None or isinstance(shard, str):
        return shard
    numbers = [index(number) for number in shard] if isinstance(shard, (tuple, list)) else []
    if len(numbers) != 2 or None in numbers:
        raise TypeError(f"shard is a text such as '3/10' or 'auto', or a pair such as (3, 10), not {shard!r}")
    return f"{numbers[0]}/{numbers[1]}"


def claim_of(claim: Any, lease: Any) -> tuple[int, float] | None:
    """The number of scenes of a claim, and the time of its lease in seconds.

    Raises:
        TypeError: If they are no numbers.
        ValueError: If they are out of range.
    """
    if isinstance(lease, bool) or not isinstance(lease, (int, float, np.integer, np.floating)):
        raise TypeError(f"lease is a time in seconds, not {lease!r}")
    if not 0.001 <= lease <= 86400:
        raise ValueError(f"lease is between 0.001 and 86400 seconds, not {lease}")
    if claim is None or claim is False:
        return None
    return (1 if claim is True else whole(claim, "claim", 1, 2**32 - 1)), float(lease)


def png_path(value: Any) -> str:
    """The path of an image that is written as PNG.

    Raises:
        TypeError: If it is no path.
        ValueError: If it does not end in ``.png``.
    """
    text = path(value, "path")
    if not text.lower().endswith(".png"):
        raise ValueError(f"the image is a PNG file: end its name in .png, not {os.path.basename(text)!r}")
    return text


def index(value: Any) -> int | None:
    """An integer of Python, NumPy or PyTorch; None for anything else, and for truth values."""
    if isinstance(value, (bool, np.bool_)):
        return None
    try:
        return operator.index(value)
    except TypeError:
        return None


def whole(value: Any, name: str, least: int, most: int = 2**63 - 1) -> int:
    """An integer.

    Raises:
        TypeError: If it is not an integer.
        ValueError: If it is out of range.
    """
    number = index(value)
    if number is None:
        raise TypeError(f"{name} is an integer, not {value!r}")
    if not least <= number <= most:
        ends = f"at least {least}" if most == 2**63 - 1 else f"between {least} and {most}"
        raise ValueError(f"{name} is {ends}, not {number}")
    return number
