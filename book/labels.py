#!/usr/bin/env python3
"""Draws the image of the page on what is written from a dataset that the recipe of that page made.

    syntable run book/labels.toml --out target/labels && python3 book/labels.py target/labels

Needs NumPy, Pillow and pycocotools.
"""

import colorsys
import json
import pathlib
import sys

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from pycocotools import mask as coco_mask

root = pathlib.Path(sys.argv[1])
line = next(json.loads(line) for line in (root / "labels.jsonl").open())
name = f'{line["scene"]:06}_{line["view"]:04}'
rgb = np.array(Image.open(root / "png/rgb" / f"{name}.png"))
array = lambda product: np.load(root / "npy" / product / f"{name}.npy")
masks = lambda product: {int(i): coco_mask.decode(rle) > 0 for i, rle in line[product].items()}
visible, amodal, occlusion = masks("visible_mask"), masks("amodal_mask"), masks("occlusion_mask")
ids = sorted(visible)
color = {i: np.array(colorsys.hsv_to_rgb(k * 0.618 % 1, 0.75, 1)) * 255 for k, i in enumerate(ids)}
layer_color = {"top": (80, 200, 90), "intermediate": (70, 120, 230), "bottom": (240, 200, 60)}


def painted(of, shares=lambda i: color[i], over=rgb * 0.45):
    out = over.astype(float).copy()
    for i, mask in of.items():
        out[mask] = 0.35 * out[mask] + 0.65 * np.asarray(shares(i))
    return out


def drawn(draw):
    image = Image.fromarray((rgb * 0.55).astype(np.uint8))
    draw(ImageDraw.Draw(image), lambda i: tuple(color[i].astype(int)))
    return np.array(image)


def gray(values, low=None, high=None):
    finite = np.isfinite(values)
    low = values[finite].min() if low is None else low
    high = np.percentile(values[finite], 99) if high is None else high
    shade = np.where(finite, 255 * (1 - np.clip((values - low) / (high - low), 0, 1)), 0)
    return np.repeat(shade[..., None], 3, axis=2)


def boxes(draw, of):
    for i, (x, y, w, h) in line["visible_box"].items():
        draw.rectangle((x, y, x + w - 1, y + h - 1), outline=of(int(i)))


def rotated(draw, of):
    for i, box in line["amodal_rotated_box"].items():
        draw.polygon([tuple(p) for p in box["corners_px"]], outline=of(int(i)))


def outlines(draw, of):
    for i, outline in line["amodal_outline"].items():
        for ring in outline["polygons"] + outline["holes"]:
            draw.polygon(list(zip(ring[::2], ring[1::2])), outline=of(int(i)))


def cuboids(draw, of):
    edges = [(a, a | 1 << bit) for a in range(8) for bit in range(3) if not a >> bit & 1]
    for i, cuboid in line["cuboid"].items():
        for a, b in edges:
            p, q = cuboid["corners_px"][a], cuboid["corners_px"][b]
            if p and q:
                draw.line((*p, *q), fill=of(int(i)))


def graph(draw, of):
    center = {i: tuple(np.argwhere(visible[i]).mean(axis=0)[::-1]) for i in ids if visible[i].any()}
    for i, j in line["occlusion_graph"]["edges"]:
        if i in center and j in center:
            draw.line((*center[i], *center[j]), fill=(255, 255, 255))
    for i, (x, y) in center.items():
        draw.ellipse((x - 4, y - 4, x + 4, y + 4), fill=layer_color[line["occlusion_layer"][str(i)]])


most = max(ids, key=lambda i: occlusion[i].sum())
at = ids.index(most)
amodal_depth = array("amodal_depth")
amodal_coordinates = array("amodal_object_coordinates")
boundary = array("occlusion_boundary")
sides = (rgb * 0.3).astype(float)
sides[boundary == 1], sides[boundary == 2] = (255, 170, 40), (60, 120, 255)
parts = np.zeros_like(rgb, dtype=float)
parts[array("tabletop_mask") > 0], parts[array("background_mask") > 0] = (150, 110, 70), (70, 80, 95)
parts[array("category_map") > 0] = (230, 230, 230)
hidden = np.where(np.isfinite(amodal_depth[at])[..., None], gray(amodal_depth[at]), rgb * 0.3)
whole = array("appearance")[at].astype(float)
checks = 255 * (0.75 + 0.15 * ((np.indices(rgb.shape[:2]) // 8).sum(axis=0) % 2))[..., None]
whole = whole[..., :3] * whole[..., 3:] / 255 + checks * (1 - whole[..., 3:] / 255)
normals = array("amodal_normal")[at]
tiles = [
    ("rgb", rgb),
    ("visible_mask", painted(visible)),
    ("amodal_mask", painted(amodal)),
    ("occlusion_mask", painted(occlusion)),
    ("visible_box", drawn(boxes)),
    ("amodal_rotated_box", drawn(rotated)),
    ("amodal_outline", drawn(outlines)),
    ("cuboid", drawn(cuboids)),
    ("occlusion_graph, occlusion_layer", drawn(graph)),
    ("occlusion_boundary", sides),
    ("tabletop_mask, background_mask, category_map", parts),
    ("distance", gray(array("distance"))),
    ("amodal_depth of the most hidden object", hidden),
    ("object_coordinates", 255 * array("object_coordinates")),
    ("amodal_object_coordinates of the same object", 255 * amodal_coordinates[at]),
    ("normal", 127.5 * (array("normal") * (1, -1, -1) + 1)),
    ("amodal_normal of the same object", np.where(normals.any(axis=2, keepdims=True), 127.5 * (normals * (1, -1, -1) + 1), rgb * 0.3)),
    ("appearance of the same object", whole),
]
height, width = rgb.shape[:2]
COLUMNS = 3
sheet = Image.new("RGB", (COLUMNS * (width + 6) - 6, -(-len(tiles) // COLUMNS) * (height + 22)), "white")
font = ImageFont.load_default(13)
for k, (title, tile) in enumerate(tiles):
    x, y = k % COLUMNS * (width + 6), k // COLUMNS * (height + 22)
    sheet.paste(Image.fromarray(np.clip(tile, 0, 255).astype(np.uint8)), (x, y + 18))
    ImageDraw.Draw(sheet).text((x + 2, y + 1), title, fill="black", font=font)
sheet.save(pathlib.Path(__file__).parent / "src/images/labels.jpg", quality=82)
