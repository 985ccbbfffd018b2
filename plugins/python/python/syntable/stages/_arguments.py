"""What stages get: views, scenes, and the output of writers."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import PurePath, PurePosixPath
from typing import Any

import numpy as np
import numpy.typing as npt

from .. import _syntable
from ..drawing import png
from ..samples import Camera, Sample
from ._products import _as_array, _found


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
    _number: int = field(repr=False)
    #: The call of the placer that got it. Numbers of other calls mean other assets.
    _call: object = field(repr=False)

    @classmethod
    def _of(cls, raw: tuple[Any, ...], call: object) -> Asset:
        number, pool, name, category, bounds, mass = raw
        return cls(pool, name, category, np.asarray(bounds), mass, number, call)


class PlacedScene(_Scene):
    """A scene under construction, as a `placer` gets it.

    Its assets belong to one call of the placer: every scene draws or loads its own.
    """

    def __init__(self, supports: dict[str, Any], assets: _syntable.SceneAssets, seed: int) -> None:
        super().__init__(supports, seed)
        self._assets = assets
        self._call = object()

    def draw(self, *pools: str) -> Asset:
        """Draws an object, uniformly over all objects of some pools.

        Raises:
            SyntableError: If a pool is unknown, or none of its objects can be used.
        """
        return Asset._of(self._assets.draw(list(pools)), self._call)

    def load(self, pool: str, name: str) -> Asset:
        """The object of a name.

        Raises:
            SyntableError: If the pool has no such object, or it cannot be used.
        """
        return Asset._of(self._assets.load(pool, name), self._call)


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

    def __init__(self, raw: _syntable.SceneOutput, *, keeps_records: bool = True) -> None:
        self._raw = raw
        self._keeps_records = keeps_records

    @property
    def folder(self) -> str:
        """The folder's name: the writer's id in the recipe."""
        return self._raw.id()

    def write(self, name: str | PurePath, content: bytes | str | npt.NDArray[Any]) -> None:
        """Writes a file.

        Args:
            name: Its path in the folder, such as ``f"{view.name}.txt"``. Each file is written once.
            content: Bytes; text, which is stored as UTF-8; or an array. The name of an array ends in ``.npy``, or in
                ``.png`` for an image: bool (stored as 0 and 255), uint8 or uint16 of height × width, or uint8 of
                height × width × 3.

        Raises:
            TypeError: If the content is something else.
            ValueError: If the name of an array has another ending.
            SyntableError: If the path leads out of the folder, exists already, or cannot be written.
        """
        if isinstance(name, PurePath):
            name = name.as_posix()
        if not isinstance(name, str):
            raise TypeError(f"the name of a file is text or a path, not {name!r}")
        self._raw.write(f"{self.folder}/{name}", _bytes(name, content))

    def record(self, value: Any) -> None:
        """Keeps a value for `finish`: numbers, text, lists and dicts, as JSON holds them. A resumed run still has it.

        Raises:
            TypeError: If JSON has no such value, or the class has no method ``finish``.
        """
        line = json.dumps(value, default=_json)
        if not self._keeps_records:
            raise TypeError("records are for the method finish(self, dataset, out), which the class lacks")
        self._raw.record(line)


def _bytes(name: str, content: Any) -> bytes:
    if isinstance(content, str):
        return content.encode()
    if isinstance(content, (bytes, bytearray, memoryview)):
        return bytes(content)
    array = _as_array(content)
    if not isinstance(array, np.ndarray):
        raise TypeError(f"a file holds bytes, text or an array, not {_found(content)}")
    ending = PurePosixPath(name).suffix.lower()
    if ending == ".png":
        # Of any byte order.
        kind = (array.dtype.name, array.ndim)
        is_image = kind in (("bool", 2), ("uint8", 2), ("uint16", 2)) or (kind == ("uint8", 3) and array.shape[2] == 3)
        if not is_image or not array.size:
            raise TypeError(
                "a PNG file holds bool, uint8 or uint16 of height × width, or uint8 of height × width × 3, "
                f"not {_found(array)}"
            )
        return png(array)
    if ending != ".npy":
        raise ValueError(f"the name of an array's file ends in .npy or .png, not {name!r}")
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
