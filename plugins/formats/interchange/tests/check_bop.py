"""Checks a BOP dataset of ellipsoids: loads it as bop_toolkit does and computes masks, depths and counts from the poses.

usage: check_bop.py FOLDER SPLIT annotated|all CENTER

CENTER is the position of the center of the first pixel along each axis.
"""

import json
import pathlib
import sys

import numpy as np
from PIL import Image
from pycocotools.coco import COCO

ROOT, SPLIT, SET, CENTER = pathlib.Path(sys.argv[1]), sys.argv[2], sys.argv[3], float(sys.argv[4])


def load(path):
    """JSON with numbers as keys, as bop_toolkit's load_json(keys_to_int=True)."""
    text = pathlib.Path(path).read_text()
    return json.loads(text, object_hook=lambda x: {int(k) if k.isdigit() else k: v for k, v in x.items()})


def same(got, want, what):
    assert got == want, f"{what}: {got}, not {want}"


def silhouette(K, R, t, axes, xs, ys):
    """For each pixel center: whether the ray hits the ellipsoid, and the depth of the nearer hit, mm."""
    u, v = np.meshgrid(xs + CENTER, ys + CENTER)
    rays = np.stack([u, v, np.ones_like(u)], -1).astype(float) @ np.linalg.inv(K).T
    o, d = (-R.T @ t) / axes, (rays @ R) / axes
    a, b, c = (d * d).sum(-1), d @ o, o @ o - 1
    root = b * b - a * c
    assert (np.abs(root) > 1e-12).all()
    hit = root > 0
    return hit, np.where(hit, (-b - np.sqrt(np.where(hit, root, 0))) / a, np.inf)


def box(mask, origin=(0, 0)):
    """x, y and the distances between the outermost pixels, as bop_toolkit's calc_2d_bbox."""
    ys, xs = np.nonzero(mask)
    x, y = xs.min() + origin[0], ys.min() + origin[1]
    return [int(x), int(y), int(xs.max() - xs.min()), int(ys.max() - ys.min())]


def pose(gt):
    axes = np.array([float(x) for x in objects[gt["obj_id"]].split("_")[1:]])
    return np.array(gt["cam_R_m2c"]).reshape(3, 3), np.array(gt["cam_t_m2c"]), axes


def read_mask(path):
    mask = np.array(Image.open(path))
    assert mask.dtype == np.uint8 and np.isin(mask, [0, 255]).all(), path
    return mask == 255


objects = load(ROOT / "objects.json")
same(list(objects), list(range(1, len(objects) + 1)), "obj_ids")
same(list(objects.values()), sorted(set(objects.values())), "assets")
camera = load(ROOT / "camera.json")
info = load(ROOT / "dataset_info.json")
same((info["scenes"], info["images"], info["objects"], info["split"]), (3, 6, 3, SPLIT), "dataset_info")

counted = {"objects": 0, "hidden": 0, "outside": 0, "truncated": 0, "pixels": 0, "beyond": 0}
scenes = sorted((ROOT / SPLIT).iterdir())
same([s.name for s in scenes], ["000000", "000001", "000002"], "scenes")
for folder in scenes:
    cameras, truth = load(folder / "scene_camera.json"), load(folder / "scene_gt.json")
    infos = load(folder / "scene_gt_info.json")
    same([list(cameras), list(truth), list(infos)], [[0, 1]] * 3, "images")
    whole, modal = COCO(str(folder / "scene_gt_coco.json")), COCO(str(folder / "scene_gt_coco_modal.json"))
    same({c["id"]: c["name"] for c in whole.loadCats(whole.getCatIds())}, objects, "categories")
    seen = {0: [], 1: []}
    for image, entries in truth.items():
        K = np.array(cameras[image]["cam_K"]).reshape(3, 3)
        same([camera[k] for k in ("fx", "fy", "width", "height")], [60, 62, 64, 48], "camera")
        cx, cy = 30.8 + CENTER, 24.4 + CENTER
        assert np.allclose([camera["cx"], camera["cy"]], [cx, cy], atol=1e-12)
        assert np.allclose(K, [[60, 0, cx], [0, 62, cy], [0, 0, 1]], atol=1e-12), K
        R_w2c = np.array(cameras[image]["cam_R_w2c"]).reshape(3, 3)
        assert np.allclose(R_w2c @ R_w2c.T, np.eye(3)) and np.isclose(np.linalg.det(R_w2c), 1)
        eye = -R_w2c.T @ np.array(cameras[image]["cam_t_w2c"])
        assert np.allclose(eye, [1000, -400, 1500]), eye
        rgb = Image.open(folder / f"rgb/{image:06}.png")
        same((rgb.mode, rgb.size), ("RGB", (64, 48)), "rgb")
        png = np.array(Image.open(folder / f"depth/{image:06}.png")).astype(np.int64)
        scale = cameras[image]["depth_scale"]
        same(camera["depth_scale"], scale, "depth_scale")
        nearest = np.full((48, 64), np.inf)
        nearest[:14], nearest[14:40] = 800, 1500
        hits = []
        for gt in entries:
            hit, depth = silhouette(K, *pose(gt), np.arange(64), np.arange(48))
            all_hit, _ = silhouette(K, *pose(gt), np.arange(-64, 128), np.arange(-48, 96))
            hits.append((hit, depth, all_hit))
            nearest = np.minimum(nearest, depth)
        want = np.where(np.isinf(nearest), 0, np.minimum(np.round(nearest / scale), 65535))
        # Depths are single-precision meters.
        assert (np.abs(png - want) <= 1).all() and (png == want).mean() > 0.98, np.abs(png - want).max()
        counted["beyond"] += int((png == 65535).sum())
        for index, (gt, got, (hit, depth, all_hit)) in enumerate(zip(entries, infos[image], hits, strict=True)):
            what = f"{folder.name} {image} {index}"
            mask = read_mask(folder / f"mask/{image:06}_{index:06}.png")
            visible = read_mask(folder / f"mask_visib/{image:06}_{index:06}.png")
            assert (mask == hit).all(), f"{what}: mask"
            assert (visible == (hit & (depth == nearest))).all(), f"{what}: mask_visib"
            same(got["px_count_all"], int(all_hit.sum()), f"{what}: px_count_all")
            same(got["px_count_valid"], int((mask & (png > 0)).sum()), f"{what}: px_count_valid")
            same(got["px_count_visib"], int(visible.sum()), f"{what}: px_count_visib")
            fract = visible.sum() / all_hit.sum() if all_hit.any() else 0
            assert abs(got["visib_fract"] - fract) < 1e-12, f"{what}: visib_fract"
            boxes = [box(all_hit, (-64, -48)), box(visible)] if visible.any() else [[-1] * 4] * 2
            same([got["bbox_obj"], got["bbox_visib"]], boxes, f"{what}: boxes")
            # Points of the depth image are on the surface.
            v, u = np.nonzero(visible & (png < 65535))
            points = (np.stack([u + CENTER, v + CENTER, np.ones_like(u)]) * png[v, u] * scale).T @ np.linalg.inv(K).T
            R, t, axes = pose(gt)
            off = np.abs(np.linalg.norm(((points - t) @ R) / axes, axis=1) - 1)
            assert (off < 0.01).all(), f"{what}: points off the surface by {off.max()}"
            counted["pixels"] += len(off)
            counted["objects"] += 1
            counted["hidden"] += not visible.any()
            counted["outside"] += not mask.any()
            counted["truncated"] += bool(all_hit.sum() > mask.sum() > 0)
            if visible.any():
                x, y, width, height = box(mask)
                seen[image].append((gt["obj_id"], visible, [x, y, width + 1, height + 1], bool(fract < 0.1)))
    for coco, is_modal in ((whole, False), (modal, True)):
        same(sorted(coco.anns), list(range(1, len(seen[0]) + len(seen[1]) + 1)), "annotation ids")
        same([i["file_name"] for i in coco.loadImgs([0, 1])], ["rgb/000000.png", "rgb/000001.png"], "file names")
        for image, wants in seen.items():
            for ann, (obj_id, visible, bbox, ignore) in zip(coco.imgToAnns[image], wants, strict=True):
                assert isinstance(ann["segmentation"]["counts"], list)
                assert (coco.annToMask(ann) == visible).all()
                x, y, width, height = box(visible)
                same(ann["bbox"], [x, y, width + 1, height + 1] if is_modal else bbox, "bbox")
                same((ann["category_id"], ann["area"], ann["ignore"]), (obj_id, visible.sum(), ignore), "annotation")
                same((ann["iscrowd"], ann["width"], ann["height"]), (0, 64, 48), "annotation")


def load_ply(path):
    """Vertices and triangles of an ASCII file, read in the order that its header gives."""
    lines = path.read_text().split("\n")
    end = lines.index("end_header")
    header = [line.split() for line in lines[:end]]
    same(header[:2], [["ply"], ["format", "ascii", "1.0"]], "PLY")
    counts = {line[1]: int(line[2]) for line in header if line[0] == "element"}
    same(list(counts), ["vertex", "face"], "elements")
    properties = [line[1:] for line in header if line[0] == "property"]
    same(properties, [["float", a] for a in "xyz"] + [["list", "uchar", "int", "vertex_indices"]], "properties")
    rows = [[float(x) for x in line.split()] for line in lines[end + 1 :] if line]
    points, faces = np.array(rows[: counts["vertex"]]), np.array(rows[counts["vertex"] :])
    same((points.shape[1], faces.shape), (3, (counts["face"], 4)), "rows")
    assert (faces[:, 0] == 3).all()
    return points, faces[:, 1:].astype(int)


def outline(points):
    """The convex hull of points of the plane, counter-clockwise."""
    def half(points):
        hull = []
        for p in points:
            while len(hull) > 1 and turn(hull[-1] - hull[-2], p - hull[-1]) <= 0:
                hull.pop()
            hull.append(p)
        return hull[:-1]

    turn = lambda a, b: a[0] * b[1] - a[1] * b[0]
    points = points[np.lexsort((points[:, 1], points[:, 0]))]
    return np.array(half(points) + half(points[::-1]))


def check_models():
    """Meshes are the ellipsoids, and lie with the poses where the masks are."""
    models, infos = {}, load(ROOT / "models/models_info.json")
    same(list(infos), list(objects), "models_info")
    for obj_id, info in infos.items():
        name = f"obj_{obj_id:06}.ply"
        points, faces = models[obj_id] = load_ply(ROOT / "models" / name)
        same((ROOT / "models_eval" / name).read_bytes(), (ROOT / "models" / name).read_bytes(), name)
        axes = np.array([float(x) for x in objects[obj_id].split("_")[1:]])
        assert np.allclose((points / axes) ** 2 @ np.ones(3), 1, atol=1e-5), f"{name}: not the ellipsoid"
        same(sorted(set(faces.ravel())), list(range(len(points))), f"{name}: vertices of faces")
        low, high = points.min(0), points.max(0)
        for axis, a, b in zip("xyz", low, high - low):
            assert abs(info[f"min_{axis}"] - a) < 1e-4 and abs(info[f"size_{axis}"] - b) < 1e-4, info
        farthest = max(np.linalg.norm(points - p, axis=1).max() for p in points)
        assert abs(info["diameter"] - farthest) < 1e-4, f"{name}: {info['diameter']}, not {farthest}"
        a, b, c = (points[faces[:, i]] for i in range(3))
        normals = np.cross(b - a, c - a)
        assert ((normals * (a + b + c)).sum(1) > -1e-6).all(), f"{name}: faces look inwards"
    y, x = np.mgrid[:48, :64]
    pixels = np.stack([x.ravel(), y.ravel()], 1) + CENTER
    compared, shifted = 0, 0
    for folder in scenes:
        cameras, truth = load(folder / "scene_camera.json"), load(folder / "scene_gt.json")
        for image, entries in truth.items():
            K = np.array(cameras[image]["cam_K"]).reshape(3, 3)
            for index, gt in enumerate(entries):
                mask = read_mask(folder / f"mask/{image:06}_{index:06}.png").ravel()
                R, t, _ = pose(gt)
                projected = (models[gt["obj_id"]][0] @ R.T + t) @ K.T
                hull = outline(projected[:, :2] / projected[:, 2:])
                edge = np.roll(hull, -1, 0) - hull
                normal = np.stack([-edge[:, 1], edge[:, 0]], 1) / np.linalg.norm(edge, axis=1)[:, None]
                inside = lambda pixels: ((pixels[:, None] - hull) * normal).sum(2).min(1)
                depth = inside(pixels)
                clear = np.abs(depth) > 0.05
                assert ((depth > 0) == mask)[clear].all(), f"{folder.name} {image} {index}: the model is beside its mask"
                compared += int(mask.sum())
                shifted += int(((inside(pixels + 0.5) > 0) != mask).sum())
    # Half a pixel would be seen.
    assert compared > 2000 and shifted > 400, (compared, shifted)


def check_targets():
    want = []
    for folder in scenes:
        infos, truth = load(folder / "scene_gt_info.json"), load(folder / "scene_gt.json")
        for image, entries in truth.items():
            ids = [gt["obj_id"] for gt, info in zip(entries, infos[image]) if info["visib_fract"] >= 0.1]
            want += [{"im_id": image, "inst_count": ids.count(i), "obj_id": i, "scene_id": int(folder.name)}
                     for i in sorted(set(ids))]
    got = load(ROOT / "test_targets_bop19.json")
    same(got, want, "targets")
    assert len(got) > 5 and max(t["inst_count"] for t in got) > 1, got
    assert sum(t["inst_count"] for t in got) < counted["objects"] - counted["hidden"], "nothing is hardly visible"


if SPLIT == "test":
    check_targets()
    check_models()
else:
    assert not list(ROOT.glob("models*")) and not list(ROOT.glob("test_targets*"))
# What the checks are about is there.
assert counted["objects"] > 15 and counted["pixels"] > 1000 and counted["truncated"] > 3, counted
assert (counted["hidden"] > 3 and counted["outside"] > 1 and counted["beyond"] > 1) == (SET == "all"), counted
print(f"bop {SPLIT}: {counted}")
