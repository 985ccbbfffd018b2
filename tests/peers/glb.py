"""Binary glTF 2.0: a reader of what the `gltf` writer writes, and a writer of small assets.

The reader knows the extensions and `extras` that book/src/export.md names. Poses are those below the root node `world`:
z up, meters, so that they are the dataset's own.
"""

import io
import json
import struct
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from PIL import Image

COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942


@dataclass
class Part:
    """Triangles of one material. Arrays may be None where the file has none."""

    positions: np.ndarray
    normals: np.ndarray | None
    uvs: np.ndarray | None
    triangles: np.ndarray
    material: dict


@dataclass
class Body:
    """A body with a mesh; `instance` is its id in the labels, None for lights."""

    name: str
    instance: int | None
    world_from_body: np.ndarray
    parts: list[Part]


@dataclass
class Camera:
    """A pinhole; the frame is OpenCV's: x right, y down, z forward."""

    width: int
    height: int
    k: np.ndarray
    world_from_camera: np.ndarray


@dataclass
class Scene:
    """A file: its bodies and lights, its first camera, notes on environment maps, and its images on demand."""

    folder: Path
    bodies: list[Body]
    camera: Camera
    environments: list[dict]
    document: dict
    binary: bytes
    decoded: dict[int, np.ndarray] = field(default_factory=dict)

    def image(self, texture: int) -> np.ndarray:
        """Texels of a texture, `[height, width, 3 or 4]` of uint8, row 0 at the top."""
        image = self.document["textures"][texture]["source"]
        if image not in self.decoded:
            view = self.document["bufferViews"][self.document["images"][image]["bufferView"]]
            start = view.get("byteOffset", 0)
            encoded = self.binary[start : start + view["byteLength"]]
            self.decoded[image] = np.array(Image.open(io.BytesIO(encoded)))
        return self.decoded[image]

    def wrap(self, texture: int) -> str:
        """How a texture goes on beyond its edges, in Mitsuba's words."""
        sampler = self.document["samplers"][self.document["textures"][texture]["sampler"]]
        return {10497: "repeat", 33648: "mirror", 33071: "clamp"}[sampler.get("wrapS", 10497)]

    def triangles(self) -> int:
        """Number of triangles of all bodies."""
        return sum(len(part.triangles) for body in self.bodies for part in body.parts)


def read(path: Path) -> Scene:
    """Reads a file of the `gltf` writer."""
    document, binary = _chunks(path.read_bytes())
    bodies, cameras = [], []
    for node in document["nodes"]:
        if "mesh" in node:
            bodies.append(_body(document, binary, node))
        elif "camera" in node:
            cameras.append(_camera(document, node))
        elif "extensions" in node:
            raise ValueError(f"{path}: light `{node['name']}` has no body; suns are not translated")
    if not cameras:
        raise ValueError(f"{path}: no camera")
    environments = document["scenes"][0].get("extras", {}).get("environments", [])
    return Scene(path.parent, bodies, cameras[0], environments, document, binary)


def _chunks(data: bytes) -> tuple[dict, bytes]:
    magic, version, _ = struct.unpack_from("<4sII", data)
    if (magic, version) != (b"glTF", 2):
        raise ValueError("not a binary glTF 2.0 file")
    size, kind = struct.unpack_from("<II", data, 12)
    assert kind == JSON_CHUNK
    document, at = json.loads(data[20 : 20 + size]), 20 + size
    size, kind = struct.unpack_from("<II", data, at)
    assert kind == BINARY_CHUNK
    return document, data[at + 8 : at + 8 + size]


def _array(document: dict, binary: bytes, index: int | None) -> np.ndarray | None:
    if index is None:
        return None
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    kind, width = np.dtype(COMPONENTS[accessor["componentType"]]), WIDTHS[accessor["type"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    return np.frombuffer(binary, kind, accessor["count"] * width, start).reshape(-1, width)


def _body(document: dict, binary: bytes, node: dict) -> Body:
    def part(primitive: dict) -> Part:
        attribute = lambda name: _array(document, binary, primitive["attributes"].get(name))
        triangles = _array(document, binary, primitive["indices"]).reshape(-1, 3).astype(np.int32)
        material = document["materials"][primitive["material"]]
        return Part(attribute("POSITION"), attribute("NORMAL"), attribute("TEXCOORD_0"), triangles, material)

    parts = [part(primitive) for primitive in document["meshes"][node["mesh"]]["primitives"]]
    return Body(node["name"], node.get("extras", {}).get("instance_id"), _pose(node), parts)


def _camera(document: dict, node: dict) -> Camera:
    extras = document["cameras"][node["camera"]]["extras"]
    if "distortion" in extras or "lens" in extras:
        raise ValueError("lens distortion and depth of field are not translated")
    # glTF's cameras look along -z with y up.
    world_from_camera = _pose(node) @ np.diag([1.0, -1.0, -1.0, 1.0])
    return Camera(extras["width"], extras["height"], np.array(extras["K"]), world_from_camera)


def _pose(node: dict) -> np.ndarray:
    x, y, z, w = node.get("rotation", [0, 0, 0, 1])
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, :3] *= node.get("scale", [1, 1, 1])
    pose[:3, 3] = node.get("translation", [0, 0, 0])
    return pose


def write(path: Path, parts: list[Part], textures: list[np.ndarray] = ()) -> None:
    """Writes one body as an asset. Parts are z up; materials refer to `textures` by index."""
    blob, views, accessors, materials, primitives = bytearray(), [], [], [], []

    def view(data: bytes) -> int:
        blob.extend(bytes(-len(blob) % 4))
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(data)})
        blob.extend(data)
        return len(views) - 1

    def accessor(array: np.ndarray, kind: str, component: int) -> int:
        bounds = {"min": array.min(0).tolist(), "max": array.max(0).tolist()} if kind == "VEC3" else {}
        array = np.ascontiguousarray(array, COMPONENTS[component])
        views_index = view(array.tobytes())
        accessors.append(
            {"bufferView": views_index, "componentType": component, "count": len(array), "type": kind, **bounds}
        )
        return len(accessors) - 1

    for part in parts:
        attributes = {"POSITION": accessor(part.positions, "VEC3", 5126)}
        if part.normals is not None:
            attributes["NORMAL"] = accessor(part.normals, "VEC3", 5126)
        if part.uvs is not None:
            attributes["TEXCOORD_0"] = accessor(part.uvs, "VEC2", 5126)
        indices = accessor(part.triangles.reshape(-1), "SCALAR", 5125)
        materials.append(part.material)
        primitives.append({"attributes": attributes, "indices": indices, "material": len(materials) - 1})
    images = []
    for texture in textures:
        file = io.BytesIO()
        Image.fromarray(texture).save(file, "PNG")
        images.append({"bufferView": view(file.getvalue()), "mimeType": "image/png"})
    used = sorted({name for material in materials for name in material.get("extensions", {})})
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "matrix": [1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1]}],
        "meshes": [{"primitives": primitives}],
        "materials": materials,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(blob)}],
    }
    if images:
        document["images"] = images
        document["samplers"] = [{"magFilter": 9729, "minFilter": 9987}]
        document["textures"] = [{"source": i, "sampler": 0} for i in range(len(images))]
    if used:
        document["extensionsUsed"] = used
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    blob.extend(bytes(-len(blob) % 4))
    size = 28 + len(text) + len(blob)
    with path.open("wb") as file:
        file.write(struct.pack("<4sIIII", b"glTF", 2, size, len(text), JSON_CHUNK) + text)
        file.write(struct.pack("<II", len(blob), BINARY_CHUNK) + blob)
