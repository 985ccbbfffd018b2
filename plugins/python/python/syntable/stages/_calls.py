"""Calls of stages by the library, and the exceptions of stages."""

from __future__ import annotations

import ctypes
import inspect
import os
import threading
import traceback
import types
from collections.abc import Callable
from typing import Any

from .._options import OptionError


class Unlucky(Exception):
    """For stages to raise: other random numbers may avoid the fault, so the scene is tried again.

    Every other exception ends the run.
    """


class _Refused(Exception):
    """A returned value that does not fit its declaration."""

    def __init__(self, message: str, function: Any = None) -> None:
        super().__init__(message)
        code = getattr(inspect.unwrap(function), "__code__", None) if function is not None else None
        self.file = None if code is None else code.co_filename
        self.line = None if code is None else code.co_firstlineno


#: The threads that run stages now.
_RUNNING: set[int] = set()


def _call(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function that the library calls, which Ctrl-C can end."""

    def call(*arguments: Any) -> Any:
        thread = threading.get_ident()
        _RUNNING.add(thread)
        try:
            return function(*arguments)
        finally:
            _RUNNING.discard(thread)

    return call


def _interrupt() -> None:
    """Raises KeyboardInterrupt in all stages that run now."""
    for thread in list(_RUNNING):
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(KeyboardInterrupt))


_PACKAGE = os.path.dirname(os.path.dirname(__file__)) + os.sep
_FRAMES = 5


def _explained(
    error: BaseException, trace: types.TracebackType | None
) -> tuple[str, str | None, int | None, str | None, bool]:
    """Message, file, line and remedy of an exception in a stage, and whether other random numbers may avoid it."""
    if isinstance(error, OptionError):
        return str(error), None, None, None, False
    if isinstance(error, _Refused):
        return str(error), error.file, error.line, None, False
    frames = [frame for frame in traceback.extract_tb(trace) if not frame.filename.startswith(_PACKAGE)]
    last = frames[-1] if frames else None
    file, line = (last.filename, last.lineno) if last else (None, None)
    if isinstance(error, Unlucky):
        return str(error), file, line, None, True
    text = "".join(traceback.format_exception_only(type(error), error)).strip()
    shown = "".join(traceback.format_list(frames[-_FRAMES:])).rstrip()
    return (f"{text}\n{shown}" if shown else text), file, line, None, False
