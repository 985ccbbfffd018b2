"""Assets whose materials mean the same in every renderer.

The scenes of the comparison of correctness are built of them: Lambert's diffuse surfaces (dielectrics with an index of
refraction of one, which reflect nothing), metals that are smooth enough for masking models not to matter, clear glass,
and an emissive ball.
"""

from pathlib import Path

import numpy as np

import glb
from glb import Part


def matte(color: list[float], texture: int | None = None) -> dict:
    """Lambert's diffuse surface."""
    return _material(color, 0.0, 1.0, texture, KHR_materials_ior={"ior": 1.0})


def metal(color: list[float], roughness: float) -> dict:
    """A metal of that reflectance at normal incidence."""
    return _material(color, 1.0, roughness)


def glass() -> dict:
    """Smooth clear glass that fills a closed body."""
    volume = {"thicknessFactor": 0.01}
    return _material(
        [1.0] * 3, 0.0, 0.0, KHR_materials_transmission={"transmissionFactor": 1.0}, KHR_materials_volume=volume
    )


def emissive(nits: list[float]) -> dict:
    """A black emissive body."""
    brightest = max(nits)
    strength = {"emissiveStrength": brightest}
    material = _material([0.0] * 3, 0.0, 1.0, KHR_materials_ior={"ior": 1.0}, KHR_materials_emissive_strength=strength)
    return {**material, "emissiveFactor": [x / brightest for x in nits]}


def _material(color: list[float], metallic: float, roughness: float, texture: int | None = None, **extensions) -> dict:
    pbr = {"baseColorFactor": [*color, 1.0], "metallicFactor": metallic, "roughnessFactor": roughness}
    if texture is not None:
        pbr["baseColorTexture"] = {"index": texture}
    return {"pbrMetallicRoughness": pbr, "extensions": extensions} if extensions else {"pbrMetallicRoughness": pbr}


def sheet(positions: np.ndarray, normals: np.ndarray, material: dict) -> Part:
    """A curved surface over a grid of points, `[rows, columns, 3]`; faces look where the normals do."""
    rows, columns = positions.shape[:2]
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1, 1)
    quads = np.hstack([corner, corner + columns, corner + 1, corner + 1, corner + columns, corner + columns + 1])
    # Rounded, so that both sides of a seam are the same points.
    positions, normals, triangles = np.round(positions.reshape(-1, 3), 7), normals.reshape(-1, 3), quads.reshape(-1, 3)
    a, b, c = (positions[triangles[:, i]] for i in range(3))
    facing = np.cross(b - a, c - a)
    triangles = triangles[np.linalg.norm(facing, axis=1) > 1e-12]
    if np.sum(facing * normals[quads.reshape(-1, 3)[:, 0]]) < 0:
        triangles = triangles[:, ::-1]
    return Part(positions, normals, None, triangles.astype(np.int32), material)


def ball(radius: float, material: dict, rows: int = 64) -> Part:
    """A sphere."""
    around, polar = np.meshgrid(np.linspace(0, 2 * np.pi, 2 * rows + 1), np.linspace(0, np.pi, rows + 1))
    normals = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], -1)
    return sheet(radius * normals, normals, material)


def ring(radius: float, thickness: float, material: dict) -> Part:
    """A torus around z."""
    around, across = np.meshgrid(np.linspace(0, 2 * np.pi, 193), np.linspace(0, 2 * np.pi, 97))
    outwards = np.stack([np.cos(around), np.sin(around), np.zeros_like(around)], -1)
    normals = outwards * np.cos(across)[..., None] + [0, 0, 1] * np.sin(across)[..., None]
    return sheet(radius * outwards + thickness * normals, normals, material)


def box(low: list[float], high: list[float], material: dict) -> Part:
    """A box with flat faces and a whole image on each."""
    low, high = np.array(low), np.array(high)
    positions, normals, uvs, triangles = [], [], [], []
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    for axis in range(3):
        for sign in (-1, 1):
            corners = np.zeros((4, 3))
            corners[:, axis] = sign > 0
            corners[:, (axis + 1) % 3], corners[:, (axis + 2) % 3] = square.T
            first = len(positions) * 4
            order = [0, 1, 2, 0, 2, 3] if sign > 0 else [0, 2, 1, 0, 3, 2]
            triangles.append(first + np.array(order).reshape(-1, 3))
            positions.append(low + corners * (high - low))
            normals.append(np.tile(sign * np.eye(3)[axis], (4, 1)))
            uvs.append(square.astype(float))
    return Part(*map(np.concatenate, (positions, normals, uvs)), np.concatenate(triangles).astype(np.int32), material)


def checker(size: int, colors: list[list[int]], cells: int) -> np.ndarray:
    """An image of soft squares and a slope, so that filtering and the decoding of sRGB both count."""
    y, x = np.mgrid[0:size, 0:size] / size
    waves = 0.5 + 0.5 * np.sin(2 * np.pi * cells * x) * np.sin(2 * np.pi * cells * y)
    mixed = waves[..., None] * colors[0] + (1 - waves[..., None]) * np.array(colors[1])
    return np.round(mixed * (0.5 + 0.5 * x[..., None])).astype(np.uint8)


def write(folder: Path) -> None:
    """Writes the tray and the objects."""
    objects, trays = folder / "objects", folder / "trays"
    for parent in (objects, trays):
        parent.mkdir(parents=True, exist_ok=True)
    half, wall, rise = 0.45, 0.02, 0.22
    white = matte([0.8, 0.8, 0.8])
    side = half + wall
    tray = [
        box([-side, -side, 0.4], [side, side, 0.42], matte([1.0, 1.0, 1.0], 0)),
        box([-side, -side, 0.42], [-half, side, 0.42 + rise], matte([0.75, 0.12, 0.08])),
        box([half, -side, 0.42], [side, side, 0.42 + rise], matte([0.1, 0.55, 0.15])),
        box([-half, half, 0.42], [half, side, 0.42 + rise], white),
        box([-half, -side, 0.42], [half, -half, 0.42 + rise], white),
    ]
    glb.write(trays / "tray.glb", tray, [checker(512, [[230, 215, 190], [90, 110, 140]], 6)])
    cube = lambda edge, material: box([-edge / 2] * 3, [edge / 2] * 3, material)
    stripes = checker(256, [[250, 200, 40], [30, 60, 200]], 3)
    glb.write(objects / "matte_ball.glb", [ball(0.07, matte([0.7, 0.35, 0.15]))])
    glb.write(
        objects / "matte_box.glb", [box([-0.08, -0.05, -0.06], [0.08, 0.05, 0.06], matte([1.0] * 3, 0))], [stripes]
    )
    glb.write(objects / "mirror_ball.glb", [ball(0.06, metal([1.0, 1.0, 1.0], 0.0))])
    glb.write(objects / "gold_ring.glb", [ring(0.06, 0.02, metal([0.95, 0.64, 0.3], 0.15))])
    glb.write(objects / "copper_ball.glb", [ball(0.05, metal([0.9, 0.5, 0.35], 0.3))])
    glb.write(objects / "glass_ball.glb", [ball(0.06, glass(), rows=128)])
    glb.write(objects / "glass_block.glb", [cube(0.1, glass())])
    glb.write(objects / "light_ball.glb", [ball(0.035, emissive([900.0, 600.0, 300.0]))])
