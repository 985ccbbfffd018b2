#!/usr/bin/env python3
"""Why images of ours and of Blender's Cycles differ: one plate, one light, one thing at a time.

    /tmp/peers/bin/python tests/peers/causes.py [gloss] [filtering] [bumps] [--book]

Needs what compare.py needs of Cycles: Python 3.11 with bpy, numpy and pillow. The plate goes out through the `gltf`
writer and is imported by the script that comes with it. Bumps are there twice: as a normal map, and as triangles, which
say what the bumps would do if they were real; there no renderer has a choice but that of the surface itself. With
`--book`, the tables go to the book.
"""

import argparse
import copy
import math
import sys
import tempfile
from pathlib import Path

import numpy as np

import assets
import glb
import measures
import ours
from book import ROOT, publish

sys.path.insert(0, str(ROOT / "tests"))
import compare_with_blender

# Illuminance of all lights, lx: a white matte plate that faces them, or lies under the even sky, has 1000 nits.
ILLUMINANCE = 1000 * math.pi
WAVES, SLOPE = 16, 0.15
PIXELS = (48, 36)

RECIPE = """
[dataset]
name = "causes"
scenes = 1
views_per_scene = 1

[assets.plates]
kind = "mesh_folder"
root = "${PEERS}"
center = "none"

[assets.balls]
kind = "household"
families = ["ball"]

[[place]]
kind = "table"
from = ["plates"]

[[place]]
kind = "drop_box"             # a recipe has an object: far above, out of sight
from = ["balls"]
count = 1
clearance_m = 95

[settle]
kind = "none"

[camera]
kind = "pinhole"

[views]
kind = "fixed_poses"

[render]
kind = "cpu_path"
pixel_filter = "box"

[write.gltf]

[write.npy]
include = ["radiance", "instance"]
"""


def dielectric(color: float, roughness: float) -> dict:
    """A gray under gloss."""
    pbr = {"baseColorFactor": [color] * 3 + [1.0], "metallicFactor": 0.0, "roughnessFactor": roughness}
    return {"pbrMetallicRoughness": pbr}


def slopes(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heights and slopes of waves both ways, whose slopes have a standard deviation of `SLOPE` along each axis."""
    k = 2 * np.pi * WAVES
    sx, sy, cx, cy = np.sin(k * x), np.sin(k * y), np.cos(k * x), np.cos(k * y)
    return 2 * SLOPE / k * sx * sy, 2 * SLOPE * cx * sy, 2 * SLOPE * sx * cy


def normals(along_x: np.ndarray, along_y: np.ndarray) -> np.ndarray:
    """Unit normals of a surface with these slopes."""
    up = np.stack([-along_x, -along_y, np.ones_like(along_x)], -1)
    return up / np.linalg.norm(up, axis=-1, keepdims=True)


def plate(folder: Path, material: dict, bumps: str = "none", roughness: np.ndarray | None = None) -> None:
    """Writes a plate of 1 m; `bumps` are "none", a "map" or "triangles"."""
    material, textures = copy.deepcopy(material), []
    points = 24 * WAVES + 1 if bumps == "triangles" else 2
    y, x = np.meshgrid(np.linspace(-0.5, 0.5, points), np.linspace(-0.5, 0.5, points), indexing="ij")
    height, *slope = slopes(x, y) if bumps == "triangles" else np.zeros((3, *x.shape))
    part = assets.sheet(np.stack([x, y, height], -1), normals(*slope), material)
    # One period is one image, whose rows go down.
    part.uvs = part.positions[:, :2] * [WAVES, -WAVES]
    if bumps == "map":
        u = (np.arange(256) + 0.5) / 256 / WAVES
        v, u = np.meshgrid(-u, u, indexing="ij")
        material["normalTexture"] = {"index": 0}
        textures = [np.round(127.5 + 127.5 * normals(*slopes(u, v)[1:])).astype(np.uint8)]
    if roughness is not None:
        material["pbrMetallicRoughness"]["metallicRoughnessTexture"] = {"index": 0}
        textures = [np.repeat(np.round(255 * roughness).astype(np.uint8)[..., None], 3, -1)]
    # A body must not be flat.
    below = assets.box([-0.5, -0.5, -0.2], [0.5, 0.5, -0.1], assets.matte([0.2] * 3))
    glb.write(folder / "plate.glb", [part, below], textures)


def sky() -> list[str]:
    """The same radiance from everywhere."""
    source = "source={constant={temperature_k=6500}}"
    return [f'lights=[{{kind="environment",{source},brightness={{illuminance_lx={ILLUMINANCE}}}}}]']


def sun(elevation: float, azimuth: float) -> list[str]:
    """The sun alone."""
    at = f"elevation_deg={elevation},azimuth_deg={azimuth},temperature_k=5500"
    return [f'lights=[{{kind="sun",{at},illuminance_lx={ILLUMINANCE}}}]']


class Bench:
    """Renders the plate from afar, from the azimuth 0."""

    def __init__(self, binary: Path, work: Path):
        self.binary, self.work, self.folder = binary, work, work / "plates"
        self.folder.mkdir(parents=True, exist_ok=True)
        (work / "causes.toml").write_text(RECIPE)

    def ours(self, lights: list[str], elevation: float, fine: int = 1, samples: int = 64, dielectrics="") -> float:
        """Mean luminance of the middle of the plate; pixels are `fine` times as fine."""
        distance, up = 20.0, math.radians(elevation)
        eye = [distance * math.cos(up), 0.0, distance * math.sin(up)]
        field = math.degrees(2 * math.atan(0.35 * math.sin(up) / distance))
        settings = lights + [
            f"camera.resolution={[fine * side for side in PIXELS]}",
            f"camera.intrinsics={{fov_deg={field}}}",
            f"views.poses=[{{look_at={{eye_m={eye},target_m=[0.0,0.0,0.0]}}}}]",
            f"render.samples_per_pixel={samples}",
        ]
        if dielectrics:
            settings.append(f'render.dielectrics="{dielectrics}"')
        folders = {"PEERS": self.folder}
        self.run = ours.run(self.binary, self.work / "causes.toml", self.work / "out", settings, folders)
        return self._mean(self.run.images()[0])

    def theirs(self, samples: int = 64) -> float:
        """The same of the scene that was rendered last, by Cycles."""
        height, width = self.run.instances().shape
        file = self.run.folder / "gltf" / "000000.glb"
        compare_with_blender.load(file, width, height)
        return self._mean(compare_with_blender.image(samples))

    def both(self, lights: list[str], elevation: float) -> tuple[float, float]:
        """Ours and theirs."""
        return self.ours(lights, elevation), self.theirs()

    def _mean(self, image: np.ndarray) -> float:
        height, width = image.shape[:2]
        middle = np.s_[height // 3 : 2 * height // 3, width // 3 : 2 * width // 3]
        assert (self.run.instances()[middle] == 2).all(), "the camera sees more than the plate"
        return float((image[middle] @ measures.LUMINANCE).mean())


def bumps(bench: Bench) -> list[str]:
    """Tables of bumps: what is real, and what normal maps make of it."""
    seen = ("seen from", lambda angle: (sky(), angle), [6, 12, 25, 50])
    cases = [("gloss", dielectric(0.0, 0.15), *seen), ("metal", assets.metal([1.0] * 3, 0.15), *seen)]
    cases += [("matte", assets.matte([0.5] * 3), "sun at", lambda angle: (sun(angle, 20), 60), [4, 10, 20, 40])]
    head = ["surface", "", "flat, ours", "Cycles", "triangles, ours", "Cycles", "map, ours", "Cycles"]
    rows = []
    for name, material, what, light, angles in cases:
        for angle in angles:
            found = []
            for kind in ("none", "triangles", "map"):
                plate(bench.folder, material, kind)
                found.append(bench.both(*light(angle)))
            flat, real, mapped = found
            row = [name, f"{what} {angle}°"] + [f"{x:.1f}" for x in (*flat, *real)]
            rows.append(row + [f"{x:.1f} ({100 * (x / y - 1):+.0f} %)" for x, y in zip(mapped, real)])
            print("  ".join(rows[-1]), file=sys.stderr, flush=True)
    return table(head, rows)


def gloss(bench: Bench) -> list[str]:
    """Table of gray under gloss by the elevation of the sun."""
    rows = []
    for roughness in (0.3, 0.6):
        plate(bench.folder, dielectric(0.5, roughness))
        for angle in (5, 10, 20, 45):
            plain = bench.ours(sun(angle, 90), 60, dielectrics="gltf")
            a, b = bench.both(sun(angle, 90), 60)
            rows.append([f"{roughness}", f"{angle}°"] + [f"{x:.2f}" for x in (a, plain, b)])
            rows[-1] += [f"{100 * (b / x - 1):+.1f} %" for x in (a, plain)]
            print("  ".join(rows[-1]), file=sys.stderr, flush=True)
    return table(["roughness", "sun at", "ours", "`gltf`", "Cycles", "Cycles over ours", "over `gltf`"], rows)


def filtering(bench: Bench) -> list[str]:
    """Table of a roughness that changes within a pixel, beside the highlight of the sun."""
    pattern = np.full((8, 8), 0.1)
    pattern[:3, :3] = 0.8
    pattern = np.tile(pattern, (8, 8))
    plate(bench.folder, dielectric(0.0, 1.0), roughness=pattern)
    rows = []
    for away in (3, 6, 12, 24):
        lights = sun(30 + away, 180)
        coarse = bench.ours(lights, 30)
        cycles = bench.theirs()
        fine = bench.ours(lights, 30, fine=32, samples=1)
        rows.append([f"{away}°"] + [f"{x:.2f}" for x in (coarse, fine, cycles)])
        print("  ".join(rows[-1]), file=sys.stderr, flush=True)
    return table(["sun off by", "ours", "ours, pixels 32 times as fine", "Cycles"], rows)


def table(head: list[str], rows: list[list[str]]) -> list[str]:
    """A table of Markdown."""
    return [f"| {' | '.join(row)} |" for row in [head, ["---"] * len(head), *rows]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parts = {"filtering": filtering, "gloss": gloss, "bumps": bumps}
    parser.add_argument("what", nargs="*", metavar="|".join(parts), help="tables to make; all if left out")
    parser.add_argument("--binary", type=Path, default=ROOT / "target" / "release" / "syntable")
    parser.add_argument("--book", action="store_true", help="write the tables to the book")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as work:
        bench = Bench(arguments.binary, Path(work))
        for name in arguments.what or parts:
            publish("\n".join(parts[name](bench)), name, "causes.py", arguments.book)


if __name__ == "__main__":
    main()
