"""What stages get: views, scenes, and the output of writers."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
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
