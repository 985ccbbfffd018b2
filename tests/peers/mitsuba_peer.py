"""The same scene in Mitsuba 3.

Materials whose meaning is the same in both renderers are translated exactly: Lambert's (a dielectric with an index of
refraction of one), perfect mirrors, clear smooth glass, emissive surfaces. All others become Mitsuba's `principled`, which is
alike in cost and in looks and for smooth metals the same, but is another model; or, with `exact`, glTF's model as
gltf_bsdf.py has it, without clear coats and sheen.
"""

import os
import tempfile
import time
from pathlib import Path

import numpy as np

import glb


def find_llvm() -> None:
    """Points Dr.Jit to the newest LLVM of the system, unless the user did."""
    if "DRJIT_LIBLLVM_PATH" not in os.environ:
        found = sorted(Path("/usr/lib").glob("*-linux-gnu/libLLVM.so.*"), key=lambda path: path.name)
        if found:
            os.environ["DRJIT_LIBLLVM_PATH"] = str(found[-1])


find_llvm()
import mitsuba as mi  # noqa: E402

# `cuda_ad_rgb` renders on a card.
VARIANT = os.environ.get("MITSUBA_VARIANT", "llvm_ad_rgb")
mi.set_variant(VARIANT)
import gltf_bsdf  # noqa: E402, F401 (registers itself)

# Bounces after which faint paths may end; the default of our renderer.
ROULETTE_FROM = 3
ROUGH_GLASS = 0.05


class Peer:
    """A scene loaded into Mitsuba."""

    name = f"Mitsuba {mi.__version__}" + (" (CUDA)" if "cuda" in VARIANT else "")

    def __init__(self, scene: glb.Scene, bounces: int, exact: bool = False):
        description = {"type": "scene", "sensor": _sensor(scene.camera)}
        with tempfile.TemporaryDirectory() as folder:
            for number, body in enumerate(scene.bodies):
                for part, shape in enumerate(_shapes(scene, body, Path(folder) / f"{number}", exact)):
                    description[f"body_{number}_{part}"] = shape
            for number, note in enumerate(scene.environments):
                description[f"environment_{number}"] = _environment(scene.folder, note)
            self._scene = mi.load_dict(description)
        # A path of one bounce has two segments.
        path = {"type": "path", "max_depth": bounces + 1, "rr_depth": ROULETTE_FROM + 1}
        self._integrator = mi.load_dict(path)
        self._guides = mi.load_dict({"type": "aov", "aovs": "albedo:albedo,normal:sh_normal"})

    def render(self, samples: int, seed: int) -> tuple[np.ndarray, float]:
        """Radiance `[height, width, 3]` and the seconds that it took."""
        return self._timed(self._integrator, samples, seed)

    def guides(self, samples: int, seed: int) -> tuple[np.ndarray, float]:
        """Albedo and normal at the first hit, `[height, width, 6]`, and the seconds that they took."""
        return self._timed(self._guides, samples, seed)

    def _timed(self, integrator, samples: int, seed: int) -> tuple[np.ndarray, float]:
        start = time.perf_counter()
        image = np.array(mi.render(self._scene, integrator=integrator, spp=samples, seed=seed))
        return image, time.perf_counter() - start


def _sensor(camera: glb.Camera) -> dict:
    k = camera.k
    width, height = camera.width, camera.height
    if abs(k[0, 0] / k[1, 1] - 1) > 1e-6 or abs(k[0, 2] - width / 2) > 1e-6 or abs(k[1, 2] - height / 2) > 1e-6:
        raise ValueError("only square pixels and a principal point in the center are translated")
    film = {
        "type": "hdrfilm",
        "width": width,
        "height": height,
        "pixel_format": "rgb",
        "component_format": "float32",
        "rfilter": {"type": "box"},
    }
    return {
        "type": "perspective",
        "fov_axis": "x",
        "fov": float(np.degrees(2 * np.arctan(width / (2 * k[0, 0])))),
        "near_clip": 0.01,
        # Mitsuba's cameras look along z with y up and x to the left.
        "to_world": _transform(camera.world_from_camera @ np.diag([-1.0, -1.0, 1.0, 1.0])),
        "film": film,
        "sampler": {"type": "independent"},
    }


def _transform(matrix: np.ndarray):
    return mi.ScalarTransform4f(np.asarray(matrix, np.float64).tolist())


def _shapes(scene: glb.Scene, body: glb.Body, stem: Path, exact: bool):
    """The parts of a body; lights become the shapes that they represent."""
    shapes = {"light": None, "(sphere)": "sphere", "(rectangle)": "rectangle", "(disk)": "disk"}
    shape = shapes.get(body.name.split()[-1]) if body.instance is None else None
    if shape:
        black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
        to_world = _transform(body.world_from_body)
        yield {"type": shape, "to_world": to_world, "bsdf": black, "emitter": _emitter(body.parts[0].material)}
        return
    for number, part in enumerate(body.parts):
        path = stem.with_name(f"{stem.name}_{number}.ply")
        _write_ply(path, part)
        mesh = {
            "type": "ply",
            "filename": str(path),
            "face_normals": part.normals is None,
            "to_world": _transform(body.world_from_body),
            "bsdf": bsdf(scene, part.material, exact),
        }
        if any(part.material.get("emissiveFactor", [])):
            mesh["emitter"] = _emitter(part.material)
        yield mesh


def _write_ply(path: Path, part: glb.Part) -> None:
    columns = [("xyz", part.positions), (("nx", "ny", "nz"), part.normals), ("uv", part.uvs)]
    columns = [(names, values) for names, values in columns if values is not None]
    names = [name for group, _ in columns for name in group]
    vertices = np.hstack([values for _, values in columns]).astype("<f4")
    faces = np.zeros(len(part.triangles), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, part.triangles
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header\n"]
    path.write_bytes("\n".join(header).encode() + vertices.tobytes() + faces.tobytes())


def _emitter(material: dict) -> dict:
    return {"type": "area", "radiance": {"type": "rgb", "value": _emission(material)}}


def _emission(material: dict) -> list[float]:
    strength = _extension(material, "emissive_strength").get("emissiveStrength", 1.0)
    return [x * strength for x in material["emissiveFactor"]]


def _extension(material: dict, name: str) -> dict:
    return material.get("extensions", {}).get(f"KHR_materials_{name}", {})


def bsdf(scene: glb.Scene, material: dict, exact: bool) -> dict:
    """A material of glTF in Mitsuba's words."""
    pbr = material["pbrMetallicRoughness"]
    passing = _extension(material, "transmission").get("transmissionFactor", 0.0)
    metallic, roughness = pbr.get("metallicFactor", 1.0), pbr.get("roughnessFactor", 1.0)
    color = pbr.get("baseColorFactor", [1.0] * 4)[:3]
    plain = "baseColorTexture" not in pbr and "metallicRoughnessTexture" not in pbr
    if passing > 0.5:
        return _glass(material, roughness)
    if metallic == 0 and _extension(material, "ior").get("ior", 1.5) == 1.0:
        flat = {"type": "diffuse", "reflectance": _color(scene, pbr, "baseColor")}
    elif plain and metallic == 1 and roughness == 0 and min(color) == 1:
        flat = {"type": "conductor", "material": "none"}
    else:
        flat = _bumped(scene, material, _gltf(scene, material) if exact else _principled(scene, material))
    flat = {"type": "twosided", "bsdf": flat}
    cutoff = material.get("alphaCutoff", 0.5) if material.get("alphaMode") == "MASK" else None
    if cutoff is None or "baseColorTexture" not in pbr:
        return flat
    alpha = scene.image(pbr["baseColorTexture"]["index"])[..., 3] / 255
    opacity = _bitmap(scene, pbr["baseColorTexture"], np.float32(alpha >= cutoff)[..., None], raw=True)
    return {"type": "mask", "opacity": opacity, "bsdf": flat}


def _glass(material: dict, roughness: float) -> dict:
    ior = _extension(material, "ior").get("ior", 1.5)
    if not _extension(material, "volume"):
        return {"type": "thindielectric", "int_ior": ior, "ext_ior": 1.0}
    if roughness < ROUGH_GLASS:
        return {"type": "dielectric", "int_ior": ior, "ext_ior": 1.0}
    return {"type": "roughdielectric", "distribution": "ggx", "alpha": roughness**2, "int_ior": ior, "ext_ior": 1.0}


def _principled(scene: glb.Scene, material: dict) -> dict:
    pbr = material["pbrMetallicRoughness"]
    coat, sheen = _extension(material, "clearcoat"), _extension(material, "sheen")
    found = {
        "type": "principled",
        "base_color": _color(scene, pbr, "baseColor"),
        "roughness": _number(scene, pbr, "roughnessFactor", "metallicRoughnessTexture", 1),
        "metallic": _number(scene, pbr, "metallicFactor", "metallicRoughnessTexture", 2),
        "eta": max(_extension(material, "ior").get("ior", 1.5), 1.01),
    }
    if coat.get("clearcoatFactor", 0.0) > 0:
        found["clearcoat"] = coat["clearcoatFactor"]
        found["clearcoat_gloss"] = 1.0 - coat.get("clearcoatRoughnessFactor", 0.0)
    if max(sheen.get("sheenColorFactor", [0.0])) > 0:
        found["sheen"] = max(sheen["sheenColorFactor"])
    return found


def _gltf(scene: glb.Scene, material: dict) -> dict:
    pbr = material["pbrMetallicRoughness"]
    gray = lambda value: value if isinstance(value, dict) else {"type": "rgb", "value": [value] * 3}
    return {
        "type": "gltf",
        "base_color": _color(scene, pbr, "baseColor"),
        "roughness": gray(_number(scene, pbr, "roughnessFactor", "metallicRoughnessTexture", 1)),
        "metallic": gray(_number(scene, pbr, "metallicFactor", "metallicRoughnessTexture", 2)),
        "ior": _extension(material, "ior").get("ior", 1.5),
    }


def _bumped(scene: glb.Scene, material: dict, flat: dict) -> dict:
    """With the material's normal map, its strength worked into the texels."""
    normal = material.get("normalTexture")
    if normal is None:
        return flat
    texels = scene.image(normal["index"])[..., :3] / 127.5 - 1
    texels[..., :2] *= normal.get("scale", 1.0)
    texels /= np.linalg.norm(texels, axis=-1, keepdims=True)
    return {
        "type": "normalmap",
        "use_shadowing_function": False,
        "normalmap": _bitmap(scene, normal, np.float32(texels / 2 + 0.5), raw=True),
        "bsdf": flat,
    }


def _color(scene: glb.Scene, pbr: dict, name: str) -> dict:
    factor = np.array(pbr.get(f"{name}Factor", [1.0] * 4)[:3])
    info = pbr.get(f"{name}Texture")
    if info is None:
        return {"type": "rgb", "value": factor.tolist()}
    texels = scene.image(info["index"])[..., :3]
    if np.all(factor == 1):
        return _bitmap(scene, info, texels, raw=False)
    return _bitmap(scene, info, np.float32(_linear(texels) * factor), raw=True)


def _linear(texels: np.ndarray) -> np.ndarray:
    """sRGB decoded (IEC 61966-2-1)."""
    x = texels / 255.0
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def _number(scene: glb.Scene, pbr: dict, factor: str, texture: str, channel: int):
    info, factor = pbr.get(texture), float(pbr.get(factor, 1.0))
    if info is None:
        return factor
    texels = scene.image(info["index"])[..., channel : channel + 1]
    return _bitmap(scene, info, np.float32(texels / 255.0 * factor), raw=True)


def _bitmap(scene: glb.Scene, info: dict, texels: np.ndarray, raw: bool) -> dict:
    wrap = scene.wrap(info["index"])
    bitmap = mi.Bitmap(np.ascontiguousarray(texels))
    laid = {"to_uv": _laid(info["extensions"]["KHR_texture_transform"])} if "extensions" in info else {}
    return {"type": "bitmap", "bitmap": bitmap, "raw": raw, "wrap_mode": wrap, **laid}


def _laid(transform: dict):
    """KHR_texture_transform: scaled, rotated, shifted."""
    (x, y), turn = transform.get("offset", [0, 0]), transform.get("rotation", 0.0)
    (sx, sy), s, c = transform.get("scale", [1, 1]), np.sin(turn), np.cos(turn)
    return mi.ScalarTransform3f([[c * sx, s * sy, x], [-s * sx, c * sy, y], [0, 0, 1]])


def _environment(folder: Path, note: dict) -> dict:
    turn = note["rotation_rad"]
    c, s = np.cos(turn), np.sin(turn)
    # Mitsuba's maps have y up and z in their center; ours have z up and x in their center.
    axes = np.array([[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    rotated = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    bitmap = mi.Bitmap(read_hdr(folder / note["file"]))
    return {"type": "envmap", "bitmap": bitmap, "to_world": _transform(rotated @ axes)}


def read_hdr(path: Path) -> np.ndarray:
    """An image in Radiance's format without run lengths, `[height, width, 3]`."""
    header, texels = path.read_bytes().split(b"\n\n", 1)
    size, texels = texels.split(b"\n", 1)
    _, height, _, width = size.split()
    rgbe = np.frombuffer(texels, np.uint8).reshape(int(height), int(width), 4)
    scale = np.ldexp(1.0, rgbe[..., 3:].astype(int) - 136)
    return np.float32((rgbe[..., :3] + 0.5) * scale * (rgbe[..., 3:] > 0))
