"""What travels to the nodes of a cluster: the recipe and all that it needs there."""

from __future__ import annotations

import contextlib
import importlib
import os
import re
import socket
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import ray  # type: ignore[import-not-found, import-untyped, unused-ignore]

from .. import _syntable
from ..__main__ import load
from ..errors import SyntableError
from ..recipes import Recipe

__all__ = ["Job", "Plugin", "Probe", "Unfit", "connect", "options", "place"]

#: Time that a node gets to see a new file of a shared folder, s.
SEEN_AFTER_S = 10.0
#: Part of the name of the file that nodes look for.
MARK = ".ray-"
#: Age from which such a file is a killed driver's, s.
OLD_S = 120.0


class Unfit(SyntableError):
    """A node that cannot work on the dataset, however often it tries."""


@dataclass(frozen=True)
class Plugin:
    """A Python file or module with stages.

    Attributes:
        name: Its path on the driver, or the name of the module.
        text: Its text; None for a module.
    """

    name: str
    text: str | None

    @classmethod
    def of(cls, name: str | os.PathLike[str]) -> Plugin:
        """Reads a file, and loads it here, so that recipes may use its stages.

        Raises:
            TypeError: If it is no path.
            OSError: If the file cannot be read.
        """
        text = os.fspath(name)
        if not isinstance(text, str):
            raise TypeError(f"a plugin is a Python file or a module, not {name!r}")
        is_file = text.endswith(".py") or os.sep in text
        if not is_file:
            importlib.import_module(text)
            return cls(text, None)
        path = os.path.abspath(text)
        with open(path, encoding="utf-8") as file:
            made = cls(path, file.read())
        made.load()
        return made

    def load(self) -> None:
        """Loads it once into this process. A node without the file gets a copy."""
        if self in _LOADED:
            return
        if self.text is None:
            importlib.import_module(self.name)
        else:
            load(self.name if _has_text(self.name, self.text) else self._copied(self.text))
        _LOADED.add(self)

    def _copied(self, text: str) -> str:
        # Errors show lines of the file, so that it stays until the process ends.
        folder = tempfile.TemporaryDirectory(prefix="syntable-")
        _FOLDERS.append(folder)
        path = os.path.join(folder.name, os.path.basename(self.name))
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        return path


#: Plugins of this process, and the folders of those that came as text.
_LOADED: set[Plugin] = set()
_FOLDERS: list[tempfile.TemporaryDirectory[str]] = []


def _has_text(path: str, text: str) -> bool:
    try:
        with open(path, encoding="utf-8") as file:
            return file.read() == text
    except (OSError, UnicodeDecodeError):
        return False


@dataclass(frozen=True)
class Job:
    """A recipe on its way to other nodes.

    A node that has the file of the recipe reads it, so that relative paths mean there what they mean here. Any other
    node gets the resolved recipe, which names no other recipe.

    Attributes:
        name: Name of the recipe in messages.
        path: Its file, absolute; None if it has none.
        text: Its text.
        changes: Changed keys with their values as TOML.
        resolved: The whole recipe as TOML.
        folder: The current folder, from which other relative paths start.
        variables: Environment variables that paths of the recipe name. A value of the node itself counts first.
        plugins: Files and modules with stages.
        version: Version of the package.
    """

    name: str
    path: str | None
    text: str
    changes: tuple[tuple[str, str], ...]
    resolved: str
    folder: str
    variables: dict[str, str]
    plugins: tuple[Plugin, ...]
    version: str

    @classmethod
    def of(cls, recipe: Recipe, plugins: Iterable[str | os.PathLike[str]]) -> Job:
        """The recipe with all that it needs.

        Raises:
            RecipeError: If the recipe has mistakes.
        """
        if isinstance(plugins, (str, os.PathLike)):
            raise TypeError(f"plugins is a list of files and modules, such as [{os.fspath(plugins)!r}]")
        loaded = tuple(map(Plugin.of, plugins))
        resolved = recipe.to_toml()
        _, (name, path, text, changes) = recipe._raw.__reduce__()
        names = set(re.findall(r"\$\{(\w+)\}", resolved))
        return cls(
            name=name,
            path=None if path is None or name.startswith("builtin:") else os.path.abspath(path),
            text=text,
            changes=tuple(changes),
            resolved=resolved,
            folder=os.getcwd(),
            variables={one: os.environ[one] for one in names if one in os.environ},
            plugins=loaded,
            version=_syntable.__version__,
        )

    @contextlib.contextmanager
    def at_node(self) -> Iterator[Recipe]:
        """The recipe on this node, in the folder from which its relative paths start.

        Raises:
            Unfit: If the node has another version of the package.
            RecipeError: If the recipe has mistakes on this node, such as missing assets.
        """
        if _syntable.__version__ != self.version:
            raise Unfit(
                f"{place()} has syntable {_syntable.__version__}, and the driver has {self.version}: "
                "install the same version on every node"
            )
        for name, value in self.variables.items():
            os.environ.setdefault(name, value)
        for plugin in self.plugins:
            plugin.load()
        before = os.getcwd()
        # A working folder of the runtime environment replaces the driver's.
        is_given = bool((ray.get_runtime_context().runtime_env or {}).get("working_dir"))
        if not is_given and os.path.isdir(self.folder):
            os.chdir(self.folder)
        try:
            yield self._recipe()
        finally:
            os.chdir(before)

    def _recipe(self) -> Recipe:
        changes = list(self.changes)
        with contextlib.suppress(SyntableError, OSError):
            if self.path is None or _has_text(self.path, self.text):
                recipe = Recipe._of(_syntable.Recipe.of_parts(self.name, self.path, self.text, changes))
                if recipe.to_toml() == self.resolved:
                    return recipe
        return Recipe._of(_syntable.Recipe.of_parts(self.name, self.path, self.resolved, []))


@dataclass(frozen=True)
class Probe:
    """A new file beside a dataset, which other nodes must see if they share its folder.

    Attributes:
        out: Folder of the dataset.
        path: Path of the file; None for an object store, which all nodes share.
    """

    out: str
    path: str | None

    @classmethod
    def new(cls, out: str) -> Probe:
        """Writes the file.

        Raises:
            SyntableError: If it cannot be written.
        """
        if _syntable.is_url(out):
            return cls(out, None)
        folder, name = os.path.split(out)
        # A disk that is mounted there is another than that of the folder above.
        place = out if os.path.ismount(out) else folder
        try:
            os.makedirs(place, exist_ok=True)
            handle, path = tempfile.mkstemp(prefix=f".{name}{MARK}", dir=place)
        except OSError as error:
            raise SyntableError(f"{place}: {error.strerror}", file=place, temporary=True) from error
        os.close(handle)
        return cls(out, path)

    def check(self) -> None:
        """Looks for the file from another node.

        Raises:
            Unfit: If the node does not see it.
        """
        end = time.monotonic() + SEEN_AFTER_S
        while self.path is not None and not os.path.exists(self.path):
            if time.monotonic() > end:
                raise Unfit(
                    f"{self.out}: {place()} does not share this folder with the driver (name a folder that all nodes "
                    'share, or a URL such as "s3://bucket/mine")',
                    file=self.out,
                )
            time.sleep(0.2)

    def touch(self) -> None:
        """Shows that the driver lives."""
        if self.path is not None:
            with contextlib.suppress(OSError):
                # Another driver may have deleted it while this one slept.
                open(self.path, "ab").close()
                os.utime(self.path)

    def delete(self) -> None:
        """Deletes the file, and those of drivers that were killed."""
        if self.path is None:
            return
        self.touch()
        folder, name = os.path.split(self.path)
        prefix = name[: name.rindex(MARK)] + MARK
        with contextlib.suppress(OSError):
            # By the clock of the file system, whatever those of the machines show.
            now = os.stat(self.path).st_mtime
            os.unlink(self.path)
            for other in os.listdir(folder):
                path = os.path.join(folder, other)
                if other.startswith(prefix) and now - os.stat(path).st_mtime > OLD_S:
                    os.unlink(path)


def place() -> str:
    """This node, in words."""
    return f"node {socket.gethostname()} ({ray.util.get_node_ip_address()})"


def connect(runtime_env: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Connects the program with its cluster. Returns the environment that tasks still need."""
    env = None if runtime_env is None else dict(runtime_env)
    if ray.is_initialized():
        return env
    ray.init(runtime_env=env)
    return None


def options(threads: int, gpus: float, runtime_env: dict[str, Any] | None, **more: Any) -> dict[str, Any]:
    """Options of a Ray task."""
    found: dict[str, Any] = {"num_cpus": threads, **more}
    if gpus:
        found["num_gpus"] = gpus
    if runtime_env is not None:
        found["runtime_env"] = dict(runtime_env)
    return found
