"""Scenes, lights and objects that stages return, checked."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ._arguments import Asset, PlacedScene
from ._calls import _Refused
from ._products import _as_array, _found


def _dicts(returned: Any, function: Any) -> list[Mapping[str, Any]]:
    if isinstance(returned, Mapping) or not isinstance(returned, Iterable):
        raise _Refused(f"a list of dicts is expected; found {_found(returned)}", function)
    found = list(returned)
    wrong = next((one for one in found if not isinstance(one, Mapping)), None)
    if wrong is not None:
        raise _Refused(f"a list of dicts is expected; found {_found(wrong)} in it", function)
    return found


class _Fields:
    """The fields of a dict that a stage returned."""

    def __init__(self, what: str, fields: Mapping[str, Any], known: Iterable[str], function: Any) -> None:
        self.what, self.fields, self.function = what, fields, function
        known = list(known)
        for key in fields:
            if key not in known:
                raise self.refused(f"unknown key {key!r}; it has {', '.join(known)}")

    def refused(self, message: str) -> _Refused:
        return _Refused(f"{self.what}: {message}", self.function)

    def array(self, key: str, shape: tuple[int | None, ...], default: Any = None) -> npt.NDArray[np.float64]:
        value = self.fields.get(key, default)
        if value is None:
            raise self.refused(f"`{key}` is missing")
        sizes = " × ".join("any" if n is None else str(n) for n in shape) or "a number"
        try:
            array = np.asarray(_as_array(value), dtype=np.float64)
        except (TypeError, ValueError):
            raise self.refused(f"`{key}` is {sizes} numbers, not {_found(value)}") from None
        if array.ndim != len(shape) or any(n not in (None, m) for n, m in zip(shape, array.shape)):
            raise self.refused(f"`{key}` has the shape {sizes}, not {array.shape}")
        if not np.isfinite(array).all():
            raise self.refused(f"`{key}` is not finite: {_found(value)}")
        return array

    def colors(self, key: str, shape: tuple[int | None, ...], default: Any = None) -> npt.NDArray[np.float64]:
        array = self.array(key, shape, default)
        wrong = array[(array < 0) | (array > 1)]
        if wrong.size:
            remedy = ": divide by 255, and convert sRGB to linear" if wrong[0] > 1 else ""
            raise self.refused(f"`{key}` is in [0, 1], linear Rec. 709, and has {wrong[0]:g}{remedy}")
        return array

    def vector(self, key: str) -> list[float]:
        """A vector that is not zero."""
        array = self.array(key, (3,))
        if not array.any():
            raise self.refused(f"`{key}` is zero")
        return [float(number) for number in array]

    def number(self, key: str, low: float, high: float, default: float | None = None) -> float:
        value = float(self.array(key, (), default))
        if not low <= value <= high:
            raise self.refused(f"`{key}` is between {low:g} and {high:g}, not {value:g}")
        return value

    def power(self, key: str) -> list[float]:
        value: Any = self.fields.get(key)
        array = self.array(key, () if np.ndim(value) == 0 else (3,))
        if (array < 0).any():
            raise self.refused(f"`{key}` is negative: {value!r}")
        return [float(number) for number in np.broadcast_to(array, (3,))]


_LIGHTS = {
    "sphere": ("type", "center", "radius", "radiance"),
    "rect": ("type", "center", "half_u", "half_v", "radiance"),
    "disk": ("type", "center", "normal", "radius", "radiance"),
    "directional": ("type", "towards", "half_angle", "irradiance"),
}


def _light(it: Mapping[str, Any], number: int, function: Any) -> tuple[Any, ...]:
    """A light as the library takes it: type, center, two vectors, power, and a number."""
    kind = it.get("type")
    if kind not in _LIGHTS:
        raise _Refused(f"light {number}: `type` is one of {', '.join(_LIGHTS)}, not {kind!r}", function)
    fields = _Fields(f"light {number}", it, _LIGHTS[kind], function)
    zero = [0.0, 0.0, 0.0]
    if kind == "directional":
        angle = fields.number("half_angle", 1e-6, np.pi / 2)
        return (kind, zero, fields.vector("towards"), zero, fields.power("irradiance"), angle)
    center, power = fields.array("center", (3,)).tolist(), fields.power("radiance")
    if kind == "rect":
        u, v = fields.vector("half_u"), fields.vector("half_v")
        if abs(np.dot(u, v)) > 1e-6 * np.linalg.norm(u) * np.linalg.norm(v):
            raise fields.refused("`half_u` and `half_v` are not at right angles")
        return (kind, center, u, v, power, 0.0)
    radius = fields.number("radius", 1e-6, 1e6)
    return (kind, center, fields.vector("normal") if kind == "disk" else zero, zero, power, radius)


_ROLES = ("object", "distractor", "support", "fixture")


def _placed(
    it: Mapping[str, Any], number: int, scene: PlacedScene, function: Any
) -> tuple[int, list[list[float]], str, bool]:
    """A body as the library takes it: number of its asset, pose, role, and whether it is fixed."""
    fields = _Fields(f"body {number}", it, ("asset", "pose", "fixed", "role"), function)
    asset, role, fixed = it.get("asset"), it.get("role", "object"), it.get("fixed", False)
    if not isinstance(asset, Asset):
        raise fields.refused(
            f"`asset` comes from scene.draw(pool) or scene.load(pool, name), and is not {_found(asset)}"
        )
    if asset._call is not scene._call:
        raise fields.refused(
            f"`asset` is {asset.pool}/{asset.name} of another scene: call scene.draw or scene.load in each scene"
        )
    if role not in _ROLES:
        raise fields.refused(f"`role` is one of {', '.join(_ROLES)}, not {role!r}")
    if not isinstance(fixed, (bool, np.bool_)):
        raise fields.refused(f"`fixed` is True or False, not {fixed!r}")
    pose = fields.array("pose", (4, 4))
    rotation = pose[:3, :3]
    is_rigid = np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-4) and np.linalg.det(rotation) > 0
    if not is_rigid or not np.allclose(pose[3], (0, 0, 0, 1)):
        raise fields.refused(f"`pose` is no rotation and translation: {pose.tolist()}")
    return asset._number, pose.tolist(), role, bool(fixed)


@dataclass(frozen=True)
class _Loaded:
    """An object, as the library takes it."""

    category: str
    vertices: npt.NDArray[np.float32]
    faces: npt.NDArray[np.uint32]
    colors: npt.NDArray[np.float32] | None
    color: list[float]
    roughness: float


#: Most characters of the name and the category of an asset.
_LONGEST = 200


def _fault_of_text(text: str, *, is_path: bool) -> str | None:
    """What is wrong with the name or the category of an asset. Names are paths in a pool, as those of files are."""
    if len(text) > _LONGEST:
        return f"has {len(text)} characters; at most {_LONGEST} are allowed"
    if any(unicodedata.category(one) in ("Cc", "Cs", "Zl", "Zp") for one in text):
        return "has a control character"
    if is_path and ("\\" in text or not all(part not in ("", ".", "..") for part in text.split("/"))):
        return "is no relative path, such as red or mugs/red"
    return None


def _shortened(text: str) -> str:
    return ascii(text) if len(text) <= 60 else f"{ascii(text[:57])}…"


def _catalog(names: Any, kind: str, function: Any) -> list[tuple[str, str]]:
    if isinstance(names, str) or not isinstance(names, Iterable):
        raise _Refused(f"names() returns a list of names, or a dict to categories, not {_found(names)}", function)
    pairs = list(names.items()) if isinstance(names, Mapping) else [(name, kind) for name in names]
    for name, category in pairs:
        if not isinstance(name, str) or not name or not isinstance(category, str):
            raise _Refused(f"names() returns texts, not {name!r}: {category!r}", function)
        for what, text in (("name", name), ("category", category)):
            fault = _fault_of_text(text, is_path=what == "name")
            if fault is not None:
                raise _Refused(f"names(): the {what} {_shortened(text)} {fault}", function)
    if len({name for name, _ in pairs}) < len(pairs):
        raise _Refused("names() returns a name twice", function)
    return pairs


def _loaded(it: Any, category: str, function: Any) -> _Loaded:
    if not isinstance(it, Mapping):
        raise _Refused(f"load(name) returns a dict, not {_found(it)}", function)
    fields = _Fields("load(name)", it, ("vertices", "faces", "colors", "color", "roughness"), function)
    vertices, faces = fields.array("vertices", (None, 3)), fields.array("faces", (None, 3))
    if (faces != np.floor(faces)).any() or faces.min(initial=0) < 0 or faces.max(initial=-1) >= len(vertices):
        raise fields.refused(f"`faces` are indices of the {len(vertices)} vertices, from 0")
    colors = None if it.get("colors") is None else fields.colors("colors", (len(vertices), 3)).astype(np.float32)
    color = fields.colors("color", (3,), (0.6,) * 3 if colors is None else (1.0,) * 3).tolist()
    roughness = fields.number("roughness", 0, 1, 0.5)
    return _Loaded(category, vertices.astype(np.float32), faces.astype(np.uint32), colors, color, roughness)
