"""The command ``syntable``, and ``python -m syntable``."""

from __future__ import annotations

import importlib
import importlib.util
import os
import signal
import sys
import traceback
from collections.abc import Iterator, Sequence

from . import _syntable

#: The option that names a Python file or module with stages.
PLUGIN = "--plugin"


def main() -> int:
    """Runs the command line of this process. Returns the exit code."""
    # The library handles signals itself, as the program does.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    code = _load_all(sys.argv[1:])
    if code == 0:
        code = _syntable.main(["syntable", *sys.argv[1:]])
    sys.stdout.flush()
    sys.stderr.flush()
    # Nothing of Python is left to do.
    os._exit(code)


def _load_all(arguments: Sequence[str]) -> int:
    """Loads the plugins of a command line. Returns the exit code: 0 if all are here."""
    for plugin in _plugins(arguments):
        try:
            load(plugin)
        except BaseException as error:
            _print(plugin, error)
            return 2
    return 0


def _plugins(arguments: Sequence[str]) -> Iterator[str]:
    """The values of the option. The library checks the rest of the command line."""
    rest = iter(arguments)
    for argument in rest:
        if argument == "--":
            return
        if argument == PLUGIN:
            yield from (value for value in [next(rest, None)] if value is not None)
        elif argument.startswith(f"{PLUGIN}="):
            yield argument.partition("=")[2]


def load(plugin: str) -> None:
    """Runs a Python file, or imports a module: its stages register themselves."""
    is_file = plugin.endswith(".py") or os.sep in plugin or os.path.isfile(plugin)
    if not is_file:
        # As `python -m` does.
        sys.path.insert(0, os.getcwd())
        importlib.import_module(plugin)
        return
    path = os.path.abspath(plugin)
    if not os.path.isfile(path):
        raise FileNotFoundError(f"no such file: {plugin}")
    stem = os.path.splitext(os.path.basename(path))[0]
    # A file named as a module that is loaded or part of Python does not replace it.
    is_taken = stem in sys.modules or stem in sys.stdlib_module_names
    name = f"{stem}_plugin" if is_taken else stem
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{plugin} is no Python file: its name ends in .py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    # Modules next to the file can be imported.
    sys.path.append(os.path.dirname(path))
    spec.loader.exec_module(module)


def _print(plugin: str, error: BaseException) -> None:
    """Prints the traceback of a plugin, from its own first line."""
    trace = error.__traceback__
    own = {__file__, importlib.__file__, "<frozen importlib._bootstrap>", "<frozen importlib._bootstrap_external>"}
    while trace is not None and trace.tb_frame.f_code.co_filename in own:
        trace = trace.tb_next
    text = "".join(traceback.format_exception(type(error), error, trace)).rstrip()
    print(f"error: {PLUGIN} {plugin} cannot be loaded\n{text}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
