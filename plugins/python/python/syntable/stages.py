"""Stages in Python, which recipes name like all others.

    @st.annotator(reads=["rgb", "visible_mask"], provides={"darkness": st.PerObject(float)})
    def darkness(view):
        "Share of dark pixels of each object."
        return {id: float((view.rgb[mask].mean(-1) < 51).mean()) for id, mask in zip(view.ids, view.visible_masks)}

A decorator registers the stage in this process: `run`, `generate`, `convert` and `Recipe.check` know it from then on. The
command loads a file of stages with ``syntable --plugin my_stages.py …``. The same decorator again, as in a notebook cell,
replaces the stage. The library calls stages on its own threads, one call at a time because of Python's global lock.

A dataset records the name and the ``__version__`` of the module of each stage. Raise the version to keep a run from
continuing a dataset that another version began.
"""

from __future__ import annotations

import atexit
import ctypes
import inspect
import io
import json
import operator
import os
import re
import sys
import threading
import traceback
import types
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from . import _syntable
from ._options import ObjectPool, OptionError, Options, Range
from ._syntable import Mask
from .drawing import png
from .samples import Camera, Sample

__all__ = [
    "Asset",
    "Body",
    "Finished",
    "Image",
    "LitScene",
    "ObjectPool",
    "Output",
    "PerObject",
    "PlacedScene",
    "Range",
    "Support",
    "Tensor",
    "Unlucky",
    "Value",
    "View",
    "annotator",
    "asset_source",
    "light",
    "placer",
    "sensor",
    "writer",
]

_DTYPES = (
    "bool", "uint8", "uint16", "uint32", "uint64", "int8", "int16", "int32", "int64", "float16", "float32", "float64"
)  # fmt: skip
_MEANINGS = ("", "color", "depth", "normal", "label", "mask")
_F = TypeVar("_F", bound=Callable[..., Any])
_C = TypeVar("_C", bound=type)

# Threads of the library must not call Python while it ends.
atexit.register(_syntable.end_calls)


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


# --- calls

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


# --- products that stages provide


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
    return kind(value)


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


# --- arguments of stages


@dataclass(frozen=True, eq=False)
class Body:
    """A body of a scene: an object, a distractor, a support, a part of the room.

    Attributes:
        id: Its id in the scene, from 1.
        role: ``object``, ``distractor``, ``support``, ``room`` or ``fixture``.
        pool: The pool of its asset.
        name: Name of its asset in the pool.
        category: Name of its category; empty if it has none.
        world_from_body: Its pose, 4 × 4, m.
        bounds: Least and greatest corner of the box around it, along the axes of the world: 2 × 3, m.
    """

    id: int
    role: str
    pool: str
    name: str
    category: str
    world_from_body: npt.NDArray[np.float64]
    bounds: npt.NDArray[np.float64]


class View(Sample):
    """A view as stages get it: a sample with the products that the stage reads."""

    def __init__(
        self, raw: _syntable.Sample, seed: int, shape: tuple[int, int], bodies: list[dict[str, Any]] | None = None
    ) -> None:
        super().__init__(raw)
        self._seed = seed
        self._bodies = bodies
        self.__dict__["shape"] = shape

    @cached_property
    def rng(self) -> np.random.Generator:
        """Random numbers of this stage and view: the same in every run of the dataset, and on any number of threads."""
        return np.random.default_rng(self._seed)

    @cached_property
    def bodies(self) -> list[Body]:
        """All bodies of the scene, in the order of their ids. Only annotators with ``scene=True`` have them.

        Raises:
            TypeError: If the stage does not take the scene.
        """
        if self._bodies is None:
            raise TypeError("the stage does not take the scene: declare it with @st.annotator(…, scene=True)")
        return _bodies(self._bodies)

    @cached_property
    def _has_ids(self) -> bool:
        return len(self.ids) > 0 or any(name.endswith(("_mask", "_box")) for name in self.products)


@dataclass(frozen=True, eq=False)
class Support:
    """A place that carries objects: a level rectangle, and the space above it.

    Attributes:
        name: Its name, such as ``table``.
        center: Its center in the world, m.
        size: Its extents along x and y, m.
    """

    name: str
    center: npt.NDArray[np.float64]
    size: npt.NDArray[np.float64]


class _Scene:
    """The common part of scenes for placers and lights."""

    def __init__(self, supports: dict[str, Any], seed: int) -> None:
        self._supports = supports
        self._seed = seed

    @cached_property
    def rng(self) -> np.random.Generator:
        """Random numbers of this stage, scene and attempt, and of the view if the stage works on views."""
        return np.random.default_rng(self._seed)

    @cached_property
    def supports(self) -> dict[str, Support]:
        """The supports of the scene by name, the main one first."""
        return {
            name: Support(name, np.asarray(center), np.asarray(size)) for name, (center, size) in self._supports.items()
        }


@dataclass(frozen=True, eq=False)
class Asset:
    """An object of a pool.

    Attributes:
        pool: The pool.
        name: Its name in the pool.
        category: Name of its category; empty if it has none.
        bounds: Least and greatest corner of its mesh, in its own frame, z up: 2 × 3, m.
        mass: Its mass, kg.
    """

    pool: str
    name: str
    category: str
    bounds: npt.NDArray[np.float64]
    mass: float
    _number: int

    @classmethod
    def _of(cls, raw: tuple[Any, ...]) -> Asset:
        number, pool, name, category, bounds, mass = raw
        return cls(pool, name, category, np.asarray(bounds), mass, number)


class PlacedScene(_Scene):
    """A scene under construction, as a `placer` gets it."""

    def __init__(self, supports: dict[str, Any], assets: _syntable.SceneAssets, seed: int) -> None:
        super().__init__(supports, seed)
        self._assets = assets

    def draw(self, *pools: str) -> Asset:
        """Draws an object, uniformly over all objects of some pools.

        Raises:
            SyntableError: If a pool is unknown, or none of its objects can be used.
        """
        return Asset._of(self._assets.draw(list(pools)))

    def load(self, pool: str, name: str) -> Asset:
        """The object of a name.

        Raises:
            SyntableError: If the pool has no such object, or it cannot be used.
        """
        return Asset._of(self._assets.load(pool, name))


class LitScene(_Scene):
    """A scene at rest, as a `light` gets it."""

    def __init__(
        self,
        scene: int,
        supports: dict[str, Any],
        bodies: list[dict[str, Any]],
        camera: dict[str, Any] | None,
        seed: int,
    ) -> None:
        super().__init__(supports, seed)
        self._bodies = bodies
        self._camera = camera
        self.scene = scene
        """Number of the scene, from 0."""

    @cached_property
    def bodies(self) -> list[Body]:
        """All bodies, in the order of their ids."""
        return _bodies(self._bodies)

    @cached_property
    def camera(self) -> Camera | None:
        """The camera of the view; None for lights of a whole scene."""
        return None if self._camera is None else Camera._of(self._camera)


def _bodies(bodies: list[dict[str, Any]]) -> list[Body]:
    arrays = ("world_from_body", "bounds")
    found: list[dict[str, Any]] = [
        {name: np.asarray(value) if name in arrays else value for name, value in body.items()} for body in bodies
    ]
    return [Body(**body) for body in found]


class Output:
    """Where a writer puts its files: a folder of the dataset with the writer's name.

    Files appear in the dataset when the whole scene is done. They are in its journal, so a resumed run keeps them, and
    ``verify`` compares them.
    """

    def __init__(self, raw: _syntable.SceneOutput) -> None:
        self._raw = raw

    @property
    def folder(self) -> str:
        """The folder's name: the writer's id in the recipe."""
        return self._raw.id()

    def write(self, name: str, content: bytes | str | npt.NDArray[Any]) -> None:
        """Writes a file.

        Args:
            name: Its path in the folder, such as ``f"{view.name}.txt"``. Each file is written once.
            content: Bytes; text, which is stored as UTF-8; or an array, which becomes a PNG file if the name ends in
                ``.png`` (height × width × 3, uint8), and else an NPY file.

        Raises:
            TypeError: If the content is something else.
            SyntableError: If the path leads out of the folder, exists already, or cannot be written.
        """
        if not isinstance(name, str):
            raise TypeError(f"the name of a file is text, not {name!r}")
        self._raw.write(f"{self.folder}/{name}", _bytes(name, content))

    def record(self, value: Any) -> None:
        """Keeps a value for `finish`: numbers, text, lists and dicts, as JSON holds them. A resumed run still has it.

        Raises:
            TypeError: If JSON has no such value.
        """
        self._raw.record(json.dumps(value, default=_json))


def _bytes(name: str, content: Any) -> bytes:
    if isinstance(content, str):
        return content.encode()
    if isinstance(content, (bytes, bytearray, memoryview)):
        return bytes(content)
    array = _as_array(content)
    if not isinstance(array, np.ndarray):
        raise TypeError(f"a file holds bytes, text or an array, not {_found(content)}")
    if name.lower().endswith(".png"):
        if array.dtype != np.uint8 or array.ndim != 3 or array.shape[2] != 3:
            raise TypeError(f"a PNG file holds uint8 of height × width × 3, not {_found(array)}")
        return png(array)
    file = io.BytesIO()
    np.save(file, array, allow_pickle=False)
    return file.getvalue()


def _json(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    raise TypeError(f"a record holds what JSON holds, not {_found(value)}")


class Finished:
    """The dataset at the end of a run, for the method ``finish`` of a writer."""

    def __init__(self, raw: _syntable.FinishedDataset) -> None:
        self._raw = raw

    @property
    def name(self) -> str:
        """Name of the dataset."""
        return self._raw.name

    @property
    def seed(self) -> int:
        """Seed of the dataset."""
        return self._raw.seed

    @property
    def scenes(self) -> list[int]:
        """Numbers of the scenes that are done, ascending, with those of earlier runs."""
        return self._raw.scenes

    @property
    def categories(self) -> dict[int, str]:
        """Names of the categories by id."""
        return dict(self._raw.categories)

    def records(self) -> Iterator[Any]:
        """What `Output.record` kept, in the order of scenes and views."""
        for scene in self.scenes:
            for line in self._raw.records(scene).splitlines():
                yield json.loads(line)


# --- decorators


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
        _Declared(key, json.dumps(it._form | {"doc": it.doc or f"Provided by the {what} `{kind_name}`.", "unit": it.unit}))
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
    ``out.record``, not in the instance.

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
            self.write(View(raw, seed, shape), Output(output))

        def finish_dataset(self: Any, raw: Any, output: Any) -> None:
            self.finish(Finished(raw), Output(output))

        at_end = None if finish is None else _call(finish_dataset)
        _syntable.add_writer(_kind(kind_name, cls, table, make), _call(write_view), at_end, read, may_read)
        return cls

    return add


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

    - ``asset``: an `Asset` from ``scene.draw(pool)`` or ``scene.load(pool, name)``;
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
            return [_placed(one, number, function) for number, one in enumerate(_dicts(returned, function))]

        _syntable.add_placer(_kind(kind_name, function, table, table.make), _call(call))
        return function

    return add


def asset_source(
    *, options: type | None = None, license: str | None = None, name: str | None = None
) -> Callable[[_C], _C]:
    """Registers a class as a source of objects.

    The class has ``names(self)``, which returns the names of its objects, or a dict from names to categories; and
    ``load(self, name)``, which returns a dict:

    - ``vertices``: V × 3, m, z up; ``faces``: T × 3 indices, counter-clockwise seen from outside;
    - ``colors``: V × 3 in [0, 1], linear Rec. 709; optional;
    - ``color``: the color of all faces, linear Rec. 709. Default: light gray, or white with ``colors``;
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


def _dicts(returned: Any, function: Any) -> list[Mapping[str, Any]]:
    if isinstance(returned, Mapping) or not isinstance(returned, Iterable):
        raise _Refused(f"a list of dicts is expected; found {_found(returned)}", function)
    found = list(returned)
    wrong = next((one for one in found if not isinstance(one, Mapping)), None)
    if wrong is not None:
        raise _Refused(f"a list of dicts is expected; found {_found(wrong)} in it", function)
    return found


class _Fields:
    """The fields of a dict that a stage returned."""

    def __init__(self, what: str, fields: Mapping[str, Any], known: Iterable[str], function: Any) -> None:
        self.what, self.fields, self.function = what, fields, function
        known = list(known)
        for key in fields:
            if key not in known:
                raise self.refused(f"unknown key {key!r}; it has {', '.join(known)}")

    def refused(self, message: str) -> _Refused:
        return _Refused(f"{self.what}: {message}", self.function)

    def array(self, key: str, shape: tuple[int | None, ...], default: Any = None) -> npt.NDArray[np.float64]:
        value = self.fields.get(key, default)
        if value is None:
            raise self.refused(f"`{key}` is missing")
        sizes = " × ".join("any" if n is None else str(n) for n in shape) or "a number"
        try:
            array = np.asarray(_as_array(value), dtype=np.float64)
        except (TypeError, ValueError):
            raise self.refused(f"`{key}` is {sizes} numbers, not {_found(value)}") from None
        if array.ndim != len(shape) or any(n not in (None, m) for n, m in zip(shape, array.shape)):
            raise self.refused(f"`{key}` has the shape {sizes}, not {array.shape}")
        if not np.isfinite(array).all():
            raise self.refused(f"`{key}` is not finite: {_found(value)}")
        return array

    def vector(self, key: str) -> list[float]:
        """A vector that is not zero."""
        array = self.array(key, (3,))
        if not array.any():
            raise self.refused(f"`{key}` is zero")
        return [float(number) for number in array]

    def number(self, key: str, low: float, high: float, default: float | None = None) -> float:
        value = float(self.array(key, (), default))
        if not low <= value <= high:
            raise self.refused(f"`{key}` is between {low:g} and {high:g}, not {value:g}")
        return value

    def power(self, key: str) -> list[float]:
        value: Any = self.fields.get(key)
        array = self.array(key, () if np.ndim(value) == 0 else (3,))
        if (array < 0).any():
            raise self.refused(f"`{key}` is negative: {value!r}")
        return [float(number) for number in np.broadcast_to(array, (3,))]


_LIGHTS = {
    "sphere": ("type", "center", "radius", "radiance"),
    "rect": ("type", "center", "half_u", "half_v", "radiance"),
    "disk": ("type", "center", "normal", "radius", "radiance"),
    "directional": ("type", "towards", "half_angle", "irradiance"),
}


def _light(it: Mapping[str, Any], number: int, function: Any) -> tuple[Any, ...]:
    """A light as the library takes it: type, center, two vectors, power, and a number."""
    kind = it.get("type")
    if kind not in _LIGHTS:
        raise _Refused(f"light {number}: `type` is one of {', '.join(_LIGHTS)}, not {kind!r}", function)
    fields = _Fields(f"light {number}", it, _LIGHTS[kind], function)
    zero = [0.0, 0.0, 0.0]
    if kind == "directional":
        angle = fields.number("half_angle", 1e-6, np.pi / 2)
        return (kind, zero, fields.vector("towards"), zero, fields.power("irradiance"), angle)
    center, power = fields.array("center", (3,)).tolist(), fields.power("radiance")
    if kind == "rect":
        u, v = fields.vector("half_u"), fields.vector("half_v")
        if abs(np.dot(u, v)) > 1e-6 * np.linalg.norm(u) * np.linalg.norm(v):
            raise fields.refused("`half_u` and `half_v` are not at right angles")
        return (kind, center, u, v, power, 0.0)
    radius = fields.number("radius", 1e-6, 1e6)
    return (kind, center, fields.vector("normal") if kind == "disk" else zero, zero, power, radius)


_ROLES = ("object", "distractor", "support", "fixture")


def _placed(it: Mapping[str, Any], number: int, function: Any) -> tuple[int, list[list[float]], str, bool]:
    """A body as the library takes it: number of its asset, pose, role, and whether it is fixed."""
    fields = _Fields(f"body {number}", it, ("asset", "pose", "fixed", "role"), function)
    asset, role, fixed = it.get("asset"), it.get("role", "object"), it.get("fixed", False)
    if not isinstance(asset, Asset):
        raise fields.refused(
            f"`asset` comes from scene.draw(pool) or scene.load(pool, name), and is not {_found(asset)}"
        )
    if role not in _ROLES:
        raise fields.refused(f"`role` is one of {', '.join(_ROLES)}, not {role!r}")
    if not isinstance(fixed, (bool, np.bool_)):
        raise fields.refused(f"`fixed` is True or False, not {fixed!r}")
    pose = fields.array("pose", (4, 4))
    rotation = pose[:3, :3]
    is_rigid = np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-4) and np.linalg.det(rotation) > 0
    if not is_rigid or not np.allclose(pose[3], (0, 0, 0, 1)):
        raise fields.refused(f"`pose` is no rotation and translation: {pose.tolist()}")
    return asset._number, pose.tolist(), role, bool(fixed)


@dataclass(frozen=True)
class _Loaded:
    """An object, as the library takes it."""

    category: str
    vertices: npt.NDArray[np.float32]
    faces: npt.NDArray[np.uint32]
    colors: npt.NDArray[np.float32] | None
    color: list[float]
    roughness: float


def _catalog(names: Any, kind: str, function: Any) -> list[tuple[str, str]]:
    if isinstance(names, str) or not isinstance(names, Iterable):
        raise _Refused(f"names() returns a list of names, or a dict to categories, not {_found(names)}", function)
    pairs = list(names.items()) if isinstance(names, Mapping) else [(name, kind) for name in names]
    for name, category in pairs:
        if not isinstance(name, str) or not name or not isinstance(category, str):
            raise _Refused(f"names() returns texts, not {name!r}: {category!r}", function)
    if len({name for name, _ in pairs}) < len(pairs):
        raise _Refused("names() returns a name twice", function)
    return pairs


def _loaded(it: Any, category: str, function: Any) -> _Loaded:
    if not isinstance(it, Mapping):
        raise _Refused(f"load(name) returns a dict, not {_found(it)}", function)
    fields = _Fields("load(name)", it, ("vertices", "faces", "colors", "color", "roughness"), function)
    vertices, faces = fields.array("vertices", (None, 3)), fields.array("faces", (None, 3))
    if (faces != np.floor(faces)).any() or faces.min(initial=0) < 0 or faces.max(initial=-1) >= len(vertices):
        raise fields.refused(f"`faces` are indices of the {len(vertices)} vertices, from 0")
    colors = None if it.get("colors") is None else fields.array("colors", (len(vertices), 3)).astype(np.float32)
    color = fields.array("color", (3,), (0.6,) * 3 if colors is None else (1.0,) * 3).tolist()
    roughness = fields.number("roughness", 0, 1, 0.5)
    return _Loaded(category, vertices.astype(np.float32), faces.astype(np.uint32), colors, color, roughness)


def _kind(name: str, it: Any, table: Options, make: Callable[[Mapping[str, Any]], tuple[Any, str]]) -> _Kind:
    owner, version = _source(it)
    return _Kind(name, owner, version, json.dumps(table.schema), make)


def _source(it: Any) -> tuple[str, str]:
    """The module of a stage, and its version."""
    # Code that `exec` runs may have no module.
    owner = it.__module__ or "__main__"
    module = sys.modules.get(owner)
    file = getattr(module, "__file__", None)
    if owner == "__main__":
        owner = os.path.splitext(os.path.basename(file))[0] if file else "notebook"
    return owner, str(getattr(module, "__version__", "0"))


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


# --- errors

_PACKAGE = os.path.dirname(__file__) + os.sep
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
