"""Samples: one view of a scene with its image, labels, camera and objects."""

from __future__ import annotations

import copy
import os
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
import numpy.typing as npt

from . import _syntable
from ._arguments import png_path
from .errors import SyntableError

if TYPE_CHECKING:
    import networkx  # type: ignore[import-not-found, import-untyped, unused-ignore]

    from .datasets import Dataset

__all__ = ["Camera", "Object", "Sample"]

_IDENTITY = np.eye(4)

#: An image of a dataset: the arguments that open the dataset, and the place of the image in it.
_Place = tuple[tuple[str, "str | None", "str | None", bool], int]


@dataclass(frozen=True, eq=False)
class Camera:
    """Camera of a view. Its frame is OpenCV's: x right, y down, z forward; lengths are meters.

    Attributes:
        K: Matrix of the intrinsics, 3 × 3, px. The center of the first pixel is at (0.5, 0.5).
        width: Width of the image, px.
        height: Height of the image, px.
        world_from_camera: Pose, 4 × 4, m; None if the dataset does not state it.
        distortion: Coefficients in the order of OpenCV's ``distCoeffs``; none for a lens without distortion.
        model: ``pinhole``, ``polynomial`` or ``fisheye`` (Kannala–Brandt).
        info: The whole record of the product ``camera``.
    """

    K: npt.NDArray[np.float64]
    width: int
    height: int
    world_from_camera: npt.NDArray[np.float64] | None
    distortion: npt.NDArray[np.float64]
    model: str
    info: dict[str, Any]

    @property
    def camera_from_world(self) -> npt.NDArray[np.float64] | None:
        """Inverse of the pose, 4 × 4: the extrinsics."""
        pose = self.world_from_camera
        return None if pose is None else np.linalg.inv(pose).astype(np.float64, copy=False)

    @classmethod
    def _of(cls, info: dict[str, Any]) -> Camera:
        pose = info.get("world_from_camera")
        lens = [name for name in info if name.startswith(("distortion_", "fisheye_"))]
        model = "pinhole" if not lens else "fisheye" if lens[0].startswith("fisheye_") else "polynomial"
        return cls(
            K=np.asarray(info["K"], dtype=np.float64),
            width=int(info["width"]),
            height=int(info["height"]),
            world_from_camera=None if pose is None else np.asarray(pose, dtype=np.float64),
            distortion=np.asarray(info[lens[0]] if lens else [], dtype=np.float64),
            model=model,
            info=info,
        )


@dataclass(frozen=True, eq=False)
class Object:
    """An annotated object of a view.

    Attributes:
        id: Its id in the scene, from 1: its value in ``visible_ids``, and its key in products.
        name: Name of its asset; empty if the dataset does not state it.
        category: Name of its category; empty if the dataset does not state it.
        category_id: Id of its category in annotation files; None if the dataset does not state it.
        world_from_object: Pose in the world, 4 × 4, m; None if the dataset does not state it.
        camera_from_object: Pose in the camera's frame, 4 × 4, m; None if the dataset does not state it.
        info: The whole record of the product ``object_info``: mass, inertia, size, license and more.
    """

    id: int
    name: str
    category: str
    category_id: int | None
    world_from_object: npt.NDArray[np.float64] | None
    camera_from_object: npt.NDArray[np.float64] | None
    info: dict[str, Any]


def _pose(info: dict[str, Any], name: str) -> npt.NDArray[np.float64] | None:
    return np.asarray(info[name], dtype=np.float64) if info.get(name) is not None else None


class Sample:
    """One view of a scene: its image, labels, camera and objects.

    ``sample["rgb"]`` and ``sample.rgb`` are products by name; ``sample.products`` lists them. A product per pixel is an
    array, one per object is a dict from the object's id, masks are `Mask`. Properties such as ``visible_masks`` put the
    values of all objects into one array, with a row for each of ``ids``.

    A sample of a dataset reads a product from its files when it is first asked for.

    A sample can be copied and pickled. The pickle of a made sample has all its products. That of a sample of a dataset
    has the products that were read, and opens the dataset by its path for the others: once in each process.
    """

    def __init__(self, raw: _syntable.Sample | _Held, place: _Place | None = None) -> None:
        self._raw = raw
        self._place = place
        self._made: dict[str, Any] = {}

    @property
    def scene(self) -> int:
        """Number of the scene, from 0."""
        return self._raw.scene

    @property
    def view(self) -> int:
        """Number of the view in its scene, from 0."""
        return self._raw.view

    @property
    def name(self) -> str:
        """Name of the image in its dataset; ``SCENE_VIEW`` of a sample that was made."""
        return self._raw.name

    @property
    def products(self) -> list[str]:
        """Names of the products that the sample has."""
        return self._raw.names()

    def __getitem__(self, product: str) -> Any:
        """A product by its name; None if this image of a dataset lacks it.

        Raises:
            KeyError: If the sample has no such product.
            TypeError: If the name is not text.
            SyntableError: If a file cannot be read.
        """
        if not isinstance(product, str):
            raise TypeError(f"a product is named by text, such as sample['rgb'], not {product!r}: see sample.products")
        if product not in self._made:
            self._made[product] = self._raw.get(product)
        return self._made[product]

    def __iter__(self) -> NoReturn:
        raise TypeError(
            "a sample is not iterable: sample.products has the names of its products, and sample['rgb'] is one of them"
        )

    def __contains__(self, product: str) -> bool:
        return isinstance(product, str) and self._raw.has(product)

    def __getattr__(self, product: str) -> Any:
        if product.startswith("_"):
            raise AttributeError(product)
        try:
            return self[product]
        except KeyError as error:
            raise AttributeError(error.args[0]) from None

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *(name for name in self.products if name.isidentifier())})

    @cached_property
    def ids(self) -> npt.NDArray[np.uint16]:
        """Ids of the annotated objects, ascending: the order of all arrays over objects."""
        return np.asarray(self._raw.ids(), dtype=np.uint16)

    def _masks(self, product: str) -> npt.NDArray[np.bool_]:
        key = f"{product} stacked"
        if key not in self._made:
            masks = self._raw.masks(product, self.ids.tolist())
            self._made[key] = masks if len(self.ids) else np.zeros((0, *self.shape), dtype=bool)
        stacked: npt.NDArray[np.bool_] = self._made[key]
        return stacked

    @property
    def visible_masks(self) -> npt.NDArray[np.bool_]:
        """Visible masks of all objects: objects × height × width."""
        return self._masks("visible_mask")

    @property
    def amodal_masks(self) -> npt.NDArray[np.bool_]:
        """Amodal masks of all objects, with their hidden parts: objects × height × width."""
        return self._masks("amodal_mask")

    @property
    def occlusion_masks(self) -> npt.NDArray[np.bool_]:
        """Hidden parts of all objects: objects × height × width."""
        if "occlusion_mask" in self:
            return self._masks("occlusion_mask")
        return self.amodal_masks & ~self.visible_masks

    def _rows(self, product: str, length: int | None, missing: float) -> npt.NDArray[np.float64]:
        each = self[product] or {}
        shape = (len(self.ids),) if length is None else (len(self.ids), length)
        rows = np.full(shape, missing, dtype=np.float64)
        for row, id in enumerate(self.ids.tolist()):
            if each.get(id) is not None:
                rows[row] = each[id]
        return rows

    @property
    def visible_boxes(self) -> npt.NDArray[np.float64]:
        """Boxes of the visible masks: objects × (x, y, width, height), px; zeros for a hidden object."""
        return self._rows("visible_box", 4, 0.0)

    @property
    def amodal_boxes(self) -> npt.NDArray[np.float64]:
        """Boxes of the amodal masks: objects × (x, y, width, height), px."""
        return self._rows("amodal_box", 4, 0.0)

    @property
    def occlusion_rates(self) -> npt.NDArray[np.float64]:
        """Hidden share of each object's amodal area, in [0, 1]; NaN where the dataset does not state it."""
        return self._rows("occlusion_rate", None, np.nan)

    @property
    def occlusion_order(self) -> npt.NDArray[np.bool_]:
        """Occlusion order adjacency matrix: entry (i, j) is true if object i occludes object j."""
        order: npt.NDArray[np.bool_] = self["occlusion_order"]
        if order is not None and order.shape != (len(self.ids),) * 2:
            ids = len(self.ids)
            raise SyntableError(f"{self.name}: the occlusion order has {len(order)} objects, the labels {ids}")
        return order

    def occlusion_graph(self) -> networkx.DiGraph:
        """The occlusion order as a graph: nodes are ids, and an edge leads from an occluder to what it hides.

        Raises:
            ImportError: Without the package ``networkx``.
        """
        import networkx

        graph = networkx.DiGraph()
        graph.add_nodes_from(self.ids.tolist())
        graph.add_edges_from((int(self.ids[i]), int(self.ids[j])) for i, j in np.argwhere(self.occlusion_order))
        return graph

    @cached_property
    def camera(self) -> Camera:
        """Intrinsics, lens and pose of the camera."""
        return Camera._of(self["camera"])

    @cached_property
    def objects(self) -> list[Object]:
        """The annotated objects, in the order of ``ids``."""
        each = self["object_info"] if "object_info" in self else None
        names = self["object_name"] if "object_name" in self else None
        categories = self["category_id"] if "category_id" in self else None
        objects = []
        for id in self.ids.tolist():
            info = (each or {}).get(id) or {}
            objects.append(
                Object(
                    id=id,
                    name=info.get("name") or (names or {}).get(id) or "",
                    category=info.get("category") or "",
                    category_id=(categories or {}).get(id),
                    world_from_object=_pose(info, "world_from_object"),
                    camera_from_object=_pose(info, "camera_from_object"),
                    info=info,
                )
            )
        return objects

    @cached_property
    def shape(self) -> tuple[int, int]:
        """Height and width of the image, px."""
        if "camera" in self and self["camera"] is not None:
            return (self.camera.height, self.camera.width)
        for name in ("rgb", "depth", "visible_ids", "instance"):
            if name in self and self[name] is not None:
                height, width = self[name].shape[:2]
                return (height, width)
        masks = next((each for each in map(self._some_masks, self.products) if each), None)
        if masks:
            return next(iter(masks.values())).shape
        raise SyntableError(f"{self.name}: no product states the size of the image")

    def _some_masks(self, product: str) -> dict[int, _syntable.Mask] | None:
        if not product.endswith("_mask"):
            return None
        each = self[product]
        return each if isinstance(each, dict) else None

    def read(self, *products: str) -> Sample:
        """Reads products of a dataset now, in one pass over its files. Returns the sample."""
        self._raw.read(list(products))
        return self

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes a PNG file that shows the image beside its labels, as a notebook does: visible parts filled, hidden
        parts striped, outlines of the amodal masks.

        Raises:
            ValueError: If the path does not end in ``.png``.
            SyntableError: If a product cannot be read.
            OSError: If the file cannot be written.
        """
        from .drawing import png, sheet

        file_path = png_path(path)
        image = png(sheet(self))
        with open(file_path, "wb") as file:
            file.write(image)

    def __repr__(self) -> str:
        return f"Sample({self.name}: {', '.join(self.products)})"

    def _state(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_raw"}

    def _with(self, raw: _syntable.Sample | _Held, state: dict[str, Any]) -> Sample:
        made = type(self).__new__(type(self))
        made.__dict__.update(state, _raw=raw)
        return made

    def __copy__(self) -> Sample:
        return self._with(self._raw, {**self._state(), "_made": dict(self._made)})

    def __deepcopy__(self, memo: dict[int, Any]) -> Sample:
        # The library gives every caller arrays of its own, so that the raw sample never changes.
        raw = copy.deepcopy(self._raw, memo) if isinstance(self._raw, _Held) else self._raw
        return self._with(raw, copy.deepcopy(self._state(), memo))

    def __reduce__(self) -> tuple[Any, ...]:
        if self._place is None:
            return (_held, (type(self), self._state(), _Held.of(self)))
        return (_stored, (type(self), self._state(), self.name))

    def _repr_png_(self) -> bytes | None:
        from .drawing import png, sheet

        try:
            return png(sheet(self))
        except (ImportError, SyntableError, KeyError):
            return None


@dataclass
class _Held:
    """The products of a sample that pickle stored. Its methods are those of the library's sample."""

    scene: int
    view: int
    name: str
    values: dict[str, Any]
    of_objects: list[int]

    @classmethod
    def of(cls, sample: Sample) -> _Held:
        values = {name: sample[name] for name in sample.products}
        return cls(sample.scene, sample.view, sample.name, values, sample.ids.tolist())

    def names(self) -> list[str]:
        return list(self.values)

    def has(self, name: str) -> bool:
        return name in self.values

    def get(self, name: str) -> Any:
        if name not in self.values:
            raise KeyError(_syntable.missing_product(name, list(self.values)))
        return self.values[name]

    def read(self, names: list[str]) -> None:
        for name in names:
            self.get(name)

    def ids(self) -> list[int]:
        return self.of_objects

    def masks(self, name: str, ids: list[int]) -> npt.NDArray[np.bool_]:
        each = self.get(name)
        if not isinstance(each, dict) or not all(isinstance(mask, _syntable.Mask) for mask in each.values()):
            raise SyntableError(f"`{name}` is not a mask per object")
        shape = next((mask.shape for mask in each.values()), (0, 0))
        stacked = np.zeros((len(ids), *shape), dtype=bool)
        for row, id in enumerate(ids):
            if id in each:
                stacked[row] = each[id].array()
        return stacked


def _held(kind: type[Sample], state: dict[str, Any], held: _Held) -> Sample:
    """The made sample that pickle stored."""
    sample = kind.__new__(kind)
    sample.__dict__.update(state, _raw=held)
    return sample


@lru_cache(maxsize=4)
def _opened(path: str, format: str | None, image_folder: str | None, trust_paths: bool) -> Dataset:
    """The dataset of samples that pickle stored: all samples of this process share it."""
    from .datasets import Dataset

    return Dataset(path, format=format, image_folder=image_folder, trust_paths=trust_paths)


def _stored(kind: type[Sample], state: dict[str, Any], name: str) -> Sample:
    """The sample of a dataset that pickle stored.

    Raises:
        SyntableError: If the dataset cannot be opened, or has another image at this place.
    """
    named, place = state["_place"]
    for _ in range(2):
        dataset = _opened(*named)
        if place < len(dataset) and dataset[place].name == name:
            sample = kind.__new__(kind)
            sample.__dict__.update(state, _raw=dataset[place]._raw)
            return sample
        # The dataset may have changed since it was opened here.
        _opened.cache_clear()
    raise SyntableError(f"{named[0]}: image {place} is not `{name}`, as it was when the sample was pickled")
