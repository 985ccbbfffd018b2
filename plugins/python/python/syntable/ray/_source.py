"""The source of Ray Data that makes views."""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from ray.data.block import BlockAccessor, BlockMetadata  # type: ignore[import-not-found, import-untyped, unused-ignore]
from ray.data.datasource import Datasource, ReadTask  # type: ignore[import-not-found, import-untyped, unused-ignore]

from .. import _syntable
from ..generating import generate
from ..samples import Sample
from ._nodes import Job

__all__ = ["Views", "row"]

#: Bytes of a pixel in the columns of products; of others, the largest.
PIXEL_BYTES = {"rgb": 3, "depth": 4, "visible_ids": 2, "instance": 2, "visible_mask": 20, "amodal_mask": 20}
OTHER_PIXEL_BYTES = 12
#: Bytes of all that has no pixels.
ROW_BYTES = 4096
#: Records and texts of objects, whose type a view without objects does not show.
RECORDS = ("_info", "_outline", "_rotated_box", "cuboid", "visibility", "keypoints")
TEXTS = ("_name", "_layer")
#: Products without pixels.
SMALL = ("box", "rate", "order", "id", "name", "info", "camera", "graph", "layer", "report", "bodies", "lights")


class Views(Datasource):  # type: ignore[misc, unused-ignore]
    """Scenes of a recipe in as many parts as Ray Data asks for."""

    def __init__(
        self, job: Job, products: list[str], scenes: tuple[int, int], views: int, threads: int, allow_code: bool
    ) -> None:
        super().__init__()
        self._job, self._products, self._scenes, self._views = job, products, scenes, views
        self.threads, self._allow_code = threads, allow_code

    def get_name(self) -> str:
        """Name of the tasks."""
        return "Syntable"

    def estimate_inmemory_data_size(self) -> int:
        """Bytes of all rows, about."""
        first, end = self._scenes
        return (end - first) * self._views * self._row_bytes()

    def _row_bytes(self) -> int:
        """Bytes of a row, about: those of the largest image of the recipe."""
        sizes = re.findall(r"^resolution = \[(\d+), (\d+)\]", self._job.resolved, re.MULTILINE)
        pixels = max((int(width) * int(height) for width, height in sizes), default=640 * 480)
        named = (name for name in self._products if not name.endswith(SMALL))
        return ROW_BYTES + pixels * sum(PIXEL_BYTES.get(name, OTHER_PIXEL_BYTES) for name in named)

    def get_read_tasks(
        self, parallelism: int, per_task_row_limit: int | None = None, data_context: Any = None
    ) -> list[ReadTask]:
        """The tasks: each makes a range of scenes."""
        first, end = self._scenes
        parts = max(1, min(parallelism, end - first))
        cuts = [first + (end - first) * part // parts for part in range(parts + 1)]
        tasks = []
        for start, stop in zip(cuts, cuts[1:]):
            rows = (stop - start) * self._views
            metadata = BlockMetadata(
                num_rows=rows, size_bytes=rows * self._row_bytes(), exec_stats=None, input_files=None
            )
            read = _reader(self._job, self._products, (start, stop), self.threads, self._allow_code)
            tasks.append(ReadTask(read, metadata, per_task_row_limit=per_task_row_limit))
        return tasks


def _reader(
    job: Job, products: list[str], scenes: tuple[int, int], threads: int, allow_code: bool
) -> Callable[[], Iterator[Any]]:
    """The function of a task, without the source."""

    def read() -> Iterator[Any]:
        with job.at_node() as recipe:
            samples = generate(recipe, products, scenes=scenes, threads=threads, allow_code=allow_code, progress=False)
        with samples:
            rows: list[dict[str, Any]] = []
            for sample in samples:
                if rows and rows[0]["scene"] != sample.scene:
                    yield block(rows)
                    rows = []
                rows.append(row(sample, products))
            if rows:
                yield block(rows)
            if samples.failed:
                warnings.warn(f"scenes without rows, since they failed: {samples.failed}", stacklevel=1)

    return read


def block(rows: list[dict[str, Any]]) -> Any:
    """Rows as a block of Ray Data."""
    columns: dict[str, Any] = {}
    for name, first in rows[0].items():
        values = [one[name] for one in rows]
        if not isinstance(first, np.ndarray):
            columns[name] = np.asarray(values) if isinstance(first, int) else values
        elif len({value.shape for value in values}) == 1:
            columns[name] = np.stack(values)
        else:
            column = np.empty(len(values), dtype=object)
            column[:] = values
            columns[name] = column
    return BlockAccessor.batch_to_block(columns)


def row(sample: Sample, products: list[str]) -> dict[str, Any]:
    """A view as a row."""
    made: dict[str, Any] = {"scene": sample.scene, "view": sample.view, "ids": sample.ids}
    for name in products:
        if name == "camera":
            pose = sample.camera.world_from_camera
            made["K"] = sample.camera.K
            made["world_from_camera"] = np.full((4, 4), np.nan) if pose is None else pose
        made[name] = _value(sample, name)
    return made


def _value(sample: Sample, name: str) -> Any:
    value = sample[name]
    if isinstance(value, _syntable.Mask):
        return value.array()
    if isinstance(value, np.ndarray):
        return value
    ids = sample.ids.tolist()
    if name.endswith("_mask") and isinstance(value, dict):
        return sample._masks(name)
    if not isinstance(value, dict) or not all(isinstance(key, int) for key in value):
        return json.dumps(value, default=_plain)
    each = [value.get(id) for id in ids]
    known = [one for one in each if one is not None]
    if not known:
        return _nothing(name)
    if all(isinstance(one, str) for one in known):
        return [one or "" for one in each]
    if all(isinstance(one, _syntable.Mask) for one in known):
        return sample._masks(name)
    if all(isinstance(one, np.ndarray) for one in known) and len({one.shape for one in known}) == 1:
        return np.stack([np.zeros_like(known[0]) if one is None else one for one in each])
    if all(isinstance(one, (int, float, list, tuple)) for one in known):
        numbers = np.asarray(known, dtype=np.float64)
        made = np.full((len(ids), *numbers.shape[1:]), np.nan)
        made[[one is not None for one in each]] = numbers
        return made
    return json.dumps(value, default=_plain)


def _nothing(name: str) -> Any:
    """The value of a view without objects."""
    if name.endswith(RECORDS):
        return "{}"
    if name.endswith(TEXTS):
        return []
    return np.zeros((0, 4) if name.endswith("_box") else (0,))


def _plain(value: Any) -> Any:
    """A value of NumPy as JSON."""
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else str(value)
