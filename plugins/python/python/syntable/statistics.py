"""Statistics of datasets."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Any

from . import _syntable
from ._arguments import whole
from .datasets import Dataset, named
from .generating import thread_count
from .progress import Progress, listener

__all__ = ["Comparison", "Statistics", "compare", "stats"]


@dataclass(frozen=True, repr=False)
class Statistics:
    """Statistics of a dataset. ``str()`` shows them as tables and histograms; a number that is unknown is None.

    Attributes:
        dataset: Its path.
        format: Its format.
        images: Number of images.
        scenes: Number of scenes.
        objects: Number of different objects.
        instances: Number of objects that views show, summed over images.
        occluded: Number of those with a hidden pixel.
        mean_occlusion_rate: Mean of the hidden share of each instance, in [0, 1].
        totals: All totals by name.
        distributions: Histograms of quantities by name: ``edges`` of bins, ``counts``, ``mean``, ``median``, ``unit``
            and more.
        assets: Number of appearances of each asset by name; None without names.
        unknown: Numbers that are unknown, with the reason.
        csv: A line per image, as CSV.
        left_out: What could not be read.
    """

    dataset: str
    format: str
    images: int
    scenes: int
    objects: int | None
    instances: int
    occluded: int | None
    mean_occlusion_rate: float | None
    totals: dict[str, float | None]
    distributions: dict[str, dict[str, Any]]
    assets: dict[str, int] | None
    unknown: list[str]
    csv: str = field(repr=False)
    left_out: list[str]
    _json: dict[str, Any] = field(repr=False, compare=False)
    _text: str = field(repr=False, compare=False)

    def to_dict(self) -> dict[str, Any]:
        """The dataset's part of what ``syntable stats --json`` prints."""
        return self._json

    def __str__(self) -> str:
        return self._text.rstrip()

    def __repr__(self) -> str:
        rate = self.mean_occlusion_rate
        rest = "" if rate is None else f", mean occlusion rate {100 * rate:.1f} %"
        return f"Statistics({self.dataset!r}: {self.images} images, {self.instances} instances{rest})"

    @classmethod
    def _of(cls, json: dict[str, Any], found: dict[str, Any]) -> Statistics:
        totals, assets = json["totals"], json.get("assets")
        return cls(
            dataset=json["dataset"],
            format=json["format"],
            images=totals["images"],
            scenes=totals["scenes"],
            objects=totals["objects"],
            instances=totals["visible_instances"],
            occluded=totals["occluded_instances"],
            mean_occlusion_rate=totals["mean_occlusion_rate"],
            totals=totals,
            distributions={one["name"]: one for one in json["distributions"]},
            assets=None if assets is None else {one["name"]: one["instances"] for one in assets},
            unknown=json["unknown"],
            csv=found["csv"],
            left_out=found["left_out"],
            _json=json,
            _text=found["text"],
        )


@dataclass(frozen=True, repr=False)
class Comparison:
    """Statistics of several datasets. ``str()`` shows them side by side.

    Attributes:
        datasets: The statistics of each; their histograms have the same bins.
        distances: Distances of the distributions of each other dataset from the first.
        csv: A line per image, as CSV.
    """

    datasets: list[Statistics]
    distances: list[dict[str, Any]]
    csv: str
    _json: dict[str, Any]
    _text: str

    def to_dict(self) -> dict[str, Any]:
        """The same as ``syntable stats --json`` prints."""
        return self._json

    def __str__(self) -> str:
        return self._text.rstrip()

    def __repr__(self) -> str:
        return f"Comparison({', '.join(one.dataset for one in self.datasets)})"


def _found(
    datasets: list[tuple[str, str | None, str | None, bool]],
    labels_only: bool,
    edges: str,
    bins: str,
    prefixes: bool,
    duplicate_levels: int,
    threads: int | None,
    progress: Progress,
) -> dict[str, Any]:
    return _syntable.stats(
        datasets,
        bool(labels_only),
        edges,
        bins,
        bool(prefixes),
        whole(duplicate_levels, "duplicate_levels", 0, 255),
        thread_count(threads),
        listener(progress),
    )


def stats(
    dataset: Dataset | str | os.PathLike[str],
    *,
    labels_only: bool = False,
    edges: str = "pixels",
    bins: str = "fixed",
    prefixes: bool = False,
    duplicate_levels: int = 5,
    threads: int | None = None,
    progress: Progress = None,
) -> Statistics:
    """Counts the content of a dataset: instances, occlusion, sizes, near-duplicate views.

    Args:
        dataset: A dataset, or its path.
        labels_only: Read only labels, since images take most of the time. Omits brightness, depth and near-duplicate
            views.
        edges: Rule for "object i occludes j". ``pixels``: a hidden pixel of j shows i. ``iou``: the IoU of i's visible
            and j's occlusion mask is above 0.1. ``stored``: the dataset's own order.
        bins: Bins of histograms: ``fixed``, or ten ``equal`` ones from the minimum to the maximum.
        prefixes: Count components of the first object of each view, of the first two, and so on.
        duplicate_levels: Maximum difference of a cell's luma between near-duplicate views, of 255.
        threads: Number of threads; statistics do not depend on it. Default: all cores.
        progress: Shows progress, or receives every event; see `Progress`.

    Raises:
        ValueError: If an argument has no such value.
        SyntableError: If the dataset cannot be read.
    """
    found = _found([named(dataset)], labels_only, edges, bins, prefixes, duplicate_levels, threads, progress)
    return Statistics._of(found["json"]["datasets"][0], found)


def compare(
    *datasets: Dataset | str | os.PathLike[str],
    labels_only: bool = False,
    edges: str = "pixels",
    bins: str = "fixed",
    prefixes: bool = False,
    duplicate_levels: int = 5,
    threads: int | None = None,
    progress: Progress = None,
) -> Comparison:
    """Statistics of several datasets side by side, with the distances of their distributions from those of the first.

    Arguments are those of `stats`.

    Raises:
        TypeError: If no dataset is named.
        SyntableError: If a dataset cannot be read.
    """
    if not datasets:
        raise TypeError("name the datasets, such as compare('ours', 'theirs')")
    names = [named(dataset) for dataset in datasets]
    found = _found(names, labels_only, edges, bins, prefixes, duplicate_levels, threads, progress)
    json = found["json"]
    return Comparison(
        datasets=[Statistics._of(one, found) for one in json["datasets"]],
        distances=json["distances"],
        csv=found["csv"],
        _json=json,
        _text=found["text"],
    )
