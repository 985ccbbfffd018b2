"""Plans of recipes: what a run computes, and how long it takes."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from . import _syntable
from ._arguments import whole
from .generating import thread_count
from .progress import Progress, listener
from .recipes import Recipe, as_recipe

__all__ = ["Component", "Forecast", "Plan", "PlannedProduct", "plan"]


@dataclass(frozen=True)
class PlannedProduct:
    """A product that a run computes.

    Attributes:
        product: Its name.
        provider: The stage that provides it, such as ``annotate.masks``, or ``render``.
        per: How often it is made: per ``view``, ``frame``, ``scene`` or ``dataset``.
        wanted_by: The stages that read it.
    """

    product: str
    provider: str
    per: str
    wanted_by: list[str]


@dataclass(frozen=True)
class Component:
    """The plan of a component of a mixture, or of a whole recipe without components.

    Attributes:
        name: Its name; empty without a mixture.
        share: Its share of the scenes, in [0, 1].
        products: The products, each after those that it is made from.
        idle: Stages of the recipe that do not run, because nothing reads their products.
        render: The work of the renderer, in words.
        text: The same as a table.
    """

    name: str
    share: float
    products: list[PlannedProduct]
    idle: list[str]
    render: str
    text: str = field(repr=False)


@dataclass(frozen=True)
class Forecast:
    """Time and disk space of a run on this machine, from scenes that were made in memory.

    Attributes:
        measured: Number of measured scenes.
        threads: Number of threads of the run.
        objects: Smallest and largest number of objects of a measured scene.
        start_s: Time for steps that happen once, s.
        scene_s: Time per scene while several are in work, s.
        total_s: Time of all scenes, s.
        total_range_s: The same if all scenes were like the fastest and like the slowest measured one, s.
        images_per_hour: Images per hour after the start.
        scene_bytes: Bytes on disk of a scene.
        total_bytes: Bytes on disk of all scenes.
        limit: What limits the speed: ``cores``, ``render device`` or ``steps of a scene``.
        stages_s: Working time of each stage in a scene, s.
        unmeasured: Components of which too few scenes were measured: the forecast is rough.
    """

    measured: int
    threads: int
    objects: tuple[int, int]
    start_s: float
    scene_s: float
    total_s: float
    total_range_s: tuple[float, float]
    images_per_hour: float
    scene_bytes: int
    total_bytes: int
    limit: str
    stages_s: dict[str, float]
    unmeasured: list[str]


@dataclass(frozen=True)
class Plan:
    """What a run of a recipe computes. ``str()`` shows it as tables.

    Attributes:
        name: Name of the dataset.
        scenes: Number of scenes.
        views_per_scene: Number of views of each scene.
        components: Plans of the components; one without a mixture.
        bytes_per_view: Bytes of a view's stored images before compression, at most; None if their size is not known.
        time: Time and disk space; None unless measured.
    """

    name: str
    scenes: int
    views_per_scene: int
    components: list[Component]
    bytes_per_view: int | None
    time: Forecast | None

    @property
    def images(self) -> int:
        """Number of images."""
        return self.scenes * self.views_per_scene

    @property
    def products(self) -> list[PlannedProduct]:
        """The products of all components, each once."""
        found: dict[str, PlannedProduct] = {}
        for component in self.components:
            for product in component.products:
                found.setdefault(product.product, product)
        return list(found.values())

    def __str__(self) -> str:
        lines = [f"{self.name}: {self.scenes} × {self.views_per_scene} = {self.images} images"]
        for component in self.components:
            title = f"{component.name}: about {100 * component.share:.1f} % of the scenes\n" if component.name else ""
            lines.append(title + component.text.rstrip())
        if self.time is not None:
            time = self.time
            lines.append(
                f"time: {time.total_s:.0f} s with {time.threads} threads, {time.images_per_hour:.0f} images/h, "
                f"{time.total_bytes / 2**20:.1f} MiB"
            )
        return "\n\n".join(lines)


def plan(
    recipe: Recipe | str | os.PathLike[str] | Mapping[str, Any],
    *,
    time: bool = False,
    measured: int | None = None,
    threads: int | None = None,
    allow_code: bool = False,
    progress: Progress = None,
) -> Plan:
    """The products and stages of a recipe, and how long its run takes.

    Args:
        recipe: A recipe, its path, ``builtin:NAME``, or dicts.
        time: Make the first scenes in memory, and estimate time and disk space.
        measured: Number of scenes to measure, after one that warms up. Default: as many as ten seconds allow.
        threads: Number of threads of the run. Default: all cores.
        allow_code: Run code that the recipe brings: native libraries and programs.
        progress: Shows progress, or receives every event; see `Progress`.

    Raises:
        RecipeError: If the recipe has mistakes.
        ValueError: If ``measured`` is below 1.
        SyntableError: If no scene can be made.
    """
    measured = None if measured is None else whole(measured, "measured", 1, 2**32 - 1)
    scenes = (measured or 0) if time else None
    raw = as_recipe(recipe)._raw
    found = _syntable.plan(raw, scenes, thread_count(threads), bool(allow_code), listener(progress))
    components = [
        Component(products=[PlannedProduct(**one) for one in component.pop("products")], **component)
        for component in found.pop("components")
    ]
    estimate = found.pop("time")
    if estimate is not None:
        estimate.update({name: tuple(estimate[name]) for name in ("objects", "total_range_s")})
        estimate = Forecast(**estimate)
    return Plan(components=components, time=estimate, **found)
