"""PyTorch datasets of samples, in the form that torchvision's detectors train on.

A sample is a pair: an image, and a dict with its objects. ``collate`` keeps images of different sizes apart, as those
detectors expect them:

    from syntable.torch import collate

    loader = DataLoader(dataset.torch(), batch_size=4, collate_fn=collate)
    for images, targets in loader:
        losses = model(images, targets)
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

try:
    import torch  # type: ignore[import-not-found, unused-ignore]
    from torch.utils import data  # type: ignore[import-not-found, unused-ignore]
except ImportError:
    raise ImportError('samples as tensors need PyTorch: pip install "syntable[torch]"') from None

from .samples import Sample
from .training import Stream

__all__ = ["DetectionDataset", "DetectionStream", "Target", "Transform", "collate", "detection"]

Target = dict[str, Any]
"""The objects of an image: ``boxes``, ``labels``, ``masks`` and more; see `detection`."""

Transform = Callable[[torch.Tensor, Target], Any]
"""A function of image and target, such as a transform of ``torchvision.transforms.v2``."""


def detection(sample: Sample, *, image_id: int = 0, products: Iterable[str] = ()) -> tuple[torch.Tensor, Target]:
    """A sample as torchvision's detectors take it.

    Objects without a visible pixel are left out: a detector cannot learn an empty box.

    Args:
        sample: A sample with the products ``rgb`` and ``visible_mask``.
        image_id: Number of the image.
        products: Further products for the target, under their names: those per pixel become tensors, height × width or
            channels × height × width; those per object become lists in the order of the objects.

    Returns:
        The image, float, 3 × height × width, in [0, 1]; and the target: ``boxes`` (objects × (x1, y1, x2, y2), px, of
        the visible parts), ``labels`` (ids of categories, from 1; 1 without categories), ``masks`` and ``amodal_masks``
        (objects × height × width, uint8; amodal ones only if the sample has them), ``ids`` (of the objects in their
        scene) and ``image_id``.

    Raises:
        KeyError: If the sample lacks ``rgb`` or ``visible_mask``.
    """
    pixels = sample["rgb"]
    if pixels is None:
        raise KeyError(f"{sample.name}: the image has no `rgb`")
    image = torch.from_numpy(np.ascontiguousarray(pixels[..., :3])).permute(2, 0, 1).contiguous().to(torch.float32)
    image /= 255.0
    masks = sample.visible_masks
    seen = masks.any(axis=(1, 2))
    target: Target = {
        "boxes": torch.from_numpy(_boxes(masks[seen])),
        "labels": torch.from_numpy(_labels(sample)[seen]),
        "masks": torch.from_numpy(masks[seen].view(np.uint8)),
    }
    if "amodal_mask" in sample and sample["amodal_mask"] is not None:
        target["amodal_masks"] = torch.from_numpy(sample.amodal_masks[seen].view(np.uint8))
    ids = sample.ids[seen]
    target["ids"] = torch.from_numpy(ids.astype(np.int64))
    target["image_id"] = image_id
    for name in products:
        target[name] = _tensor(sample[name], ids.tolist())
    return image, target


def _boxes(masks: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Boxes of masks that have pixels: x1, y1, x2, y2."""
    columns, rows = np.asarray(masks.any(axis=1)), np.asarray(masks.any(axis=2))

    def ends(lines: np.ndarray[Any, Any]) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
        length = lines.shape[1]
        return lines.argmax(axis=1), length - lines[:, ::-1].argmax(axis=1)

    if len(masks) == 0:
        return np.zeros((0, 4), np.float32)
    (left, right), (top, bottom) = ends(columns), ends(rows)
    return np.stack([left, top, right, bottom], axis=1).astype(np.float32)


def _labels(sample: Sample) -> np.ndarray[Any, Any]:
    each = sample["category_id"] if "category_id" in sample else None
    return np.asarray([(each or {}).get(id, 1) for id in sample.ids.tolist()], dtype=np.int64)


def _tensor(value: Any, ids: Sequence[int]) -> Any:
    if isinstance(value, np.ndarray):
        if value.dtype == np.uint16:
            value = value.astype(np.int32)
        elif value.dtype in (np.uint32, np.uint64):
            value = value.astype(np.int64)
        tensor = torch.from_numpy(value)
        return tensor.permute(2, 0, 1).contiguous() if tensor.ndim == 3 else tensor
    if isinstance(value, Mapping) and value and all(isinstance(key, int) for key in value):
        return [value.get(id) for id in ids]
    return value


def collate(batch: Iterable[tuple[Any, ...]]) -> tuple[tuple[Any, ...], ...]:
    """A batch of pairs as a pair of tuples: images and targets, as torchvision's detectors take them."""
    return tuple(zip(*batch))


def _further(products: Iterable[str]) -> list[str]:
    if isinstance(products, str):
        raise TypeError(f"products is a list of names, such as [{products!r}]")
    return list(products)


class DetectionDataset(data.Dataset[Any]):  # type: ignore[misc, unused-ignore]
    """Images with their objects, by number.

    It works in a DataLoader with any number of workers. Samples of a dataset of files are read by them, started by
    ``fork`` or ``spawn``. Views of a recipe are made by threads of each process: take ``num_workers=0`` or ``spawn``.

    Args:
        samples: A `Dataset` or `Views`.
        transform: A function of image and target, whose result is the sample.
        products: Further products for the target; see `detection`.
    """

    def __init__(
        self, samples: Sequence[Sample], transform: Transform | None = None, *, products: Iterable[str] = ()
    ) -> None:
        if transform is not None and not callable(transform):
            raise TypeError(f"transform is a function of image and target, not {transform!r}")
        self.samples = samples
        self.transform = transform
        self.products = _further(products)

    def __len__(self) -> int:
        return len(self.samples)

    def __getitem__(self, index: int) -> Any:
        return self._made(self.samples[index], index)

    def __getitems__(self, indices: list[int]) -> list[Any]:
        several = getattr(self.samples, "__getitems__", None)
        samples = [self.samples[index] for index in indices] if several is None else several(indices)
        return [self._made(sample, index) for sample, index in zip(samples, indices)]

    def _made(self, sample: Sample, index: int) -> Any:
        index = int(index)
        made = detection(
            sample.read(*_needed(sample, self.products)),
            image_id=index if index >= 0 else index + len(self),
            products=self.products,
        )
        return made if self.transform is None else self.transform(*made)


class DetectionStream(data.IterableDataset[Any]):  # type: ignore[misc, unused-ignore]
    """Images with their objects, one after the other. ``image_id`` is the number of the view in the recipe.

    The stream shares its scenes among processes and workers. Take ``num_workers=0``: its threads work ahead anyway.

    Args:
        stream: The stream. Its ``state_dict`` and ``load_state_dict`` are here, too.
        transform: A function of image and target, whose result is the sample.
        products: Further products for the target; see `detection`.
    """

    def __init__(self, stream: Stream, transform: Transform | None = None, *, products: Iterable[str] = ()) -> None:
        if transform is not None and not callable(transform):
            raise TypeError(f"transform is a function of image and target, not {transform!r}")
        self.stream = stream
        self.transform = transform
        self.products = _further(products)

    def __iter__(self) -> Iterator[Any]:
        for sample in self.stream:
            number = sample.scene * self.stream.views_per_scene + sample.view
            made = detection(sample, image_id=number, products=self.products)
            yield made if self.transform is None else self.transform(*made)

    def state_dict(self) -> dict[str, int]:
        """The position in the stream."""
        return self.stream.state_dict()

    def load_state_dict(self, state: Mapping[str, int]) -> None:
        """Continues from a position."""
        self.stream.load_state_dict(state)


def _needed(sample: Sample, products: Sequence[str]) -> list[str]:
    """The products to read of a sample, all at once."""
    wanted = {"rgb", "visible_mask", "amodal_mask", "category_id", *products}
    return [name for name in sample.products if name in wanted]
