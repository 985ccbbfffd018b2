"""The private part of the package: the functions of the library, without defaults and documentation."""

import os
from collections.abc import Callable, Mapping
from typing import Any, final

import numpy as np
import numpy.typing as npt

from .errors import Diagnostic

__all__ = [
    "main",
    "Dataset",
    "Generator",
    "Mask",
    "masks_of",
    "Recipe",
    "builtin_recipes",
    "Sample",
    "Scenes",
    "FinishedDataset",
    "SceneAssets",
    "SceneOutput",
    "add_annotator",
    "add_asset_source",
    "add_light",
    "add_placer",
    "add_sensor",
    "add_writer",
    "end_calls",
    "Viewer",
    "convert",
    "evaluate",
    "merge",
    "plan",
    "preview",
    "report",
    "run",
    "stats",
    "validate",
    "verify",
    "__version__",
]

__version__: str

_Path = str | os.PathLike[str]
_Named = tuple[str, str | None, str | None, bool]
_Progress = Callable[[dict[str, Any]], None] | None

def main(arguments: list[str]) -> int: ...
def builtin_recipes() -> list[tuple[str, str]]: ...

@final
class Recipe:
    @staticmethod
    def read(path: _Path) -> Recipe: ...
    @staticmethod
    def of_text(name: str, text: str) -> Recipe: ...
    @staticmethod
    def of_parts(name: str, path: _Path | None, text: str, changes: list[tuple[str, str]]) -> Recipe: ...
    def with_change(self, key: str, value: str) -> Recipe: ...
    @property
    def name(self) -> str: ...
    @property
    def text(self) -> str: ...
    @property
    def changes(self) -> list[tuple[str, str]]: ...
    def check(self) -> list[Diagnostic]: ...
    def resolved(self) -> str: ...
    def size(self) -> tuple[int, int]: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Mask:
    """A binary mask of an image, run-length encoded. ``numpy.asarray(mask)`` unpacks it."""

    def __new__(cls, array: npt.NDArray[np.bool_]) -> Mask: ...
    @staticmethod
    def from_rle(rle: dict[str, Any]) -> Mask: ...
    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def area(self) -> int: ...
    @property
    def box(self) -> tuple[int, int, int, int]: ...
    def array(self) -> npt.NDArray[np.bool_]: ...
    def rle(self) -> dict[str, Any]: ...
    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

def masks_of(array: npt.NDArray[np.bool_]) -> list[Mask]: ...

@final
class Sample:
    @property
    def scene(self) -> int: ...
    @property
    def view(self) -> int: ...
    @property
    def name(self) -> str: ...
    def names(self) -> list[str]: ...
    def get(self, name: str) -> Any: ...
    def read(self, names: list[str]) -> None: ...
    def masks(self, name: str, ids: list[int]) -> npt.NDArray[np.bool_]: ...
    def ids(self) -> list[int]: ...

@final
class Generator:
    def __new__(
        cls,
        recipe: Recipe,
        products: list[str],
        scenes: tuple[int, int, int] | None,
        threads: int | None,
        allow_code: bool,
        progress: _Progress,
    ) -> Generator: ...
    def __iter__(self) -> Generator: ...
    def __next__(self) -> Sample: ...
    @property
    def failed(self) -> list[int]: ...
    def close(self) -> None: ...

@final
class Scenes:
    def __new__(
        cls,
        recipe: Recipe,
        products: list[str],
        kept: int,
        threads: int | None,
        allow_code: bool,
        progress: _Progress,
    ) -> Scenes: ...
    def views(self, places: list[tuple[int, int]]) -> list[Sample]: ...
    def close(self) -> None: ...

@final
class Dataset:
    def __new__(cls, path: _Path, format: str | None, image_folder: _Path | None, trust_paths: bool) -> Dataset: ...
    def __len__(self) -> int: ...
    def sample(self, image: int) -> Sample: ...
    @property
    def format(self) -> str: ...
    @property
    def name(self) -> str: ...
    @property
    def products(self) -> list[str]: ...
    @property
    def categories(self) -> list[tuple[int, str]]: ...

@final
class Viewer:
    def __new__(cls, dataset: _Named, scores: _Path | None, port: int, threads: int | None) -> Viewer: ...
    @property
    def url(self) -> str: ...
    @property
    def is_open(self) -> bool: ...
    def close(self) -> None: ...

def run(
    recipe: Recipe,
    out: _Path,
    scenes: tuple[int, int] | None,
    threads: int | None,
    flags: list[str],
    progress: _Progress,
) -> dict[str, Any]: ...
def merge(
    parts: list[str], out: _Path, threads: int | None, allow_code: bool, progress: _Progress
) -> dict[str, Any]: ...
def verify(dataset: _Path, threads: int | None) -> dict[str, Any]: ...
def plan(
    recipe: Recipe, measured: int | None, threads: int | None, allow_code: bool, progress: _Progress
) -> dict[str, Any]: ...
def convert(
    dataset: _Named, to: list[str], out: _Path, settings: list[str], threads: int | None, progress: _Progress
) -> dict[str, Any]: ...
def validate(dataset: _Named, threads: int | None, progress: _Progress) -> dict[str, Any]: ...
def stats(
    datasets: list[_Named],
    labels_only: bool,
    edges: str,
    bins: str,
    prefixes: bool,
    duplicate_levels: int,
    threads: int | None,
    progress: _Progress,
) -> dict[str, Any]: ...
def report(
    dataset: _Named,
    out: _Path | None,
    scores: _Path | None,
    images: int | None,
    scenes: int | None,
    labels_only: bool,
    overwrite: bool,
    threads: int | None,
    progress: _Progress,
) -> dict[str, Any]: ...
def evaluate(
    dataset: _Named,
    predictions: _Named | list[tuple[Any, ...]],
    options: Mapping[str, Any],
    threads: int | None,
    progress: _Progress,
) -> dict[str, Any]: ...
def preview(
    recipe: Recipe,
    scenes: tuple[int, int] | None,
    samples: int,
    width: int,
    labels: bool,
    threads: int | None,
    allow_code: bool,
    progress: _Progress,
) -> tuple[npt.NDArray[np.uint8], int]: ...

_Asset = tuple[int, str, str, str, list[list[float]], float]

def add_annotator(
    kind: Any, call: Callable[..., Any], reads: list[str], provides: list[Any], takes_scene: bool
) -> None: ...
def add_sensor(
    kind: Any, call: Callable[..., Any], reads: list[str], provides: list[Any], replaces: list[tuple[str, str]]
) -> None: ...
def add_writer(
    kind: Any,
    write: Callable[..., Any],
    finish: Callable[..., Any] | None,
    reads: list[str],
    optional: list[str],
) -> None: ...
def add_light(kind: Any, call: Callable[..., Any], once_per_scene: bool) -> None: ...
def add_placer(kind: Any, call: Callable[..., Any]) -> None: ...
def add_asset_source(kind: Any, catalog: Callable[..., Any], load: Callable[..., Any], license: str | None) -> None: ...
def end_calls() -> None: ...

@final
class SceneOutput:
    def id(self) -> str: ...
    def write(self, path: str, bytes: bytes) -> None: ...
    def record(self, line: str) -> None: ...

@final
class SceneAssets:
    def draw(self, pools: list[str]) -> _Asset: ...
    def load(self, pool: str, name: str) -> _Asset: ...

@final
class FinishedDataset:
    @property
    def name(self) -> str: ...
    @property
    def seed(self) -> int: ...
    @property
    def scenes(self) -> list[int]: ...
    @property
    def categories(self) -> list[tuple[int, str]]: ...
    def records(self, scene: int) -> bytes: ...
