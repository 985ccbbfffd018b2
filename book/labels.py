#!/usr/bin/env python3
"""Draws the images of the page on what is written from a dataset that the recipe of that page made.

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
lines = [json.loads(line) for line in (root / "labels.jsonl").open()]
line = lines[0]
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

# --- Numbers, drawn over the image or as a diagram -----------------------------------------------------------------------

height, width = rgb.shape[:2]
camera = line["camera"]
camera_from_world = np.linalg.inv(np.array(camera["world_from_camera"]))
intrinsics = np.array(camera["K"])
small = ImageFont.load_default(10)


def pixel(point, pose=camera_from_world):
    x, y, z = (pose @ [*point, 1])[:3]
    return tuple((intrinsics @ [x / z, y / z, 1])[:2]) if z > 0.05 else None


def segment(draw, a, b, fill, width=1, pose=camera_from_world):
    p, q = pixel(a, pose), pixel(b, pose)
    if p and q:
        draw.line((*p, *q), fill=fill, width=width)


def arrow(draw, p, q, fill, width=1):
    (x0, y0), (x1, y1) = p, q
    draw.line((x0, y0, x1, y1), fill=fill, width=width)
    length = max(np.hypot(x1 - x0, y1 - y0), 1e-6)
    u, v = (x1 - x0) / length, (y1 - y0) / length
    head = min(6, length)
    side = [(x1 - head * u + s * 0.5 * head * v, y1 - head * v - s * 0.5 * head * u) for s in (1, -1)]
    draw.polygon([(x1, y1), *side], fill=fill)


def label(draw, at, text, fill="white", size=small):
    left, top, right, bottom = draw.textbbox(at, text, font=size, anchor="mm")
    draw.rectangle((left - 1, top, right + 1, bottom), fill=(0, 0, 0))
    draw.text(at, text, fill=fill, font=size, anchor="mm")


def middle(mask):
    """A pixel of the mask that is near its center of gravity."""
    at = np.argwhere(mask)
    return tuple(at[np.abs(at - at.mean(axis=0)).sum(axis=1).argmin()][::-1])


def diagram(draw, background="white"):
    image = Image.new("RGB", (width, height), background)
    draw(ImageDraw.Draw(image))
    return np.array(image)


bodies = {body["id"]: body for body in line["bodies"]}
seen = [i for i in ids if visible[i].sum() > 60]


def names(draw, of):
    for i in seen:
        label(draw, middle(visible[i]), line["object_name"][str(i)], of(i))


def poses(draw, of):
    for i in ids:
        pose = np.array(line["object_info"][str(i)]["camera_from_object"])
        for axis, fill in enumerate(["red", "lime", "deepskyblue"]):
            segment(draw, (0, 0, 0), 0.05 * np.eye(3)[axis], fill, 2, pose)


table = next(np.array(body["world_from_body"])[:3, 3] for body in bodies.values() if body["role"] == "support")
top = min(point["point_world_m"][2] for pair in line["contacts"] for point in pair["points"])


def grid(draw, of):
    for k in range(-10, 11):
        at = 0.1 * k
        segment(draw, (at, -1, top), (at, 1, top), (200, 200, 200))
        segment(draw, (-1, at, top), (1, at, top), (200, 200, 200))
    for axis, (fill, name) in enumerate([("red", "x"), ("lime", "y"), ("deepskyblue", "z")]):
        end = np.array([0, 0, top]) + 0.2 * np.eye(3)[axis]
        segment(draw, (0, 0, top), end, fill, 3)
        if pixel(end):
            label(draw, pixel(end), name, fill)


def plan(draw):
    """The room from above, 1 m a square: lights, camera, objects."""
    place = lambda p: (width / 2 + 36 * p[0], height / 2 + 8 - 34 * p[1])
    for k in range(-4, 5):
        draw.line((*place((k, -3.2)), *place((k, 3.2))), fill=(225, 225, 225))
        draw.line((*place((-4.3, k)), *place((4.3, k))), fill=(225, 225, 225))
    for i in ids:
        x, y = place(np.array(bodies[i]["world_from_body"])[:2, 3])
        draw.rectangle((x - 2, y - 2, x + 2, y + 2), fill=tuple(color[i].astype(int)))
    for k, light in enumerate(line["lights"]):
        center = light.get("center_world_m")
        if center is None:
            continue
        shade = np.array(light.get("radiance_nits", [1, 1, 1]), dtype=float)
        fill = tuple((255 * (shade / shade.max()) ** (1 / 2.2)).astype(int))
        x, y = place(center)
        draw.ellipse((x - 9, y - 9, x + 9, y + 9), fill=fill, outline="black")
        draw.text((x, y + (16 if k % 2 else -16)), f'{light["shape"]}, z = {center[2]:.1f} m', fill="black", font=small, anchor="mm")
    pose = np.array(camera["world_from_camera"])
    eye = pose[:3, 3]
    half = np.arctan(width / 2 / camera["K"][0][0])
    ahead = np.arctan2(pose[1, 2], pose[0, 2])
    for turn in (-half, half):
        draw.line((*place(eye), *place(eye[:2] + 0.8 * np.array([np.cos(ahead + turn), np.sin(ahead + turn)]))), fill="black")
    draw.text(place(eye - [0, 0.25, 0]), "camera", fill="black", font=small, anchor="mm")


roles = {"object": (90, 200, 90), "distractor": (230, 120, 60), "support": (150, 110, 70), "room": (110, 120, 140), "fixture": (90, 120, 170)}
by_role = np.zeros_like(rgb, dtype=float)
instance = array("instance")
for i, body in bodies.items():
    by_role[instance == i] = np.array(roles[body["role"]]) * (0.75 + 0.25 * (i * 0.618 % 1))


def points(draw, of):
    models = {model["asset"]: model for model in line["object_models"]}
    for i in ids:
        info = line["object_info"][str(i)]
        model = models[info["asset"]]
        pose = np.array(info["camera_from_object"])
        vertices = np.array(model["vertices_m"])
        for triangle in np.array(model["triangles"])[:: max(1, len(model["triangles"]) // 250)]:
            corners = [pixel(vertices[corner], pose) for corner in triangle]
            if all(corners):
                draw.polygon(corners, outline=of(i))


def keypoints(draw, of):
    named = max((i for i in ids if line["keypoints"][str(i)]), key=lambda i: visible[i].sum())
    for i in ids:
        for point in line["keypoints"][str(i)]:
            if point["uv_px"] is None or point["visibility"] == 0:
                continue
            (x, y), is_seen = point["uv_px"], point["visibility"] == 2
            draw.ellipse((x - 3, y - 3, x + 3, y + 3), fill=of(i) if is_seen else None, outline=of(i))
            if i == named:
                shade = "white" if is_seen else (150, 150, 150)
                draw.text((x + 5, y), point["name"], fill=shade, font=small, anchor="lm")


def silhouettes(draw):
    shrunk = Image.fromarray(rgb).resize((width // 2, height // 2))
    draw._image.paste(shrunk, (width // 4, height // 4))
    draw.rectangle((width / 4, height / 4, width * 3 / 4, height * 3 / 4), outline="white")
    for seen in line["visibility"].values():
        x, y, w, h = seen["silhouette_box"]
        box = [width / 4 + x / 2, height / 4 + y / 2, width / 4 + (x + w) / 2, height / 4 + (y + h) / 2]
        draw.rectangle(box, outline=(255, 90, 60) if seen["truncated"] else (90, 200, 90))
        if seen["truncated"]:
            label(draw, (box[0] + 14, box[1] + 6), f'{100 * seen["outside_fract"]:.0f} %')


def matrix(values, most):
    values = np.asarray(values, dtype=float)
    cell = min(height, width) // len(values)
    shade = 255 * (1 - np.clip(values / most, 0, 1) ** 0.5)
    tile = np.kron(np.stack([shade, shade, np.full_like(shade, 255)], axis=2), np.ones((cell, cell, 1)))
    tile[::cell] = tile[:, ::cell] = 215
    out = np.full((height, width, 3), 255.0)
    top, left = (height - len(tile)) // 2, (width - len(tile)) // 2
    out[top : top + len(tile), left : left + len(tile)] = tile
    return out


order = line["depth_order"]
front_to_back = order["front_to_back"]
rank = {i: k / max(1, len(front_to_back) - 1) for k, i in enumerate(front_to_back)}
near_far = lambda i: np.array([255, 150, 40]) * (1 - rank[i]) + np.array([40, 70, 160]) * rank[i]


def numbered(tile, of):
    image = Image.fromarray(np.clip(tile, 0, 255).astype(np.uint8))
    for i in seen:
        label(ImageDraw.Draw(image), middle(visible[i]), of(i))
    return np.array(image)


def contacts(draw, of):
    for pair in line["contacts"]:
        for point in pair["points"]:
            if p := pixel(point["point_world_m"]):
                draw.ellipse((p[0] - 2, p[1] - 2, p[0] + 2, p[1] + 2), fill="yellow")
        start = np.mean([point["point_world_m"] for point in pair["points"]], axis=0)
        p, q = pixel(start), pixel(start - 0.02 * np.array(pair["force_world_n"]))
        if p and q:
            arrow(draw, p, q, "white")


def support(draw):
    graph = line["support_graph"]
    level = {i: 0 for i in bodies}
    for _ in bodies:
        for edge in graph["edges"]:
            level[edge["supported"]] = max(level[edge["supported"]], level[edge["supporter"]] + 1)
    shown = sorted({i for edge in graph["edges"] for i in (edge["supporter"], edge["supported"])})
    at = {}
    for row in range(max(level.values()) + 1):
        here = [i for i in shown if level[i] == row]
        for k, i in enumerate(here):
            at[i] = ((k + 0.5) * width / len(here), height - 20 - row * (height - 40) / max(level.values()))
    for edge in graph["edges"]:
        arrow(draw, at[edge["supporter"]], at[edge["supported"]], (170, 170, 170))
    for i, (x, y) in at.items():
        draw.ellipse((x - 7, y - 7, x + 7, y + 7), fill=tuple(color[i].astype(int)) if i in color else (150, 110, 70))
        draw.text((x, y), str(i), fill="black", font=small, anchor="mm")


removal = {i: str(k + 1) for k, i in enumerate(line["removal_order"]["order"])}
materials = np.array([(0, 0, 0)] + [tuple(255 * c for c in colorsys.hsv_to_rgb(k * 0.618 % 1, 0.6, 0.65 + 0.35 * (k * 0.414 % 1))) for k in range(len(line["materials"]))])
srgb = lambda linear: 255 * np.where(np.array(linear) < 0.0031308, 12.92 * np.array(linear), 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
mean = np.zeros_like(rgb, dtype=float)
for record in line["material_statistics"]:
    mean[instance == record["id"]] = srgb(np.array(record["base_color"]))


def wheel(flow):
    """Direction as hue, length as brightness."""
    length = np.hypot(flow[..., 0], flow[..., 1])
    hue = (np.arctan2(flow[..., 1], flow[..., 0]) / (2 * np.pi) % 1) * 255
    value = 255 * np.clip(length / max(np.percentile(length, 99), 1e-6), 0, 1) ** 0.4
    hsv = np.stack([hue, np.full_like(hue, 220), value], axis=2).astype(np.uint8)
    return np.array(Image.fromarray(hsv, "HSV").convert("RGB"))


soft = array("visible_soft_mask")
most_soft = max(range(len(ids)), key=lambda k: (visible[ids[k]].sum() < 700) * visible[ids[k]].sum())
ys, xs = np.nonzero(soft[most_soft] > 0)
left, up = min(max(0, xs.min() - 2), width - 40), min(max(0, ys.min() - 2), height - 30)
part = soft[most_soft][up : up + 30, left : left + 40]
enlarged = np.repeat(np.kron(255 * part, np.ones((8, 8)))[..., None], 3, axis=2)
objects = np.unpackbits(array("amodal_bits"), axis=2, count=width).sum(axis=0)
shades = np.array([(20, 20, 30), (60, 90, 160), (90, 180, 120), (240, 200, 60), (250, 120, 40), (220, 40, 40)])


def views(draw):
    records = next(record["seen_in_views"] for record in lines if record.get("seen_in_views"))
    number = 1 + max(view for record in records for view in record["views"])
    for k, record in enumerate(records):
        x = 50 + k * (width - 60) / len(records)
        for view in range(number):
            y = 60 + view * 30
            is_best = view == record["best_view"]
            fill = (60, 160, 80) if is_best else (170, 190, 230) if view in record["views"] else (245, 245, 245)
            draw.rectangle((x, y, x + (width - 60) / len(records) - 2, y + 24), fill=fill)
        if record["id"] % 5 == 0:
            draw.text((x + 3, 50), str(record["id"]), fill="black", font=small, anchor="mm")
    for view in range(number):
        draw.text((6, 72 + view * 30), f"view {view}", fill="black", font=small, anchor="lm")
    draw.text((50, 30), "objects; green: the view that hides least of it", fill="black", font=small)


def report(draw):
    for k, (name, value) in enumerate(line["settle_report"].items()):
        value = f"{len(value)} bodies" if isinstance(value, list) else f"{value:.4g}"
        draw.text((12, 20 + 18 * k), name, fill="black", font=small)
        draw.text((width - 40, 20 + 18 * k), value, fill="black", font=small, anchor="ra")


numbers = [
    ("object_name, category_id", drawn(names)),
    ("object_info: axes of each object's frame", drawn(poses)),
    ("camera: the world's frame, squares of 10 cm", drawn(grid)),
    ("lights, from above, squares of 1 m", diagram(plan)),
    ("bodies: objects, table, room", by_role),
    ("object_models in the poses of object_info", drawn(points)),
    ("keypoints: seen, and hidden (hollow)", drawn(keypoints)),
    ("visibility: silhouettes, share beyond the image", diagram(silhouettes, (40, 40, 40))),
    ("occlusion_areas: row hides column", matrix(line["occlusion_areas"]["all"], 400)),
    ("depth_order: from front (orange) to back", painted(visible, near_far)),
    ("contacts with their forces", drawn(contacts)),
    ("support_graph: from supporter to supported", diagram(support)),
    ("removal_order", numbered(painted(visible), lambda i: removal.get(i, ""))),
    ("material_map", materials[array("material_map")]),
    ("material_statistics: mean base color", mean),
    ("flow to the next view: hue is direction", wheel(array("flow"))),
    ("flow_visibility: seen, hidden, out of the image", np.array([(40, 40, 40), (230, 90, 60), (120, 190, 120)])[array("flow_visibility")]),
    ("visible_soft_mask of one object, enlarged", enlarged),
    ("visible_ids of label_arrays", painted({i: array("visible_ids") == i for i in ids})),
    ("amodal_bits of label_arrays: objects on the ray", shades[np.minimum(objects, 5)]),
    ("seen_in_views", diagram(views)),
    ("settle_report", diagram(report)),
]

COLUMNS = 3


def sheet(tiles, name):
    image = Image.new("RGB", (COLUMNS * (width + 6) - 6, -(-len(tiles) // COLUMNS) * (height + 22)), "white")
    font = ImageFont.load_default(13)
    for k, (title, tile) in enumerate(tiles):
        x, y = k % COLUMNS * (width + 6), k // COLUMNS * (height + 22)
        image.paste(Image.fromarray(np.clip(tile, 0, 255).astype(np.uint8)), (x, y + 18))
        ImageDraw.Draw(image).text((x + 2, y + 1), title, fill="black", font=font)
    image.save(pathlib.Path(__file__).parent / "src/images" / name, quality=82)


sheet(tiles, "labels.jpg")
sheet(numbers, "label-numbers.jpg")
