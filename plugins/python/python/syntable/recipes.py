"""Recipes: what a dataset contains, and how it is made."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, overload

from . import _arguments, _syntable, _toml
from .errors import Diagnostic

__all__ = ["Recipe", "recipe", "recipes"]


class Recipe:
    """A recipe, from a file or from Python values. It never changes: `set` returns another recipe.

    Args:
        path: A TOML file, or ``builtin:NAME`` for a recipe of the package. It is read once, here.

    Raises:
        SyntableError: If the file cannot be read. Mistakes in the text are found by `check`, and by whatever uses
            the recipe.

    ``str(recipe)`` is the whole recipe as TOML: with everything that it extends, all changes and all defaults.
    """

    __slots__ = ("_raw",)

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._raw = _syntable.Recipe.read(_arguments.path(path, "path"))

    @classmethod
    def _of(cls, raw: _syntable.Recipe) -> Recipe:
        made = cls.__new__(cls)
        made._raw = raw
        return made

    @classmethod
    def from_dict(cls, tables: Mapping[str, Any], *, name: str = "recipe") -> Recipe:
        """A recipe from dicts and lists, as a TOML parser returns them.

        Args:
            tables: The recipe. ``{"extends": "builtin:quickstart", "dataset": {"scenes": 3}}`` changes a built-in
                recipe.
            name: Its name in messages. Relative paths start from the current folder.

        Raises:
            TypeError: If a value has no form in TOML.
        """
        return cls.from_toml(_toml.document(tables), name=name)

    @classmethod
    def from_toml(cls, text: str, *, name: str = "recipe") -> Recipe:
        """A recipe from TOML text. Relative paths start from the current folder."""
        return cls._of(_syntable.Recipe.of_text(name, text))

    @overload
    def set(self, key: str, value: Any, /) -> Recipe: ...
    @overload
    def set(self, keys: Mapping[str, Any], /) -> Recipe: ...
    def set(self, key: str | Mapping[str, Any], *value: Any) -> Recipe:
        """The same recipe with a key set, or with several: ``set("dataset.scenes", 3)``, ``set({"dataset.scenes": 3})``.

        Args:
            key: Path of the key, such as ``dataset.scenes`` or ``place[2].count``; or a dict from keys to values.
            value: A Python value; dicts become tables.

        Raises:
            TypeError: If a value has no form in TOML.
        """
        if isinstance(key, Mapping):
            if value:
                raise TypeError("set takes a key and a value, or a dict of them")
            changes = dict(key)
        elif len(value) == 1:
            changes = {key: value[0]}
        else:
            raise TypeError(f"set takes a key and a value, or a dict of them: set({key!r}, value)")
        raw = self._raw
        for name, one in changes.items():
            if not isinstance(name, str):
                raise TypeError(f"the key is text, such as 'dataset.scenes', not {name!r}")
            raw = raw.with_change(name, _toml.value(one, name))
        return self._of(raw)

    def check(self) -> list[Diagnostic]:
        """Finds every mistake, without running anything.

        Returns:
            The warnings.

        Raises:
            RecipeError: With all mistakes at once, each with code, file, line, column and remedy.
        """
        return self._raw.check()

    def to_toml(self) -> str:
        """The whole recipe as TOML: with everything that it extends, all changes and all defaults.

        Raises:
            RecipeError: If the recipe has mistakes.
        """
        return self._raw.resolved()

    @property
    def name(self) -> str:
        """Its path, or its name in messages."""
        return self._raw.name

    @property
    def scenes(self) -> int:
        """Number of scenes."""
        return self._raw.size()[0]

    @property
    def views_per_scene(self) -> int:
        """Number of views of each scene."""
        return self._raw.size()[1]

    def __str__(self) -> str:
        return self.to_toml()

    def __repr__(self) -> str:
        changes = "".join(f".set({key!r}, …)" for key, _ in self._raw.changes)
        return f"Recipe({self.name!r}){changes}"

    def _repr_html_(self) -> str:
        import html

        try:
            text = self.to_toml()
        except Exception as error:  # a notebook shows the mistakes in place of the recipe
            text = str(error)
        return f"<pre>{html.escape(text)}</pre>"

    def __reduce__(self) -> tuple[Any, ...]:
        return (Recipe._of, (self._raw,))


def recipe(name: str) -> Recipe:
    """A recipe of the package, such as ``quickstart``. `recipes` lists them. ``Recipe("my.toml")`` reads a file.

    Raises:
        TypeError: If the name is not text.
        ValueError: If it is the path of a file.
        SyntableError: If the package has no such recipe.
    """
    if isinstance(name, os.PathLike):
        raise TypeError(f"st.recipe takes the name of a recipe of the package; st.Recipe({str(name)!r}) reads a file")
    if not isinstance(name, str):
        raise TypeError(
            f"st.recipe takes the name of a recipe of the package, such as 'quickstart', not {name!r}: "
            "st.Recipe('my.toml') reads a file, and st.Recipe.from_dict takes dicts"
        )
    if name.lower().endswith(".toml"):
        raise ValueError(f"st.recipe takes the name of a recipe of the package; st.Recipe({name!r}) reads a file")
    return Recipe(f"builtin:{name.removeprefix('builtin:')}")


def recipes() -> dict[str, str]:
    """Names of the recipes of the package, each with a sentence on it."""
    return dict(_syntable.builtin_recipes())


def as_recipe(it: Recipe | str | os.PathLike[str] | Mapping[str, Any]) -> Recipe:
    """A recipe as functions take it: a recipe, a path, ``builtin:NAME``, or dicts."""
    if isinstance(it, Recipe):
        return it
    if isinstance(it, Mapping):
        return Recipe.from_dict(it)
    if isinstance(it, (str, os.PathLike)):
        return Recipe(it)
    raise TypeError(f"a recipe is a Recipe, a path or a dict, not {it!r}")
