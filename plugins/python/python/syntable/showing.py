"""Datasets and recipes for people to look at: reports, pages in a browser, contact sheets."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _syntable
from ._arguments import optional_path, png_path, whole
from .datasets import Dataset, named
from .errors import RecipeError, SyntableError
from .generating import scene_range, thread_count
from .progress import Event, Progress, listener
from .recipes import Recipe, as_recipe

__all__ = ["Preview", "Report", "View", "preview", "report", "view"]


@dataclass(frozen=True)
class Report:
    """Web pages about a dataset.

    Attributes:
        index: The first page.
        format: Format of the dataset.
        images: Number of images with labels in the report.
        all_images: Number of images of the dataset.
        scenes: Number of scenes in space.
        notes: Notes for readers.
        left_out: What could not be read, and the pages omit.
    """

    index: str
    format: str
    images: int
    all_images: int
    scenes: int
    notes: list[str]
    left_out: list[str]


def report(
    dataset: Dataset | str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    *,
    scores: str | os.PathLike[str] | None = None,
    images: int | None = 500,
    scenes: int | None = 6,
    labels_only: bool = False,
    overwrite: bool = False,
    threads: int | None = None,
    progress: Progress = None,
) -> Report:
    """Makes web pages about a dataset: card, statistics, images with labels, occlusion graphs, scenes in 3-D.

    Args:
        dataset: A dataset, or its path.
        out: Folder of the report. Default: the dataset's folder with the suffix ``-report``.
        scores: File of scores, which ``evaluate(…, save=…)`` wrote.
        images: Maximum number of images, or None for all. Statistics always cover all images.
        scenes: Maximum number of scenes in 3-D, or None for all.
        labels_only: Read only labels, which is faster.
        overwrite: Replace the report in the folder.
        threads: Number of threads; the report does not depend on it. Default: all cores.
        progress: Shows progress, or receives every event; see `Progress`.

    Raises:
        SyntableError: If the dataset cannot be read, or the folder is in use.
    """
    found = _syntable.report(
        named(dataset),
        optional_path(out, "out"),
        optional_path(scores, "scores"),
        None if images is None else whole(images, "images", 0),
        None if scenes is None else whole(scenes, "scenes", 0),
        bool(labels_only),
        bool(overwrite),
        thread_count(threads),
        listener(progress),
    )
    return Report(**found)


class View:
    """A dataset that a local server shows in a browser. `close` and the end of a ``with`` block end it."""

    def __init__(self, raw: _syntable.Viewer) -> None:
        self._raw = raw

    @property
    def url(self) -> str:
        """Address of the first page. It gives access to all pages: keep it secret."""
        return self._raw.url

    @property
    def is_open(self) -> bool:
        """Whether the server answers."""
        return self._raw.is_open

    def close(self) -> None:
        """Ends the server."""
        self._raw.close()

    def __enter__(self) -> View:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"View({self.url!r})" if self.is_open else "View(closed)"

    def _repr_html_(self) -> str:
        import html

        address = html.escape(self.url)
        return f'<a href="{address}">{address}</a>' if self.is_open else "closed"

    def __reduce__(self) -> Any:
        raise TypeError("a server cannot be pickled: pass the dataset, and view it there")


def view(
    dataset: Dataset | str | os.PathLike[str],
    *,
    scores: str | os.PathLike[str] | None = None,
    port: int = 0,
    threads: int | None = None,
) -> View:
    """Shows a dataset in the browser: the pages of `report`, made on request. No files are written.

    Args:
        dataset: A dataset, or its path.
        scores: File of scores, which ``evaluate(…, save=…)`` wrote.
        port: Port of the loopback address; 0 for any free port.
        threads: Number of threads for the statistics. Default: all cores.

    Returns:
        The running server; ``url`` is its address.

    Raises:
        ValueError: If the port is out of range.
        SyntableError: If the dataset cannot be read, or the port is in use.
    """
    port = whole(port, "port", 0, 65535)
    raw = _syntable.Viewer(named(dataset), optional_path(scores, "scores"), port, thread_count(threads))
    return View(raw)


@dataclass(frozen=True, eq=False)
class Preview:
    """A contact sheet: a row per scene, a column per view.

    Attributes:
        image: The sheet, height × width × 3, uint8. ``numpy.asarray(preview)`` is the same.
        failed: Number of scenes that could not be made; their cells have the reason.
    """

    image: npt.NDArray[np.uint8]
    failed: int

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]:
        return np.array(self.image, dtype=dtype) if copy else np.asarray(self.image, dtype=dtype)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the sheet as a PNG file.

        Raises:
            ValueError: If the path does not end in ``.png``.
            OSError: If the file cannot be written.
        """
        with open(png_path(path), "wb") as file:
            file.write(self._repr_png_())

    def __repr__(self) -> str:
        height, width, _ = self.image.shape
        return f"Preview({width} × {height} pixels, {self.failed} failed)"

    def _repr_png_(self) -> bytes:
        from .drawing import png

        return png(self.image)


def preview(
    recipe: Recipe | str | os.PathLike[str] | Mapping[str, Any],
    *,
    scenes: range | tuple[int, int] | int | None = None,
    samples: int = 4,
    width: int = 320,
    labels: bool = False,
    threads: int | None = None,
    allow_code: bool = False,
    progress: Progress = None,
) -> Preview:
    """Renders a few views of a few scenes quickly, on one contact sheet. A notebook shows it.

    Args:
        recipe: A recipe, its path, ``builtin:NAME``, or dicts.
        scenes: Numbers of the scenes. Default: the first two.
        samples: Maximum number of samples per pixel; images are denoised.
        width: Maximum width of an image, px.
        labels: Show visible masks, amodal outlines and occluded parts beside the images.
        threads: Number of threads. Default: all cores.
        allow_code: Run code that the recipe brings: native libraries and programs.
        progress: Shows progress, or receives every event; see `Progress`.

    Raises:
        RecipeError: If the recipe has mistakes.
        SyntableError: If nothing can be rendered, as when the recipe brings code and ``allow_code`` is False.
        ValueError: If a number is out of range.
        KeyboardInterrupt: After Ctrl-C.
    """
    samples, width = whole(samples, "samples", 1, 1 << 20), whole(width, "width", 16, 4096)
    heard = _Errors(listener(progress), passes_on=callable(progress))
    try:
        image, failed = _syntable.preview(
            as_recipe(recipe)._raw,
            scene_range(scenes),
            samples,
            width,
            bool(labels),
            thread_count(threads),
            bool(allow_code),
            heard,
        )
    except SyntableError as error:
        if isinstance(error, RecipeError) or heard.last is None:
            raise
        raise heard.last from None
    return Preview(image, failed)


class _Errors:
    """A listener that keeps the last error of a preview, which is the reason if nothing is rendered."""

    def __init__(self, listen: Callable[[Event], None], *, passes_on: bool) -> None:
        self.listen = listen
        self.passes_on = passes_on
        self.last: SyntableError | None = None

    def __call__(self, event: Event) -> None:
        is_error = event["event"] == "message" and event["level"] == "error"
        if is_error:
            message, help = event["message"], "; ".join(event.get("help", ()))
            text = event.get("rendered") or (f"{message} ({help})" if help else message)
            self.last = SyntableError(text.rstrip(), message=message, help=help or None)
        if self.passes_on or not is_error:
            self.listen(event)
