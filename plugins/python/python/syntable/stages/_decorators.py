"""Decorators that register functions and classes as stages."""

from __future__ import annotations

import hashlib
import inspect
import json
import os
import re
import sys
import textwrap
import tokenize
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from .. import _syntable
from .._options import Options
from ._arguments import Finished, LitScene, Output, PlacedScene, View
from ._calls import _call, _Refused
from ._products import Image, PerObject, Tensor, Value, _found, _Product
from ._returned import _catalog, _dicts, _light, _Loaded, _loaded, _placed

_F = TypeVar("_F", bound=Callable[..., Any])
_C = TypeVar("_C", bound=type)


@dataclass(frozen=True)
class _Kind:
    """A kind, as the library takes it."""

    name: str
    owner: str
    version: str
    schema: str
    options: Callable[[Mapping[str, Any]], tuple[Any, str]]


@dataclass(frozen=True)
class _Declared:
    """A product, as the library takes it."""

    name: str
    product: str


_NAME = re.compile(r"[a-z][a-z0-9_]*\Z")


def annotator(
    *,
    reads: Iterable[str],
    provides: Mapping[str, Any],
    options: type | None = None,
    scene: bool = False,
    name: str | None = None,
) -> Callable[[_F], _F]:
    """Registers a function as an annotator: a stage that makes products of each view from other products.

    The function gets a `View`, and its options if it has some. It returns the value of its product, or a dict of the
    values by name if it provides several. Its docstring is the help of the kind. It remains an ordinary function.

    Args:
        reads: Names of the products that it reads, such as ``["rgb", "visible_mask"]``.
        provides: What it provides, by name: ``float``, ``int``, ``bool``, ``str``, ``dict`` or ``list`` for a value per
            view, ``st.Value`` for one with a unit, ``st.PerObject(float)``, ``st.Image("float32")`` or
            ``st.Tensor("float32")``.
        options: A dataclass. Its fields are the options in ``[annotate.NAME]``; strings below the fields describe them,
            and ``Annotated[float, st.Range(0, 1)]`` limits them.
        scene: Whether it needs the scene that a view shows: ``view.camera``, ``view.objects`` and ``view.bodies``. Such
            an annotator does not take part in `convert`.
        name: Name of the kind in recipes. Default: the function's name.

    Raises:
        TypeError: If an argument has a wrong type.
        ValueError: If a name is taken, or no stage provides a product that is read.

    An exception in the function ends the run; the error has its traceback.
    """
    read = _names("reads", reads)
    products = _products(provides)
    if scene:
        read = list(dict.fromkeys([*read, "camera", "object_info"]))

    def add(function: _F) -> _F:
        kind, call, declared = _function("annotator", name, function, products, options)
        _syntable.add_annotator(kind, _call(call), read, declared, bool(scene))
        return function

    return add


def sensor(
    *,
    reads: Iterable[str] = (),
    provides: Mapping[str, Any],
    replaces: Mapping[str, str] | None = None,
    options: type | None = None,
    name: str | None = None,
) -> Callable[[_F], _F]:
    """Registers a function as a sensor: a stage that makes noisy or blurred images from rendered ones.

    It is declared and called like an `annotator`, after the image is rendered and before labels are made. ``view.rng``
    has random numbers of this sensor, scene, view and attempt.

    Args:
        reads: Names of the products that it reads.
        provides: What it provides, by name, such as ``{"rgb_dusty": st.Image("uint8", channels=3, meaning="color")}``.
        replaces: Products of other stages that it replaces in recipes that name it, each with a new name for the
            original: with ``{"rgb": "rgb_clean"}`` it provides ``rgb``, and reads the original as ``view.rgb_clean``.
        options: A dataclass. Its fields are the options in ``[sensor.NAME]``, as those of an `annotator`.
        name: Name of the kind in recipes. Default: the function's name.

    Raises:
        TypeError: If an argument has a wrong type.
        ValueError: If a name is taken, or no stage provides a product that is read or replaced.
    """
    read = _names("reads", reads)
    products = _products(provides)
    replaced = dict(replaces or {})
    for product, original in replaced.items():
        if product not in products:
            raise ValueError(f"replaces names `{product}`, which provides lacks")
        _name("product", original)

    def add(function: _F) -> _F:
        kind, call, declared = _function("sensor", name, function, products, options)
        _syntable.add_sensor(kind, _call(call), read, declared, list(replaced.items()))
        return function

    return add


def _products(provides: Any) -> dict[str, _Product]:
    if not isinstance(provides, Mapping) or not provides:
        raise TypeError(f"provides is a dict from names of products, such as {{'darkness': float}}, not {provides!r}")
    return {_name("product", key): _product(key, it) for key, it in provides.items()}


def _function(
    what: str, name: str | None, function: Any, products: dict[str, _Product], options: type | None
) -> tuple[_Kind, Callable[..., list[Any]], list[_Declared]]:
    """The kind of a function, its call by the library, and its products."""
    if not callable(function) or isinstance(function, type):
        raise TypeError(f"the {what} is a function, not {function!r}")
    kind_name = _name(what, name or getattr(function, "__name__", None))
    table = Options(options, _help(function, kind_name))
    _check_call(function, options)

    def call(raw: Any, seed: int, shape: tuple[int, int], bodies: Any, given: Any) -> list[Any]:
        view = View(raw, seed, shape, bodies)
        returned = function(view) if options is None else function(view, given)
        return _values(products, returned, view, function)

    declared = [
        _Declared(
            key, json.dumps(it._form | {"doc": it.doc or f"Provided by the {what} `{kind_name}`.", "unit": it.unit})
        )
        for key, it in products.items()
    ]
    return _kind(kind_name, function, table, table.make), call, declared


def writer(
    *,
    reads: Iterable[str],
    optional: Iterable[str] = (),
    options: type | None = None,
    name: str | None = None,
) -> Callable[[_C], _C]:
    """Registers a class as a writer: a stage that writes files.

    The class has a method ``write(self, view, out)``, which writes the files of a `View` to an `Output`, and may have
    ``finish(self, dataset, out)``, which writes files of the whole dataset: every run calls it at its end with a
    `Finished` dataset, and once after the first scene to find mistakes early. If the writer has options, the class is
    called with them. Its docstring is the help of the kind.

    One instance writes all scenes, several at a time, and a resumed run has a new one. So keep what `finish` needs with
    ``out.record``, not in the instance. Both methods return nothing.

    Args:
        reads: Names of the products that it reads.
        optional: Names of products that a dataset may lack when it is converted.
        options: A dataclass. Its fields are the options in ``[write.NAME]``, as those of an `annotator`.
        name: Name of the kind in recipes. Default: the name of the class in snake_case.

    Raises:
        TypeError: If an argument has a wrong type, or the class lacks ``write``.
        ValueError: If the name is taken.
    """
    read, may_read = _names("reads", reads), _names("optional", optional)

    def add(cls: _C) -> _C:
        kind_name, table, make = _class("writer", name, cls, options, ("write(self, view, out)",))
        finish = getattr(cls, "finish", None)

        def write_view(self: Any, raw: Any, seed: int, shape: tuple[int, int], output: Any) -> None:
            out = Output(output, keeps_records=finish is not None)
            _nothing(self.write(View(raw, seed, shape), out), "write", cls)

        def finish_dataset(self: Any, raw: Any, output: Any) -> None:
            _nothing(self.finish(Finished(raw), Output(output)), "finish", cls)

        at_end = None if finish is None else _call(finish_dataset)
        _syntable.add_writer(_kind(kind_name, cls, table, make), _call(write_view), at_end, read, may_read)
        return cls

    return add


def _nothing(returned: Any, method: str, cls: Any) -> None:
    """Refuses a value that a method of a writer returned: nobody would read it."""
    if returned is not None:
        remedy = "out.write stores a file" + (", and out.record keeps a value for finish" if method == "write" else "")
        raise _Refused(f"{method}() returns nothing, not {_found(returned)}: {remedy}", getattr(cls, method))


def light(*, options: type | None = None, once_per_scene: bool = False, name: str | None = None) -> Callable[[_F], _F]:
    """Registers a function as a light sampler: it gives the lights of each view.

    The function gets a `LitScene`, and its options if it has some. It returns a list of dicts, each with a ``type``:

    - ``sphere``: ``center``, ``radius``, ``radiance``;
    - ``rect``: ``center``, ``half_u`` and ``half_v`` from the center to the middles of two edges, ``radiance``; it
      lights the side of half_u × half_v;
    - ``disk``: ``center``, ``normal``, ``radius``, ``radiance``;
    - ``directional``: ``towards`` the light, ``half_angle`` under which it is seen, ``irradiance``.

    Lengths are meters and angles radians. Radiance (nits) and irradiance (lux) are a number or linear Rec. 709.

    Args:
        options: A dataclass. Its fields are the options in ``[[lights]]``, as those of an `annotator`.
        once_per_scene: Whether all views of a scene have the same lights.
        name: Name of the kind in recipes. Default: the function's name.

    Raises:
        TypeError: If an argument has a wrong type.
        ValueError: If the name is taken.
    """

    def add(function: _F) -> _F:
        kind_name, table = _composing("light", name, function, options)

        def call(scene: int, supports: Any, bodies: Any, camera: Any, seed: int, given: Any) -> list[Any]:
            lit = LitScene(scene, supports, bodies, camera, seed)
            returned = function(lit) if options is None else function(lit, given)
            return [_light(one, number, function) for number, one in enumerate(_dicts(returned, function))]

        _syntable.add_light(_kind(kind_name, function, table, table.make), _call(call), bool(once_per_scene))
        return function

    return add


def placer(*, options: type | None = None, name: str | None = None) -> Callable[[_F], _F]:
    """Registers a function as a placer: it puts bodies into the scene.

    The function gets a `PlacedScene`, and its options if it has some. It returns a list of dicts:

    - ``asset``: an `Asset` of this scene, from ``scene.draw(pool)`` or ``scene.load(pool, name)``;
    - ``pose``: where it is, 4 × 4, m, z up;
    - ``fixed``: whether it stays there; else it falls and collides. Default: False;
    - ``role``: ``object`` (annotated), ``distractor``, ``support`` or ``fixture``. Default: ``object``.

    Args:
        options: A dataclass. Its fields are the options in ``[[place]]``, as those of an `annotator`. A field of type
            ``st.ObjectPool`` names a pool.
        name: Name of the kind in recipes. Default: the function's name.

    Raises:
        TypeError: If an argument has a wrong type.
        ValueError: If the name is taken.
    """

    def add(function: _F) -> _F:
        kind_name, table = _composing("placer", name, function, options)

        def call(supports: Any, assets: Any, seed: int, given: Any) -> list[Any]:
            scene = PlacedScene(supports, assets, seed)
            returned = function(scene) if options is None else function(scene, given)
            return [_placed(one, number, scene, function) for number, one in enumerate(_dicts(returned, function))]

        _syntable.add_placer(_kind(kind_name, function, table, table.make), _call(call))
        return function

    return add


def asset_source(
    *, options: type | None = None, license: str | None = None, name: str | None = None
) -> Callable[[_C], _C]:
    """Registers a class as a source of objects.

    The class has ``names(self)``, which returns the names of its objects, or a dict from names to categories; and
    ``load(self, name)``, which returns a dict. Names and categories have at most 200 characters, and a name may have
    folders, such as ``mugs/red``. The dict has:

    - ``vertices``: V × 3, m, z up; ``faces``: T × 3 indices, counter-clockwise seen from outside;
    - ``colors``: V × 3 in [0, 1], linear Rec. 709; optional;
    - ``color``: the color of all faces, in [0, 1], linear Rec. 709. Default: light gray, or white with ``colors``;
    - ``roughness``: in [0, 1]. Default: 0.5.

    If the source has options, the class is called with them.

    Args:
        options: A dataclass, with a default for every field. Its fields are the options in ``[assets.NAME]``, as those
            of an `annotator`.
        license: License of all objects, as an SPDX expression.
        name: Name of the kind in recipes. Default: the name of the class in snake_case.

    Raises:
        TypeError: If an argument has a wrong type, or the class lacks a method.
        ValueError: If the name is taken.
    """

    def add(cls: _C) -> _C:
        kind_name, table, make = _class("asset source", name, cls, options, ("names(self)", "load(self, name)"))
        if license is not None and not isinstance(license, str):
            raise TypeError(f"a license is text, not {license!r}")
        if "required" in table.schema:
            raise TypeError(f"{kind_name}: every option of a source has a default")

        made: Any = cls

        def catalog(self: Any) -> list[tuple[str, str]]:
            return _catalog(self.names(), kind_name, made.names)

        def load(self: Any, one: str) -> _Loaded:
            categories = self.names()
            category = categories.get(one, "") if isinstance(categories, Mapping) else ""
            return _loaded(self.load(one), str(category or kind_name), made.load)

        _syntable.add_asset_source(_kind(kind_name, cls, table, make), _call(catalog), _call(load), license)
        return cls

    return add


def _composing(what: str, name: str | None, function: Any, options: type | None) -> tuple[str, Options]:
    if not callable(function) or isinstance(function, type):
        raise TypeError(f"the {what} is a function, not {function!r}")
    kind_name = _name(what, name or getattr(function, "__name__", None))
    table = Options(options, _help(function, kind_name))
    _check_call(function, options, "scene")
    return kind_name, table


def _class(
    what: str, name: str | None, cls: Any, options: type | None, methods: tuple[str, ...]
) -> tuple[str, Options, Callable[[Mapping[str, Any]], tuple[Any, str]]]:
    """The name of a class as a kind, its options, and the function that makes instances."""
    if not isinstance(cls, type):
        raise TypeError(f"the {what} is a class with {' and '.join(methods)}, not {cls!r}")
    kind_name = _name(what, name or re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", cls.__name__).lower())
    table = Options(options, _help(cls, kind_name))
    missing = next((it for it in methods if not callable(getattr(cls, it.partition("(")[0], None))), None)
    if missing is not None:
        raise TypeError(f"{cls.__name__} lacks the method {missing}")

    def make(given: Mapping[str, Any]) -> tuple[Any, str]:
        chosen, text = table.make(given)
        return (cls() if options is None else cls(chosen)), text

    return kind_name, table, make


def _kind(name: str, it: Any, table: Options, make: Callable[[Mapping[str, Any]], tuple[Any, str]]) -> _Kind:
    owner, version = _source(it, table.cls)
    return _Kind(name, owner, version, json.dumps(table.schema), make)


def _source(it: Any, options: Any) -> tuple[str, str]:
    """The module of a stage and its version; without a version, the stage and the digest of its code."""
    # Code that `exec` runs may have no module.
    owner = it.__module__ or "__main__"
    module = sys.modules.get(owner)
    file = getattr(module, "__file__", None)
    if owner == "__main__":
        owner = os.path.splitext(os.path.basename(file))[0] if file else "notebook"
    stated = getattr(module, "__version__", None)
    if stated is not None:
        return owner, str(stated)
    try:
        code = "".join(_code(part) for part in (it, options) if part is not None)
    except (OSError, TypeError, SyntaxError, tokenize.TokenError):
        # Code that was typed has no file, and a lambda is no statement.
        return owner, "0"
    return f"{owner}.{it.__qualname__}", hashlib.sha256(code.encode()).hexdigest()[:16]


def _code(it: Any) -> str:
    """The code of a function or a class without comments and empty lines."""
    lines = textwrap.dedent(inspect.getsource(inspect.unwrap(it))).splitlines(keepends=True)
    for token in list(tokenize.generate_tokens(iter(lines).__next__)):
        if token.type == tokenize.COMMENT:
            row, column = token.start
            lines[row - 1] = lines[row - 1][:column]
    return "\n".join(line.rstrip() for line in lines if line.strip())


def _help(it: Any, name: str) -> str:
    return inspect.cleandoc(it.__doc__) if it.__doc__ else f"The stage `{name}` in Python."


def _names(argument: str, names: Any) -> list[str]:
    if isinstance(names, str) or not isinstance(names, Iterable):
        raise TypeError(f"{argument} is a list of names of products, such as ['rgb'], not {names!r}")
    found = list(names)
    wrong = next((one for one in found if not isinstance(one, str)), None)
    if wrong is not None:
        raise TypeError(f"{argument}: a product is named by text, not {wrong!r}")
    return list(dict.fromkeys(found))


def _name(what: str, name: Any) -> str:
    if not isinstance(name, str) or not _NAME.match(name):
        raise ValueError(f"the name of a {what} is in snake_case, such as 'dark_pixels', not {name!r}")
    return name


def _product(name: str, it: Any) -> _Product:
    if isinstance(it, (Value, Image, Tensor, PerObject)):
        return it
    if it in (bool, int, float, str, dict, list):
        return Value(it)
    if it in (Value, Image, Tensor, PerObject):
        raise TypeError(f"provides[{name!r}]: {it.__name__} needs its type, such as st.{it.__name__}(…)")
    raise TypeError(
        f"provides[{name!r}] is float, int, bool, str, dict, list, st.Value, st.PerObject, st.Image or st.Tensor, "
        f"not {it!r}"
    )


def _check_call(function: Any, options: type | None, first: str = "view") -> None:
    """Checks that a function can be called with a view or scene, and with options if it has some.

    Raises:
        TypeError: If not.
    """
    try:
        signature = inspect.signature(function)
    except ValueError:
        return
    try:
        signature.bind(*[None] * (1 if options is None else 2))
    except TypeError:
        form = first if options is None else f"{first}, options"
        raise TypeError(f"{function.__name__} is called as {function.__name__}({form}), but is {signature}") from None


def _values(products: dict[str, _Product], returned: Any, view: View, function: Any) -> list[Any]:
    """The values of all products, checked."""
    if len(products) == 1:
        returned = {next(iter(products)): returned}
    elif not isinstance(returned, Mapping) or set(returned) != set(products):
        found = f"the keys {', '.join(map(repr, returned))}" if isinstance(returned, Mapping) else _found(returned)
        raise _Refused(f"a dict with the keys {', '.join(map(repr, products))} is expected; found {found}", function)
    values = []
    for name, product in products.items():
        try:
            values.append(product._checked(returned[name], view))
        except _Refused as refused:
            raise _Refused(f"`{name}`: {refused}", function) from None
    return values
