"""Datasets: their images and labels, in any format that is read."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, overload

from . import _arguments, _syntable
from .progress import warn_left_out
from .samples import Sample

if TYPE_CHECKING:
    from .torch import DetectionDataset, Transform

__all__ = ["Dataset", "open"]


class Dataset(Sequence[Sample]):
    """A dataset of images with labels: ``dataset[7]`` is its eighth image, a slice is a list of images.

    Opening reads the labels' files; a sample reads its image when it is asked for. A dataset can be pickled, and used
    by several threads and processes.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        format: str | None = None,
        image_folder: str | os.PathLike[str] | None = None,
        trust_paths: bool = False,
    ) -> None:
        self._named = (
            _arguments.path(path, "path"),
            format,
            _arguments.optional_path(image_folder, "image_folder"),
            bool(trust_paths),
        )
        #: The arguments for another process, which may work in another folder.
        path = self._named[0]
        self._anywhere = (path if _syntable.is_url(path) else os.path.abspath(path), *self._named[1:])
        self._raw = _syntable.Dataset(*self._named)
        warn_left_out(self._raw.left_out)

    @property
    def path(self) -> str:
        """The path by which it was opened."""
        return self._named[0]

    @property
    def format(self) -> str:
        """Name of its format."""
        return self._raw.format

    @property
    def name(self) -> str:
        """Its name."""
        return self._raw.name

    @property
    def left_out(self) -> list[str]:
        """The parts that could not be read, with reasons, such as images of a damaged file. Opening warns of them, except
        for files that only other writers of the run made: these are opened here, or for their first product."""
        return self._raw.left_out + self._raw.left_out_of_others

    @property
    def products(self) -> list[str]:
        """Names of the products that its images have."""
        return self._raw.products

    @property
    def categories(self) -> dict[int, str]:
        """Names of its categories by id."""
        return dict(self._raw.categories)

    def __len__(self) -> int:
        return len(self._raw)

    @overload
    def __getitem__(self, index: int) -> Sample: ...
    @overload
    def __getitem__(self, index: slice) -> list[Sample]: ...
    def __getitem__(self, index: int | slice) -> Sample | list[Sample]:
        if isinstance(index, slice):
            return [self[one] for one in range(*index.indices(len(self)))]
        try:
            place = index.__index__()
        except AttributeError:
            raise TypeError(f"an image is named by its place, an integer, not {index!r}") from None
        place += len(self) if place < 0 else 0
        if not 0 <= place < len(self):
            raise IndexError(f"image {index} of a dataset of {len(self)} images")
        return Sample(self._raw.sample(place), (self._anywhere, place))

    def to_coco(self, out: str | os.PathLike[str], **options: Any) -> Dataset:
        """Writes it in the format of COCO, into a new or empty folder. Options are those of the writer ``coco``."""
        return self.convert(out, "coco", coco=options)

    def convert(self, out: str | os.PathLike[str], *formats: str, **options: dict[str, Any]) -> Dataset:
        """Writes it in other formats, into a new or empty folder; see `syntable.convert`.

        Returns:
            The folder, opened in the first of the formats.
        """
        from .verbs import convert

        settings: dict[str, Any] = dict(options)
        convert(self, out, *formats, **settings)
        return Dataset(out)

    def torch(self, transform: Transform | None = None, *, products: Iterable[str] = ()) -> DetectionDataset:
        """The images as a map-style dataset of PyTorch, in torchvision's form; see `syntable.torch.DetectionDataset`.

        Args:
            transform: A function of image and target, whose result is the sample.
            products: Further products for the target, such as ``["depth"]``.

        Raises:
            ImportError: Without PyTorch.
        """
        from .torch import DetectionDataset

        return DetectionDataset(self, transform, products=products)

    def __repr__(self) -> str:
        return f"Dataset({self.path!r}: {len(self)} images, {self.format})"

    def __reduce__(self) -> tuple[Any, ...]:
        return (_again, self._anywhere)


def _again(path: str, format: str | None, image_folder: str | None, trust_paths: bool) -> Dataset:
    """The dataset that pickle stored."""
    return Dataset(path, format=format, image_folder=image_folder, trust_paths=trust_paths)


def open(
    path: str | os.PathLike[str],
    *,
    format: str | None = None,
    image_folder: str | os.PathLike[str] | None = None,
    trust_paths: bool = False,
) -> Dataset:
    """Opens a dataset: a run's folder, or COCO, YOLO, BOP and every other format that ``syntable list formats`` names.

    Args:
        path: Its folder or its annotation file, or the URL of one in an object store, such as ``"s3://bucket/mine"``.
        format: Name of its format. Default: the one that it looks like.
        image_folder: Folder or URL of its images. Default: where the format puts them.
        trust_paths: Read files outside the dataset that it names.

    Raises:
        SyntableError: If the path does not exist, or no format reads it.
    """
    return Dataset(path, format=format, image_folder=image_folder, trust_paths=trust_paths)


def named(
    dataset: Dataset | str | os.PathLike[str], argument: str = "dataset"
) -> tuple[str, str | None, str | None, bool]:
    """A dataset as functions take it: an open one, or a path."""
    if isinstance(dataset, Dataset):
        return dataset._named
    if isinstance(dataset, (str, os.PathLike)):
        return (_arguments.path(dataset, argument), None, None, False)
    raise TypeError(f"a dataset is a Dataset or a path, not {dataset!r}")
