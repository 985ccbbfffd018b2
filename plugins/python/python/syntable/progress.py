"""Progress of long work: a line in a terminal or a notebook, and warnings as Python's."""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable
from typing import Any, Union


__all__ = ["Event", "Progress", "SyntableWarning"]

Event = dict[str, Any]
"""An event of a run, as `syntable run --log-format json` prints it: ``event`` is its kind."""

Progress = Union[bool, None, Callable[[Event], None]]
"""True shows progress, False shows none, None shows it if standard error is a terminal or the code runs in a notebook.
A function receives every event instead."""


class SyntableWarning(UserWarning):
    """Something that did not stop the work: a bad asset, a probable mistake in a recipe."""


def listener(progress: Progress) -> Callable[[Event], None]:
    """The function that receives events.

    Raises:
        TypeError: If ``progress`` is neither a truth value nor a function.
    """
    if callable(progress):
        return progress
    if progress not in (True, False, None):
        raise TypeError(f"progress is True, False, None or a function of an event, not {progress!r}")
    shown = progress if progress is not None else (_in_notebook() or sys.stderr.isatty())
    return _Line() if shown else _warn


def _in_notebook() -> bool:
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return shell is not None and "IPKernelApp" in getattr(shell, "config", {})


def _warn(event: Event) -> None:
    """Passes warnings, errors and failed scenes on, and nothing else."""
    if event["event"] == "message":
        warn(event.get("rendered") or _text(event))
    elif event["event"] == "attempt" and event["last"]:
        warn(f"scene {event['scene']} failed: {event['error']}")


def warn(text: str) -> None:
    """Warns the caller of the package."""
    warnings.warn(text.rstrip(), SyntableWarning, stacklevel=_outside())


def _text(event: Event) -> str:
    help = event.get("help")
    notes = "; ".join(help) if isinstance(help, list) else help
    return f"{event.get('message', '')} ({notes})" if notes else str(event.get("message", ""))


def _outside() -> int:
    """Number of frames up to the first that is not of this package."""
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").split(".")[0] == __package__.split(".")[0]:
        frame, level = frame.f_back, level + 1
    return level


#: Parts that one warning names.
_NAMED = 3


def warn_left_out(texts: list[str]) -> None:
    """Warns the caller of the package that data are left out, if any are."""
    if texts:
        more = f"; {len(texts) - _NAMED} more are in `left_out`" if len(texts) > _NAMED else ""
        warn(f"left out: {'; '.join(texts[:_NAMED])}{more}")


class _Line:
    """One line that is written over and over."""

    WIDTH = 24
    INTERVAL_S = 0.1

    def __init__(self) -> None:
        self.all = 0
        self.made = 0
        self.start = time.monotonic()
        self.latest = 0.0
        self.step = ""

    def __call__(self, event: Event) -> None:
        kind = event["event"]
        if kind == "started":
            self.all, self.start = event["images"], time.monotonic()
        elif kind == "image":
            self.made, self.step = self.made + 1, ""
        elif kind == "working":
            self.step = event["step"]
        elif kind in ("message", "attempt"):
            self._clear()
            _warn(event)
        elif kind == "note":
            self._clear()
            sys.stderr.write(event["message"] + "\n")
        elif kind == "finished":
            self._show()
            sys.stderr.write("\n")
            sys.stderr.flush()
            return
        if time.monotonic() - self.latest > self.INTERVAL_S:
            self._show()

    def _clear(self) -> None:
        sys.stderr.write("\r" + " " * 79 + "\r")

    def _show(self) -> None:
        self.latest = time.monotonic()
        seconds = self.latest - self.start
        if self.all:
            full = self.WIDTH * self.made // self.all
            bar = "█" * full + "░" * (self.WIDTH - full)
            left = seconds / self.made * (self.all - self.made) if self.made else 0.0
            rest = f", {left:.0f} s left" if self.made else ""
            text = f"{bar} {self.made} of {self.all} images, {seconds:.0f} s{rest}"
        else:
            text = f"{self.made} images, {seconds:.0f} s"
        text += f"  {self.step}" if self.step else ""
        sys.stderr.write("\r" + text[:79].ljust(79))
        sys.stderr.flush()
