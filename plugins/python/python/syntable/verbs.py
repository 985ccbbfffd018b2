"""The verbs of the command, as functions."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from . import _syntable, _toml
from ._arguments import claim_of, path, shard_text
from .datasets import Dataset, named
from .generating import scene_range, thread_count
from .progress import Progress, listener
from .recipes import Recipe, as_recipe

__all__ = [
    "Conversion",
    "DatasetProgress",
    "DatasetStatus",
    "Fault",
    "Outcome",
    "Status",
    "Validation",
    "Verification",
    "convert",
    "merge",
    "run",
    "status",
    "validate",
    "verify",
]


@dataclass(frozen=True)
class Outcome:
    """The dataset after a run.

    Attributes:
        path: Its folder.
        scenes: Number of its scenes.
        images: Number of its images.
        failed: Number of scenes that could not be made; the journal has the reasons.
        missing: Number of scenes of the recipe that are missing.
        lacking: Number of scenes that could not be repaired or extended.
        useless: Why the whole dataset is of no use, such as black images; empty if nothing is wrong.
        bad_assets: Assets that could not be read.
        left_out: What stages left out of images.
    """

    path: str
    scenes: int
    images: int
    failed: int
    missing: int
    lacking: int
    useless: list[str]
    bad_assets: list[str]
    left_out: list[str]

    @property
    def complete(self) -> bool:
        """Whether the dataset is whole and usable: the command would end with exit code 0."""
        losses = (self.failed, self.missing, self.lacking, self.useless, self.bad_assets, self.left_out)
        return not any(losses)

    def __bool__(self) -> bool:
        return self.complete

    def open(self) -> Dataset:
        """Opens the dataset."""
        return Dataset(self.path)


def run(
    recipe: Recipe | str | os.PathLike[str] | Mapping[str, Any],
    out: str | os.PathLike[str],
    *,
    scenes: range | tuple[int, int] | int | None = None,
    shard: str | tuple[int, int] | None = None,
    claim: bool | int = False,
    lease: float = 60.0,
    threads: int | None = None,
    overwrite: bool = False,
    retry_failed: bool = False,
    repair: bool = False,
    rewrite: bool = False,
    allow_code: bool = False,
    progress: Progress = None,
) -> Outcome:
    """Makes the dataset of a recipe, or continues it where it stopped. Ctrl-C keeps finished scenes.

    Args:
        recipe: A recipe, its path, ``builtin:NAME``, or dicts.
        out: Folder of the dataset, or its URL in an object store, such as ``"s3://bucket/mine"``.
        scenes: Numbers of the scenes to make, such as ``range(0, 10)``. Default: all.
        shard: Make one shard for `merge`: ``"3/10"`` or ``(3, 10)`` for number 3 of 10, from 0. ``"auto"`` takes both
            numbers from the variables of a job array, and ``"auto/10"`` the number of the task. The shard goes to the
            folder ``OUT.shards/3-of-10``.
        claim: Make the dataset together with other processes that make the same call, on any machines. Each claims scene
            by scene, or blocks of so many scenes. The last one ends the run.
        lease: Time without a sign of life after which others take over the claimed scenes of a process, s.
        threads: Number of threads; the dataset does not depend on it. Default: all cores.
        overwrite: Delete the dataset in the folder, and start again.
        retry_failed: Retry scenes that failed before.
        repair: Compare all files with the journal first, and make damaged scenes again.
        rewrite: Write files of writers again whose options have changed.
        allow_code: Run code that the recipe brings: native libraries and programs.
        progress: Shows progress, or receives every event; see `Progress`.

    Raises:
        RecipeError: If the recipe has mistakes.
        SyntableError: If the run cannot begin or continue. Scenes that fail do not raise; see `Outcome`.
        KeyboardInterrupt: After Ctrl-C.
    """
    switches = {
        "overwrite": overwrite,
        "retry_failed": retry_failed,
        "repair": repair,
        "rewrite": rewrite,
        "allow_code": allow_code,
    }
    found = _syntable.run(
        as_recipe(recipe)._raw,
        path(out, "out"),
        (scene_range(scenes), shard_text(shard), claim_of(claim, lease)),
        thread_count(threads),
        [name for name, is_on in switches.items() if is_on],
        listener(progress),
    )
    return Outcome(**found)


def merge(
    parts: Iterable[str | os.PathLike[str]],
    out: str | os.PathLike[str],
    *,
    threads: int | None = None,
    partial: bool = False,
    mixed_devices: bool = False,
    allow_code: bool = False,
    progress: Progress = None,
) -> Outcome:
    """Merges the parts of a dataset, which were made from one recipe with different ``scenes`` or as shards. The result
    equals the dataset of one run, byte for byte. The parts stay as they are.

    Args:
        parts: Folders or URLs of the parts, or folders of such folders.
        out: Folder or URL of the merged dataset, new or from an earlier call.
        threads: Number of threads. Default: all cores.
        partial: Merge the shards that exist, although others are missing.
        mixed_devices: Merge parts that different devices rendered. Their images may differ by rounding.
        allow_code: Run programs that write files at the end of a run.
        progress: Shows progress, or receives every event; see `Progress`.

    Raises:
        SyntableError: If the parts do not belong together, or a file cannot be written. The same call continues.
    """
    if isinstance(parts, (str, os.PathLike)):
        raise TypeError(f"parts is a list of folders, such as [{os.fspath(parts)!r}]")
    folders = [path(part, f"parts[{number}]") for number, part in enumerate(parts)]
    switches = {"partial": partial, "mixed_devices": mixed_devices, "allow_code": allow_code}
    flags = [name for name, is_on in switches.items() if is_on]
    found = _syntable.merge(folders, path(out, "out"), thread_count(threads), flags, listener(progress))
    return Outcome(**found)


@dataclass(frozen=True)
class DatasetProgress:
    """How far a dataset is.

    Attributes:
        scenes: Number of scenes of the recipe, or of the shard.
        done: Scenes that are in the dataset.
        failed: Scenes that could not be made.
        missing: Scenes that are neither done nor failed.
        images: Number of images in the dataset.
        scenes_per_hour: Pace of the latest scenes; None if there are too few, or no run is active.
        left_s: Time until all scenes are made at this pace, s.
    """

    scenes: int
    done: int
    failed: int
    missing: int
    images: int
    scenes_per_hour: float | None
    left_s: float | None


@dataclass(frozen=True)
class DatasetStatus(DatasetProgress):
    """How far a dataset is, and whether a run is writing it.

    Attributes:
        path: Its folder.
        shard: The shard that it is, such as ``3/10``; None if it is no shard.
        running: Whether a run is writing it now.
        finished: Whether its last run ended: the annotation files have all scenes.
        faults: Faults of its journal.
    """

    path: str
    shard: str | None
    running: bool
    finished: bool
    faults: list[str]


@dataclass(frozen=True)
class Status:
    """How far some datasets are.

    Attributes:
        datasets: Each dataset.
        missing_shards: Shards that are in no folder, such as ``3/10``; empty if the folder of one shard is the only one
            named.
        total: All datasets and missing shards together.
    """

    datasets: list[DatasetStatus]
    missing_shards: list[str]
    total: DatasetProgress


def status(*datasets: str | os.PathLike[str]) -> Status:
    """Shows how far datasets are while they are made, perhaps by other processes. Does not disturb runs.

    Args:
        datasets: Folders or URLs of datasets, or of shards such as ``data/mine.shards``.

    Raises:
        SyntableError: If a folder has no dataset, or cannot be read.
        TypeError: Without a folder.
    """
    if not datasets:
        raise TypeError("status takes the folders of datasets, such as status('data/mine')")
    found = _syntable.status([path(dataset, f"datasets[{number}]") for number, dataset in enumerate(datasets)])
    each = [DatasetStatus(path=one.pop("dataset"), **{"shard": None, "faults": [], **one}) for one in found["datasets"]]
    return Status(datasets=each, missing_shards=found["missing_shards"], total=DatasetProgress(**found["total"]))


@dataclass(frozen=True)
class Verification:
    """The files of a dataset, compared with what the run wrote.

    Attributes:
        whole: Whether every file is unchanged, and all runs ended.
        scenes: Number of finished scenes.
        files: Number of compared files.
        missing: Missing files.
        damaged: Files of different size or content.
        faults: Unreadable lines of the journal. Only the scenes of the other lines were compared.
        unlisted: Files of scenes whose list of files or line of the journal is lost, by scene.
        foreign: Other files that no list names.
        links: Links in the folder, with their targets.
        linked: Listed files that are links or behind one, and were not compared.
        outside: Lists with foreign names, with the reason.
        bad_scenes: Scenes with a missing or damaged file.
        unfinished: Whether the last run did not end.
    """

    whole: bool
    scenes: int
    files: int
    missing: list[str]
    damaged: list[str]
    faults: list[str]
    unlisted: dict[int, list[str]]
    foreign: list[str]
    links: dict[str, str]
    linked: list[str]
    outside: dict[str, str]
    bad_scenes: list[int]
    unfinished: bool

    def __bool__(self) -> bool:
        return self.whole


def verify(dataset: Dataset | str | os.PathLike[str], *, threads: int | None = None) -> Verification:
    """Compares the files of a dataset of `run` with its journal, without changing it.

    Args:
        dataset: The dataset, or its folder or URL. No run may be writing it.
        threads: Number of threads. Default: all cores.

    Raises:
        SyntableError: If the folder has no dataset. Differences do not raise.
    """
    found = _syntable.verify(named(dataset)[0], thread_count(threads))
    found.update({name: dict(found[name]) for name in ("unlisted", "links", "outside")})
    return Verification(**found)


@dataclass(frozen=True)
class Conversion:
    """The result of a conversion. It is true if the new dataset is complete.

    Attributes:
        path: Folder of the new dataset.
        format: Format of the dataset that was converted.
        images: Number of images.
        lacking: Products that the new formats can store and the dataset lacks.
        left_out: What the new dataset leaves out; empty if it is complete.
    """

    path: str
    format: str
    images: int
    lacking: list[str]
    left_out: list[str]

    @property
    def complete(self) -> bool:
        """Whether nothing is left out: the command would end with exit code 0."""
        return not self.left_out

    def __bool__(self) -> bool:
        return self.complete


def convert(
    dataset: Dataset | str | os.PathLike[str],
    out: str | os.PathLike[str],
    *formats: str,
    threads: int | None = None,
    progress: Progress = None,
    **options: Mapping[str, Any],
) -> Conversion:
    """Writes a dataset in other formats.

    Args:
        dataset: A dataset, or its path.
        out: Folder of the result: new, or empty.
        formats: Kinds of writers, such as ``"coco"``.
        threads: Number of threads. Default: all cores.
        progress: Shows progress, or receives every event; see `Progress`.
        options: Options of writers by kind, such as ``coco={"masks": "visible"}``.

    Raises:
        TypeError: If no format is named.
        SyntableError: If the dataset cannot be opened, or nothing can be written.
    """
    if not formats:
        raise TypeError("name the formats to write, such as convert(dataset, out, 'coco')")
    settings = [
        f"{kind}.{_toml.key(key)}={_toml.value(value, f'{kind}.{key}')}"
        for kind, table in options.items()
        for key, value in table.items()
    ]
    found = _syntable.convert(
        named(dataset), list(formats), path(out, "out"), settings, thread_count(threads), listener(progress)
    )
    return Conversion(path=path(out, "out"), **found)


@dataclass(frozen=True)
class Fault:
    """A fault of a dataset.

    Attributes:
        check: Name of the check that found it.
        place: An image, an annotation or a file.
        message: The fault in words.
    """

    check: str
    place: str
    message: str


@dataclass(frozen=True)
class Validation:
    """The checks of a dataset's labels.

    Attributes:
        format: Format of the dataset.
        images: Number of images.
        checks: The checks: ``check``, what it ``says``, number of ``images`` and of ``faults``.
        faults: All faults, by check and place.
    """

    format: str
    images: int
    checks: list[dict[str, Any]]
    faults: list[Fault]

    @property
    def sound(self) -> bool:
        """Whether no check found a fault."""
        return not self.faults

    def __bool__(self) -> bool:
        return self.sound


def validate(
    dataset: Dataset | str | os.PathLike[str],
    *,
    threads: int | None = None,
    progress: Progress = None,
) -> Validation:
    """Checks the labels of a dataset: masks, rates, boxes, order, depth, poses, files.

    Raises:
        SyntableError: If the path has no dataset, or its format is unknown. Faults do not raise.
    """
    found = _syntable.validate(named(dataset), thread_count(threads), listener(progress))
    faults = [Fault(**fault) for fault in found.pop("faults")]
    return Validation(faults=faults, **found)
