"""Scores of predictions."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypedDict, Union

import numpy as np
import numpy.typing as npt

from . import _syntable
from ._arguments import optional_path, whole
from .datasets import Dataset, named
from .errors import SyntableError
from .generating import thread_count
from .progress import Progress, listener, warn

__all__ = ["Evaluation", "Masks", "Prediction", "evaluate"]

Masks = Union[npt.NDArray[Any], Sequence[Any], Any]
"""Masks of objects: an array or a tensor, objects × height × width (or objects × 1 × height × width, as torchvision's
detectors return), of truth values, of integers (nonzero inside), or of probabilities (from 0.5 inside); or a list of
`Mask`, of arrays, or of COCO's run lengths (dicts with ``size`` and ``counts``)."""


class _Needed(TypedDict):
    masks: Masks


class Prediction(_Needed, total=False):
    """Predicted objects of an image.

    ``masks`` are the visible masks, and the only necessary field. Fields have an entry for each object: ``scores``
    (default: 1), ``labels`` (ids of categories as in ``Dataset.categories``), ``amodal_masks`` (default: ``masks`` with
    ``occlusion_masks``), ``occlusion_masks`` (hidden parts), ``occluded`` (whether the detector says so).
    """

    scores: Any
    labels: Any
    amodal_masks: Masks
    occlusion_masks: Masks
    occluded: Any


_FIELDS = ("masks", "scores", "labels", "amodal_masks", "occlusion_masks", "occluded")
#: Fields of torchvision's detectors that do not matter here.
_IGNORED = ("boxes", "image_id", "ids", "area", "iscrowd")


@dataclass(frozen=True, repr=False)
class Evaluation:
    """Scores of predictions, in percent. ``str()`` shows them as tables; a score that is undefined is None.

    ``evaluation["visible_mask_ap"]`` is any score by its name; ``scores`` has all.

    Attributes:
        images: Number of images.
        objects: Number of labeled objects.
        predictions: Number of predictions with sufficient scores.
        convention: How images are combined: ``release`` or ``paper``.
        scores: All scores by name.
        intervals: 95 % confidence intervals by name; None unless they were asked for.
        csv: Scores of each image, as CSV.
        left_out: Images that could not be read, and were not scored.
    """

    images: int
    objects: int
    predictions: int
    convention: str
    scores: dict[str, float | None]
    intervals: dict[str, tuple[float, float] | None] | None
    csv: str = field(repr=False)
    left_out: list[str]
    _json: dict[str, Any] = field(repr=False, compare=False)
    _text: str = field(repr=False, compare=False)

    @property
    def amodal_f(self) -> float | None:
        """Overlap F of amodal masks."""
        return self.scores.get("amodal_overlap_f")

    @property
    def visible_f(self) -> float | None:
        """Overlap F of visible masks."""
        return self.scores.get("visible_overlap_f")

    @property
    def invisible_f(self) -> float | None:
        """Overlap F of hidden parts."""
        return self.scores.get("invisible_overlap_f")

    @property
    def amodal_boundary_f(self) -> float | None:
        """Boundary F of amodal masks."""
        return self.scores.get("amodal_boundary_f")

    @property
    def visible_boundary_f(self) -> float | None:
        """Boundary F of visible masks."""
        return self.scores.get("visible_boundary_f")

    @property
    def amodal_f75(self) -> float | None:
        """F@.75 of amodal masks: share of objects that are found with an F of at least 0.75."""
        return self.scores.get("amodal_f75")

    @property
    def amodal_ap(self) -> float | None:
        """COCO's AP of amodal masks, regardless of class."""
        return self.scores.get("amodal_mask_ap")

    @property
    def visible_ap(self) -> float | None:
        """COCO's AP of visible masks, regardless of class."""
        return self.scores.get("visible_mask_ap")

    @property
    def occlusion_accuracy(self) -> float | None:
        """ACC_O: share of matched objects whose occlusion is classified correctly."""
        return self.scores.get("acc_o")

    @property
    def occlusion_f(self) -> float | None:
        """F_O: F of the class of occluded objects."""
        return self.scores.get("f_o")

    @property
    def order_accuracy(self) -> float | None:
        """ACC_OO: share of the correct entries of the occlusion order."""
        return self.scores.get("acc_oo")

    @property
    def by_image(self) -> dict[str, dict[str, float | None]]:
        """Scores of each image by its name, in the order of the dataset, with the numbers of its ``objects`` and
        ``predictions``."""
        found = {}
        for line in csv.DictReader(io.StringIO(self.csv)):
            name = line.pop("image")
            found[name] = {score: float(value) if value else None for score, value in line.items()}
        return found

    def __getitem__(self, name: str) -> float | None:
        """A score by its name.

        Raises:
            KeyError: If there is no such score.
        """
        if name not in self.scores:
            raise KeyError(f"there is no score {name!r}, only {', '.join(self.scores)}")
        return self.scores[name]

    def to_dict(self) -> dict[str, Any]:
        """The same as ``syntable eval --json`` prints."""
        return self._json

    def __str__(self) -> str:
        return self._text.rstrip()

    def __repr__(self) -> str:
        main = {
            "amodal F": self.amodal_f,
            "visible F": self.visible_f,
            "amodal AP": self.amodal_ap,
            "visible AP": self.visible_ap,
            "ACC_O": self.occlusion_accuracy,
        }
        shown = ", ".join(f"{name} {value:.1f}" for name, value in main.items() if value is not None)
        return f"Evaluation({self.images} images, {self.objects} objects, {self.predictions} predictions: {shown})"

    def _repr_html_(self) -> str:
        import html

        return f"<pre>{html.escape(str(self))}</pre>"


def evaluate(
    dataset: Dataset | str | os.PathLike[str],
    predictions: (
        Dataset | str | os.PathLike[str] | Iterable[Prediction | Mapping[str, Any]] | Mapping[int | str, Prediction]
    ),
    *,
    min_score: float = 0.5,
    occluded_from: float | None = None,
    convention: str = "release",
    metrics: Iterable[str] = (),
    by_category: bool = False,
    bootstrap: int | None = None,
    seed: int = 0,
    save: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    worst: int | None = 24,
    worst_by: str | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> Evaluation:
    """Scores predictions against the labels of a dataset.

        predictions = [{"masks": net(sample.rgb) > 0.5, "scores": scores} for sample in dataset]
        print(st.evaluate(dataset, predictions))

    Args:
        dataset: Ground truth with amodal and visible masks: a dataset, or its path.
        predictions: A dict of arrays or tensors for each image, in the order of the dataset; see `Prediction`. Or a
            dict of such dicts, by the image's place or name; images without an entry have no predictions. Or files: a
            dataset with predicted masks, or a JSON list of results. Without ``scores``, COCO's scores are None, and a
            warning names what is missing.
        min_score: Minimum score of a prediction. COCO's scores use all predictions.
        occluded_from: Minimum occlusion rate of an occluded prediction; 0 for any hidden pixel, as in labels. Default:
            any hidden pixel if predictions have occlusion masks, else 0.05.
        convention: ``release``: F and F@.75 are means over images. ``paper``: F is computed from mean precision and
            recall, and F@.75 over all objects.
        metrics: Names of metrics (see ``syntable list metrics``). Default: all.
        by_category: Add COCO's scores with categories.
        bootstrap: Number of samples of the images for 95 % confidence intervals.
        seed: Seed of these samples.
        save: File for all scores and the worst images with their predictions: pass it to `report` or `view` as
            ``scores``.
        overwrite: Replace this file if it exists.
        worst: Number of worst images in this file; None for all.
        worst_by: Score by which images are the worst. Default: ``amodal_overlap_f``.
        threads: Number of threads; scores do not depend on it. Default: all cores.
        progress: Shows progress, or receives every event; see `Progress`.

    Raises:
        TypeError: If predictions have another form.
        ValueError: If an argument has no such value, arrays of an image have different lengths, or a mask of floats has
            a value that is no probability.
        SyntableError: If the dataset or a file cannot be read, masks have another size than their image, or the file to
            save exists.
    """
    truth, file = named(dataset), optional_path(save, "save")
    options = {
        "min_score": _number(min_score, "min_score"),
        "occluded_from": None if occluded_from is None else _number(occluded_from, "occluded_from", 0.0, 1.0),
        "convention": convention,
        "metrics": [metrics] if isinstance(metrics, str) else list(metrics),
        "by_category": bool(by_category),
        "bootstrap": None if bootstrap is None else whole(bootstrap, "bootstrap", 1, 100_000),
        "seed": whole(seed, "seed", 0, 2**64 - 1),
        "worst_by": worst_by,
        "worst": None if worst is None else whole(worst, "worst", 0),
        "save": file,
    }
    if file is not None and not overwrite and os.path.exists(file):
        help = "pass overwrite=True, or name another file"
        raise SyntableError(f"{file}: `save` would replace this file ({help})", file=file, help=help)
    given: Any
    if isinstance(predictions, (Dataset, str, os.PathLike)):
        given = named(predictions, "predictions")
    else:
        count = len(dataset if isinstance(dataset, Dataset) else Dataset(dataset))
        given = list(_objects(predictions, count))
    found = _syntable.evaluate(truth, given, options, thread_count(threads), listener(progress))
    json = found["json"]
    precisions = [value for name, value in json["scores"].items() if name.endswith("_ap")]
    if precisions and json["objects"] and json["predictions"] and all(value is None for value in precisions):
        warn(
            "the predictions have no scores, so that COCO's AP and AR are None: give each object a score, as in "
            "[{'masks': …, 'scores': …}, …]"
        )
    intervals = json.get("intervals")
    return Evaluation(
        images=json["images"],
        objects=json["objects"],
        predictions=json["predictions"],
        convention=json["convention"],
        scores=json["scores"],
        intervals=intervals and {name: ends and (ends[0], ends[1]) for name, ends in intervals.items()},
        csv=found["csv"],
        left_out=found["left_out"],
        _json=json,
        _text=found["text"],
    )


def _number(value: Any, name: str, least: float = float("-inf"), most: float = float("inf")) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{name} is a number, not {value!r}") from None
    if not (np.isfinite(number) and least <= number <= most):
        ends = "" if np.isinf(least) and np.isinf(most) else f" from {least:g} to {most:g}"
        raise ValueError(f"{name} is a finite number{ends}, not {value!r}")
    return number


def _objects(predictions: Any, count: int) -> Iterable[tuple[Any, ...]]:
    """All predicted objects, with their images."""
    if isinstance(predictions, Mapping):
        if "masks" in predictions:
            raise TypeError("predictions has a dict for each image: [{'masks': …}, …], or {image: {'masks': …}, …}")
        for image, of_image in predictions.items():
            if isinstance(image, str):
                yield from _of_image(of_image, image, f"predictions[{image!r}]")
            elif hasattr(image, "__index__") and not isinstance(image, bool):
                yield from _of_image(of_image, _place(image.__index__(), count), f"predictions[{image}]")
            else:
                raise TypeError(f"predictions: an image is its place or its name, not {image!r}")
        return
    is_array = isinstance(predictions, (bytes, np.ndarray)) or hasattr(predictions, "detach")
    if is_array or not isinstance(predictions, Iterable):
        kind = type(predictions).__name__
        raise TypeError(f"predictions is a list with a dict for each image, or files, not a {kind}")
    place = -1
    for place, of_image in enumerate(predictions):
        if place >= count:
            raise ValueError(f"predictions has more images than the dataset, which has {count}")
        yield from _of_image(of_image, place, f"predictions[{place}]")
    if place + 1 != count:
        remedy = "give a dict for each, or {image: dict}"
        raise ValueError(f"predictions has {place + 1} images, the dataset {count}: {remedy}")


def _place(place: int, count: int) -> int:
    if not -count <= place < count:
        raise ValueError(f"predictions: there is no image {place} in a dataset of {count}")
    return place % count


def _of_image(of_image: Any, image: int | str, place: str) -> Iterable[tuple[Any, ...]]:
    if not isinstance(of_image, Mapping):
        raise TypeError(f"{place} is a dict with 'masks', not a {type(of_image).__name__}")
    if "masks" not in of_image:
        raise ValueError(f"{place} has no 'masks'")
    unknown = [name for name in of_image if name not in _FIELDS and name not in _IGNORED]
    if unknown:
        raise ValueError(f"{place} has unknown fields {', '.join(map(repr, unknown))}: fields are {', '.join(_FIELDS)}")
    visible = _masks(of_image["masks"], f"{place}['masks']")

    def each(name: str, of: Any, default: Any) -> list[Any]:
        if of_image.get(name) is None:
            return [default] * len(visible)
        values = of(of_image[name], f"{place}[{name!r}]")
        if len(values) != len(visible):
            raise ValueError(f"{place} has {len(visible)} 'masks' and {len(values)} {name!r}")
        return list(values)

    columns = (
        each("scores", _numbers, 1.0),
        each("labels", _integers, None),
        visible,
        each("amodal_masks", _masks, None),
        each("occlusion_masks", _masks, None),
        each("occluded", _truths, None),
    )
    for row in zip(*columns):
        yield (image, *row)


def _array(value: Any) -> npt.NDArray[Any]:
    """A NumPy array of anything that is one, or a tensor on any device."""
    if hasattr(value, "detach"):
        value = value.detach().cpu()
    return np.asarray(value)


def _numbers(value: Any, place: str) -> list[float]:
    array = _array(value)
    if array.ndim != 1 or (array.size and array.dtype.kind not in "fiub"):
        raise TypeError(f"{place} is a number for each object, not {_shape(array)}")
    return [float(one) for one in array.tolist()]


def _integers(value: Any, place: str) -> list[int]:
    array = _array(value)
    if array.ndim != 1 or (array.size and array.dtype.kind not in "iu"):
        raise TypeError(f"{place} is an integer for each object, not {_shape(array)}")
    if array.size and not 0 <= int(array.min()) <= int(array.max()) < 2**32:
        raise ValueError(f"{place}: ids of categories are from 0 to 4294967295")
    return [int(one) for one in array.tolist()]


def _truths(value: Any, place: str) -> list[bool]:
    array = _array(value)
    if array.ndim != 1 or (array.size and array.dtype.kind != "b"):
        raise TypeError(f"{place} is a truth value for each object, not {_shape(array)}")
    return [bool(one) for one in array.tolist()]


def _masks(value: Any, place: str) -> list[_syntable.Mask]:
    if isinstance(value, _syntable.Mask):
        raise TypeError(f"{place} is a list of masks, not one mask")
    if isinstance(value, (list, tuple)):
        return [_mask(one, f"{place}[{number}]") for number, one in enumerate(value)]
    array = _array(value)
    if array.ndim == 4 and array.shape[1] == 1:
        array = array[:, 0]
    if array.ndim != 3:
        raise ValueError(f"{place} is an array of objects × height × width, not {_shape(array)}")
    return _syntable.masks_of(_inside(array, place))


def _mask(value: Any, place: str) -> _syntable.Mask:
    if isinstance(value, _syntable.Mask):
        return value
    if isinstance(value, Mapping):
        try:
            return _syntable.Mask.from_rle(dict(value))
        except (TypeError, ValueError) as error:
            raise type(error)(f"{place}: {error}") from None
    array = _array(value)
    if array.ndim != 2:
        raise ValueError(f"{place} is a mask of height × width, not {_shape(array)}")
    return _syntable.Mask(_inside(array, place))


def _inside(array: npt.NDArray[Any], place: str) -> npt.NDArray[np.bool_]:
    kind = array.dtype.kind
    if kind == "b":
        return np.asarray(array, dtype=np.bool_)
    if kind in "iu":
        return np.asarray(array != 0)
    if kind == "f":
        _check_probabilities(array, place)
        return np.asarray(array >= 0.5)
    raise TypeError(f"{place} is an array of truth values, integers or probabilities, not {_shape(array)}")


#: What interpolation may add to probabilities by rounding.
_ROUNDING = 1e-3


def _check_probabilities(array: npt.NDArray[Any], place: str) -> None:
    """Refuses logits and NaN, of which no threshold makes a mask."""
    # NaN makes both ends NaN, and the comparison false.
    if not array.size or (array.min() >= -_ROUNDING and array.max() <= 1 + _ROUNDING):
        return
    wrong = ~((array >= -_ROUNDING) & (array <= 1 + _ROUNDING))
    where = tuple(int(one) for one in np.argwhere(wrong)[0])
    # A single mask has no axis of objects, and its number is in the place.
    mask = f"{place}[{where[0]}]" if len(where) == 3 else place
    y, x = where[-2:]
    remedy = "" if np.isnan(array[where]) else ": apply a sigmoid to logits, or compare them with 0"
    raise ValueError(f"{mask} is {array[where]:g} at row {y}, column {x}; a probability is from 0 to 1{remedy}")


def _shape(array: npt.NDArray[Any]) -> str:
    return f"an array of {array.dtype} with the shape {array.shape}"
