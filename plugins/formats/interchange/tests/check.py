#!/usr/bin/env python3
"""Reads the files of a writer as the readers of its format do, and compares them with the products.

    python3 check.py FORMAT FOLDER [OPTION]

FOLDER has the writer's folder, which is called `data`, and `truth.jsonl`, a line per view with its products as JSON.
"""

import contextlib
import json
import pathlib
import sys

import numpy as np
from PIL import Image
from pycocotools import mask as coco_mask
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

VIEWS_PER_SCENE = 3
CATEGORIES = {1: "object", 2: "bowl", 3: "mug"}


class View:
    """The products of a view."""

    def __init__(self, record):
        self.scene, self.view = record["scene"], record["view"]
        self.name = f"{self.scene:06}_{self.view:04}"
        self.image_id = self.scene * VIEWS_PER_SCENE + self.view + 1
        self.rgb = np.array(record["rgb"], dtype=np.uint8)
        self.depth = np.array([[np.inf if d is None else d for d in row] for row in record["depth"]], dtype=np.float32)
        self.ids = [int(i) for i in record["amodal_mask"]]
        self.visible, self.amodal, self.occluded = (
            {int(i): coco_mask.decode(rle) > 0 for i, rle in record[name].items()}
            for name in ("visible_mask", "amodal_mask", "occlusion_mask"))
        self.category = {int(i): c for i, c in record["category_id"].items()}
        self.rate = {int(i): r for i, r in record["occlusion_rate"].items()}
        matrix = np.array(record["occlusion_order"], dtype=bool).reshape(len(self.ids), len(self.ids))
        self.occludes = {(i, j): matrix[a, b] for a, i in enumerate(self.ids) for b, j in enumerate(self.ids)}

    def shown(self):
        return [i for i in self.ids if self.visible[i].any()]

    def nearest(self, i):
        depths = self.depth[self.visible[i]]
        depths = depths[np.isfinite(depths)]
        return depths.min() if len(depths) else np.inf

    def front_to_back(self, ids):
        """Takes one object after the other: of those that nothing left occludes, else of those of a circle that nothing
        outside the circle occludes, the nearest."""
        left, order = list(ids), []
        while left:
            reach = np.array([[self.occludes[i, j] for j in left] for i in left], dtype=bool)
            free = [j for b, j in enumerate(left) if not reach[:, b].any()]
            if not free:
                for _ in left:
                    reach = reach | (reach.astype(int) @ reach.astype(int) > 0)
                free = [j for b, j in enumerate(left) if (reach[b, :] | ~reach[:, b]).all()]
            order.append(min(free, key=self.nearest))
            left.remove(order[-1])
        return order

    def layers(self, order):
        layers = {}
        for j in order:
            layers[j] = max((layers[i] + 1 for i in layers if self.occludes[i, j]), default=0)
        return layers


def box(mask):
    if not mask.any():
        return [0, 0, 0, 0]
    ys, xs = np.nonzero(mask)
    return [xs.min(), ys.min(), xs.max() - xs.min() + 1, ys.max() - ys.min() + 1]


def same_mask(got, want, what):
    assert np.array_equal(got > 0, want), f"{what}: another mask"


def same(got, want, what):
    assert got == want, f"{what}: {got}, not {want}"


def keys(record, wanted, what):
    assert set(record) == set(wanted.split()), f"{what}: {sorted(set(record) ^ set(wanted.split()))}"


def load(file):
    with contextlib.redirect_stdout(sys.stderr):
        return COCO(str(file))


def instances(root, file, views, listed):
    """A file of COCO's structure: its images are those that should be listed, and the annotations those of the objects."""
    coco = load(root / file)
    views = {v.image_id: v for v in views if listed(v)}
    same(sorted(coco.getImgIds()), sorted(views), "image ids")
    same(sorted(coco.anns), list(range(1, len(coco.anns) + 1)), "annotation ids")
    for i, view in views.items():
        image = coco.loadImgs(i)[0]
        same_image(root / "images" / image["file_name"], view)
        same((image["height"], image["width"]), view.rgb.shape[:2], "size")
    return coco, views


def same_image(path, view):
    got = np.asarray(Image.open(path))
    assert got.dtype == np.uint8 and np.array_equal(got, view.rgb), f"{path}: another image"


def same_depth(path, view):
    got = np.asarray(Image.open(path))
    want = np.where(np.isfinite(view.depth), np.floor(np.nan_to_num(view.depth.astype(float), posinf=0) * 1000 + 0.5), 0)
    assert got.dtype == np.uint16 and np.array_equal(got, want), f"{path}: another depth"


def same_categories(coco, extra=()):
    same([(c["id"], c["name"]) for c in coco.loadCats(coco.getCatIds())], [*CATEGORIES.items(), *extra], "categories")


def holes(mask):
    """Pixels that paths from the border, over corners, too, do not reach."""
    free = ~np.pad(mask.astype(bool), 1)
    reached, grown = np.zeros_like(free), np.zeros_like(free)
    grown[0, 0] = True
    while (grown != reached).any():
        reached = grown
        padded = np.pad(reached, 1)
        around = [padded[y : y + free.shape[0], x : x + free.shape[1]] for y in range(3) for x in range(3)]
        grown = free & np.any(around, axis=0)
    return int((free & ~reached).sum())


def drawn(polygons, view):
    height, width = view.rgb.shape[:2]
    return coco_mask.decode(coco_mask.merge(coco_mask.frPyObjects(polygons, height, width)))


def check_coco(root, views, masks):
    coco, views = instances(root, "annotations/instances_train.json", views, lambda v: True)
    same_categories(coco)
    for i, view in views.items():
        wanted = view.shown() if masks == "visible" else view.ids
        annotations = coco.imgToAnns[i]
        same([a["instance_id"] for a in annotations], wanted, "instances")
        for a, n in zip(annotations, wanted):
            mask = (view.visible if masks == "visible" else view.amodal)[n]
            same_mask(coco.annToMask(a), mask, f"{view.name} {n}")
            same_mask(coco_mask.decode(a["visible_mask"]), view.visible[n], f"{view.name} {n}")
            same_mask(coco_mask.decode(a["amodal_mask"]), view.amodal[n], f"{view.name} {n}")
            same((a["area"], a["bbox"]), (mask.sum(), box(mask)), f"{view.name} {n}")
            same((a["category_id"], a["occluded_rate"]), (view.category[n], view.rate[n]), f"{view.name} {n}")
    return len(coco.anns)


def check_coco_keypoints(root, views, _):
    coco, views = instances(root, "annotations/instances_train.json", views, lambda v: True)
    for category in coco.loadCats(coco.getCatIds()):
        same((category["keypoints"], category["skeleton"]), (["base", "rim"], [[2, 1]]), "category")
    # Pixels whose centers are at half-integers become COCO's, where the first pixel is at (0, 0).
    wanted = {1: [1.0, 2.0, 1, 2.75, 3.5, 2]}
    for a in coco.anns.values():
        same(a["keypoints"], wanted.get(a["instance_id"], [0] * 6), f"instance {a['instance_id']}")
        same(a["num_keypoints"], 2 if a["instance_id"] in wanted else 0, "num_keypoints")
    labeled = [a for a in coco.anns.values() if a["num_keypoints"]]
    assert len(labeled) > 5, "objects with keypoints"
    for shift, precision in (0, 1.0), (1000, 0.0):
        points = lambda a: [x + shift if i % 3 < 2 else x for i, x in enumerate(a["keypoints"])]
        found = [dict(image_id=a["image_id"], category_id=a["category_id"], keypoints=points(a), score=1.0) for a in labeled]
        with contextlib.redirect_stdout(sys.stderr):
            evaluation = COCOeval(coco, coco.loadRes(found), "keypoints")
            evaluation.params.kpt_oks_sigmas = np.array([0.05, 0.05])
            evaluation.params.areaRng = [[0, 1e10]]
            evaluation.params.areaRngLbl = ["all"]
            evaluation.evaluate()
            evaluation.accumulate()
        scores = evaluation.eval["precision"]
        scores = scores[scores > -1]
        assert scores.size and np.allclose(scores, precision), f"shift {shift}: {scores}"
    return len(coco.anns)


def check_coco_panoptic(root, views, _):
    """The checks of panopticapi's evaluation, of the annotations against themselves."""
    file = root / "annotations/panoptic_train.json"
    data = json.loads(file.read_text())
    folder = pathlib.Path(str(file).replace(".json", ""))
    categories = {c["id"]: c for c in data["categories"]}
    background = max(CATEGORIES) + 1
    same({i: c["isthing"] for i, c in categories.items()}, {**{i: 1 for i in CATEGORIES}, background: 0}, "isthing")
    views = {v.image_id: v for v in views}
    same([a["image_id"] for a in data["annotations"]], sorted(views), "annotations")
    same([i["id"] for i in data["images"]], sorted(views), "images")
    checked = 0
    for image, annotation in zip(data["images"], data["annotations"]):
        view = views[annotation["image_id"]]
        same_image(root / "images" / image["file_name"], view)
        png = np.array(Image.open(folder / annotation["file_name"]), dtype=np.uint32)
        ids = png[:, :, 0] + 256 * png[:, :, 1] + 256 * 256 * png[:, :, 2]
        labels, counts = np.unique(ids, return_counts=True)
        segments = {s["id"]: s for s in annotation["segments_info"]}
        assert 0 not in labels, f"{view.name}: void"
        same(sorted(labels), sorted(segments), f"{view.name}: ids")
        same(len(segments), len(annotation["segments_info"]), f"{view.name}: ids are unique")
        for label, count in zip(labels, counts):
            segment = segments[label]
            keys(segment, "id category_id area bbox iscrowd", "a segment")
            same((segment["area"], segment["bbox"], segment["iscrowd"]), (count, box(ids == label), 0), view.name)
        things = [s for s in annotation["segments_info"] if categories[s["category_id"]]["isthing"]]
        same([s["id"] for s in things], view.shown(), f"{view.name}: things")
        for s in things:
            same_mask(ids == s["id"], view.visible[s["id"]], f"{view.name} {s['id']}")
            same(s["category_id"], view.category[s["id"]], f"{view.name} {s['id']}")
        same(len(segments) - len(things), 1, f"{view.name}: background")
        checked += len(things)
    return checked


def check_cocoa(root, views, _):
    """The reader takes the n-th annotation for that of the n-th image."""
    data = json.loads((root / "annotations/COCO_amodal_train2014.json").read_text())
    # Those of the recipe, whatever is in the images: a conversion to a format with ids of categories needs them.
    assert len({category["id"] for category in data["categories"]}) == len(data["categories"]) > 0
    views = {v.image_id: v for v in views if v.ids}
    same([i["id"] for i in data["images"]], sorted(views), "images")
    same([a["image_id"] for a in data["annotations"]], sorted(views), "annotations")
    checked = edges = 0
    for image, annotation in zip(data["images"], data["annotations"]):
        view = views[annotation["image_id"]]
        same_image(root / "images" / image["file_name"], view)
        keys(annotation, "id image_id url author size depth_constraint regions", "an annotation")
        same(annotation["url"].split("/")[-1], image["file_name"], "url")
        regions, order = annotation["regions"], view.front_to_back(view.ids)
        same(annotation["size"], len(order), "size")
        same([r["order"] for r in regions], list(range(1, len(order) + 1)), "order")
        for region, n in zip(regions, order):
            what = f"{view.name} {n}"
            masks = " visible_mask invisible_mask" if view.occluded[n].any() else ""
            keys(region, f"segmentation name area isStuff occlude_rate order{masks}", what)
            same_mask(drawn([region["segmentation"]], view), view.amodal[n], what)
            same((region["area"], region["occlude_rate"]), (view.amodal[n].sum(), view.rate[n]), what)
            same((region["name"], region["isStuff"]), (CATEGORIES[view.category[n]], 0), what)
            if masks:
                same_mask(coco_mask.decode(region["visible_mask"]), view.visible[n], what)
                same_mask(coco_mask.decode(region["invisible_mask"]), view.occluded[n], what)
            checked += 1
        pairs = annotation["depth_constraint"].split(",") if annotation["depth_constraint"] else []
        got = [tuple(int(number) - 1 for number in pair.split("-")) for pair in pairs]
        want = [(a, b) for a in range(len(order)) for b in range(a + 1, len(order)) if view.occludes[order[a], order[b]]]
        same(got, want, f"{view.name}: constraints")
        edges += len(got)
    assert edges
    return checked


def check_d2sa(root, views, _):
    coco, views = instances(root, "annotations/D2S_amodal_training.json", views, lambda v: True)
    same_categories(coco)
    for i, view in views.items():
        order = view.front_to_back(view.ids)
        layers = view.layers(order)
        annotations = coco.imgToAnns[i]
        same(len(annotations), len(order), view.name)
        for at, (a, n) in enumerate(zip(annotations, order)):
            what = f"{view.name} {n}"
            mask = view.amodal[n]
            is_occluded = view.occluded[n].any()
            keys(a, "id image_id category_id iscrowd area bbox segmentation visible_mask occlude_rate occl_depth amodal_region"
                 + (" invisible_mask" if is_occluded else ""), what)
            same_mask(coco.annToMask(a), mask, what)
            same_mask(coco_mask.decode(a["visible_mask"]), view.visible[n], what)
            if is_occluded:
                same_mask(coco_mask.decode(a["invisible_mask"]), view.occluded[n], what)
            assert a["iscrowd"] is False
            same((a["area"], a["bbox"], a["category_id"]), (mask.sum(), box(mask), view.category[n]), what)
            same((a["occlude_rate"], a["occl_depth"]), (view.rate[n], layers[n]), what)
            region = {"name": CATEGORIES[view.category[n]], "area": mask.sum(), "isStuff": 0, "bbox": box(mask), "order": at + 1}
            same(a["amodal_region"], region, what)
    return len(coco.anns)


def groups(view, ids):
    """Numbers of the groups of objects that overlap, 0 for those by themselves."""
    of = {i: {i} for i in ids}
    for i in ids:
        for j in ids:
            if of[i] is not of[j] and (view.amodal[i] & view.amodal[j]).any():
                joint = of[i] | of[j]
                for k in joint:
                    of[k] = joint
    shared = sorted({min(group) for group in of.values() if len(group) > 1})
    return {i: shared.index(min(of[i])) + 1 if len(of[i]) > 1 else 0 for i in ids}


def check_kins(root, views, version):
    file = "instances_train.json" if version == "2019" else "update_train_2020.json"
    coco, views = instances(root, file, views, lambda v: True)
    same_categories(coco)
    for i, view in views.items():
        ids = view.shown()
        layers, group = view.layers(view.front_to_back(ids)), groups(view, ids)
        annotations = coco.imgToAnns[i]
        same(len(annotations), len(ids), view.name)
        for a, n in zip(annotations, ids):
            what = f"{view.name} {n}"
            visible, amodal = view.visible[n], view.amodal[n]
            same((a["category_id"], a["iscrowd"]), (view.category[n], 0), what)
            if version == "2019":
                keys(a, "id image_id category_id iscrowd area segmentation bbox inmodal_seg inmodal_bbox", what)
                same_mask(coco.annToMask(a), amodal, what)
                # deocclusion and InstaOrder read one polygon, however many parts there are.
                same(len(a["segmentation"]), 1, what)
                same((a["area"], a["bbox"]), (amodal.sum(), box(amodal)), what)
                same_mask(coco_mask.decode(a["inmodal_seg"]), visible, what)
                same(a["inmodal_bbox"], box(visible), what)
            else:
                keys(a, "id image_id category_id iscrowd a_segm a_bbox a_area i_segm i_bbox i_area a_hole_area i_hole_area oco_id ico_id", what)
                for kind, mask in (("a", amodal), ("i", visible)):
                    same_mask(drawn(a[f"{kind}_segm"], view), mask, what)
                    same((a[f"{kind}_area"], a[f"{kind}_bbox"]), (mask.sum(), box(mask)), what)
                    same(a[f"{kind}_hole_area"], holes(mask), what)
                same(len(a["a_segm"]), 1, what)
                same((a["oco_id"], a["ico_id"]), (group[n], layers[n] + 1 if group[n] else 0), what)
    if version == "2020":
        # Both cases are there.
        assert {bool(a["oco_id"]) for a in coco.anns.values()} == {True, False}
    return len(coco.anns)


def check_insta_order(root, views, _):
    """InstaOrder's reader finds the instances beside its file, by the split in its name."""
    views = list(views)
    coco, _ = instances(root, "annotations/instances_train2017.json", views, lambda v: True)
    data = json.loads((root / "annotations/InstaOrder_train2017.json").read_text())
    views = {v.image_id: v for v in views if len(v.shown()) > 1}
    same([a["image_id"] for a in data["annotations"]], sorted(views), "images")
    checked = 0
    for record in data["annotations"]:
        keys(record, "image_id instance_ids occlusion depth", "a record")
        view = views[record["image_id"]]
        ids = view.shown()
        annotations = coco.loadAnns(record["instance_ids"])
        same({a["image_id"] for a in annotations}, {view.image_id}, view.name)
        same(len(annotations), len(ids), view.name)
        for a, n in zip(annotations, ids):
            same_mask(coco.annToMask(a), view.visible[n], f"{view.name} {n}")
        size = len(ids)
        occlusion = np.zeros((size, size), dtype=bool)
        for entry in record["occlusion"]:
            a, b = map(int, entry["order"].split(" & ")[0].split("<"))
            occlusion[a, b] = True
            if "&" in entry["order"]:
                occlusion[b, a] = True
            same(entry["count"], 2, "count")
        same(occlusion.tolist(), [[bool(view.occludes[i, j]) for j in ids] for i in ids], f"{view.name}: occlusion")
        depth, overlap = np.full((size, size), -1), np.full((size, size), -1)
        for entry in record["depth"]:
            sign = "<" if "<" in entry["order"] else "="
            a, b = map(int, entry["order"].split(sign))
            depth[a, b], depth[b, a] = (1, 0) if sign == "<" else (2, 2)
            overlap[a, b] = overlap[b, a] = entry["overlap"]
        depths = [view.depth[view.visible[i]].astype(float) for i in ids]
        for a in range(size):
            for b in range(size):
                if a != b:
                    nearer = depths[a].mean() - depths[b].mean()
                    same(depth[a, b], 2 if nearer == 0 else int(nearer < 0), f"{view.name}: depth of {a} and {b}")
                    joint = depths[a].min() <= depths[b].max() and depths[b].min() <= depths[a].max()
                    same(overlap[a, b], int(joint), f"{view.name}: overlap of {a} and {b}")
        checked += size
    return checked


def check_uoais(root, views, skip):
    data = json.loads((root / "annotations/coco_anns_uoais_sim_train.json").read_text())
    views = {v.image_id: v for v in views if v.ids or skip != "true"}
    same([i["id"] for i in data["images"]], sorted(views), "images")
    same(data["categories"], [{"id": 1, "name": "object", "supercategory": "shape"}], "categories")
    for image in data["images"]:
        same_image(root / "train" / image["file_name"], views[image["id"]])
        same_depth(root / "train" / image["depth_file_name"], views[image["id"]])
    wanted = [(v, n) for v in views.values() for n in v.ids]
    same(len(data["annotations"]), len(wanted), "annotations")
    for a, (view, n) in zip(data["annotations"], wanted):
        what = f"{view.name} {n}"
        keys(a, "id image_id category_id bbox area iscrowd segmentation visible_mask occluded_mask occluded_rate", what)
        for name, masks in (("segmentation", view.amodal), ("visible_mask", view.visible), ("occluded_mask", view.occluded)):
            same_mask(coco_mask.decode(a[name]), masks[n], what)
        want = (view.image_id, 1, box(view.amodal[n]), view.amodal[n].sum(), view.rate[n])
        same((a["image_id"], a["category_id"], a["bbox"], a["area"], a["occluded_rate"]), want, what)
    return len(wanted)


def check_osd_amodal(root, views, _):
    """The evaluation sorts and zips the images, and finds masks by a part of their path."""
    rgbs, depths, labels, amodals, occlusions = (
        sorted(str(p) for p in (root / folder).glob("*.png"))
        for folder in ("image_color", "disparity", "annotation", "amodal_annotation", "occlusion_annotation"))
    same((len(rgbs), len(depths)), (len(labels),) * 2, "images")
    views = [v for v in views if v.shown()]
    same(len(rgbs), len(views), "views")
    checked = 0
    for rgb, depth, label, view in zip(rgbs, depths, labels, views):
        name = pathlib.Path(rgb).stem
        same_image(rgb, view)
        same_depth(depth, view)
        label = np.asarray(Image.open(label))
        assert label.dtype == np.uint8 and label.ndim == 2
        masks = {}
        for path in (p for p in amodals if name + "_" in p):
            number = int(pathlib.Path(path).stem.split("_")[-1])
            masks[number] = np.asarray(Image.open(path))
        for path in (p for p in occlusions if name + "_" in p):
            int(pathlib.Path(path).stem.split("_")[1])
        same(sorted(masks), list(range(1, len(view.shown()) + 1)), f"{name}: masks")
        same([n for n in np.unique(label) if n], sorted(masks), f"{name}: labels")
        for number, n in enumerate(view.shown(), 1):
            assert masks[number].ndim == 2
            same_mask(masks[number], view.amodal[n], f"{name} {n}")
            same_mask(label == number, view.visible[n], f"{name} {n}")
            path = root / f"occlusion_annotation/{name}_{number}.png"
            same(path.is_file(), bool(view.occluded[n].any()), f"{name} {n}: occluded")
            if path.is_file():
                same_mask(np.asarray(Image.open(path)), view.occluded[n], f"{name} {n}")
            checked += 1
    same(len(amodals), checked, "amodal masks")
    return checked


def look_at(camera):
    """The matrix from the world to a camera with x right, y down, z forward, by position, target and up vector."""
    position, target, up = (np.array(camera[key]) for key in ("camera_pos", "lookat_pos", "camera_up_vector"))
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    return rotation, -rotation @ position


def check_tod(root, views, _):
    """The loaders count views of a scene; the entries of `object_descriptions` follow the labels from 2 on."""
    scenes = sorted((root / "training_set").glob("*/"))
    same(len(scenes) * VIEWS_PER_SCENE, len(views), "views")
    checked = 0
    for scene in scenes:
        own = [v for v in views if f"scene_{v.scene:05}" == scene.name]
        described = json.loads((scene / "scene_description.txt").read_text())
        keys(described, "object_descriptions views", scene)
        cameras = described["views"]
        cameras = [cameras["background"], cameras["background+table"], *cameras["background+table+objects"]]
        same(len(cameras), len(own), "cameras")
        surfaces = {}
        for view, camera in zip(own, cameras):
            np.testing.assert_allclose(camera["camera_pos"], [1.0, 0.1 * view.view, 1.5], atol=1e-12)
            rgb = np.asarray(Image.open(scene / f"rgb_{view.view:05}.jpeg").convert("RGB"))
            assert np.abs(rgb.astype(int) - view.rgb).mean() < 8, f"{view.name}: another image"
            same_depth(scene / f"depth_{view.view:05}.png", view)
            labels = np.array(Image.open(scene / f"segmentation_{view.view:05}.png"))
            assert labels.dtype == np.uint8 and labels.ndim == 2
            same(set(np.unique(labels)) - {0, 1}, {n + 1 for n in view.shown()}, f"{view.name}: labels")
            nothing = ~np.isfinite(view.depth)
            same_mask(labels == 0, nothing, f"{view.name}: background")
            rotation, shift = look_at(camera)
            # The camera looks at this point, and its image is upright.
            center = rotation @ np.array([0.0, 0.0, 0.7]) + shift
            np.testing.assert_allclose(center[:2], 0, atol=1e-9)
            assert (rotation @ np.array([0.0, 0.0, 1.0]))[1] < 0
            for n in view.shown():
                same_mask(labels == n + 1, view.visible[n], f"{view.name} {n}")
                rows, columns = np.nonzero(view.visible[n])
                z = view.depth[rows, columns].astype(float)
                points = np.stack([(columns + 0.5 - 32) / 45.7 * z, (rows + 0.5 - 24) / 45.7 * z, z])
                surfaces.setdefault(n, []).append(rotation.T @ (points - shift[:, None]))
                checked += 1
        for n, parts in surfaces.items():
            points = np.concatenate(parts, axis=1)
            center = [1, 2, 3] if n == 1 else (points.min(axis=1) + points.max(axis=1)) / 2
            description = described["object_descriptions"][n - 1]
            np.testing.assert_allclose(description["axis_aligned_bbox3D_center"], center, atol=1e-9)
            assert description["mesh_filename"].startswith("lm/tetra_")
        same(len(described["object_descriptions"]), max(surfaces, default=0), "objects")
    return checked


def labels_of(path, classes):
    """The rules of Ultralytics' loader: lines of classes and points, whose box is not larger than the image."""
    lines = [line.split() for line in path.read_text().strip().splitlines() if line]
    out = []
    for line in lines:
        assert len(line) > 6 and len(line) % 2 == 1, f"{path}: {len(line)} columns"
        assert int(line[0]) in range(classes), f"{path}: class {line[0]}"
        points = np.array(line[1:], dtype=float).reshape(-1, 2)
        low, high = points.min(0), points.max(0)
        for value in ((low + high) / 2, high - low):
            assert (value >= 0).all() and (value <= 1).all(), f"{path}: {value} is out of bounds"
        out.append((int(line[0]), points))
    return out


def filled(points, size):
    """Pixels whose centers are in a polygon: a ray to the left meets it an odd number of times."""
    height, width = size
    xs, ys = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    inside = np.zeros(size, dtype=bool)
    corners = [tuple(p) for p in points * [width, height]]
    for edge in zip(corners, corners[1:] + corners[:1]):
        # The same result in both directions.
        (x0, y0), (x1, y1) = sorted(edge)
        if y0 != y1:
            inside ^= ((y0 > ys) != (y1 > ys)) & (x0 + (ys - y0) / (y1 - y0) * (x1 - x0) < xs)
    return inside


def encloses(corners, mask, what):
    """A rectangle, clockwise in the image, around all pixels of a mask."""
    ys, xs = np.nonzero(mask)
    sides = np.roll(corners, -1, 0) - corners
    assert np.abs((sides * np.roll(sides, -1, 0)).sum(1)).max() < 1e-2, f"{what}: no rectangle"
    for corner, side in zip(corners, sides):
        for dx, dy in ((0, 0), (0, 1), (1, 0), (1, 1)):
            inside = side[0] * (ys + dy - corner[1]) - side[1] * (xs + dx - corner[0])
            assert inside.min() >= -1e-2, f"{what}: a pixel is outside"


def check_yolo(root, views, option):
    task, masks = option.split(",")
    data = (root / "data.yaml").read_text().splitlines()
    stated = ["masks: amodal"] if masks == "amodal" else []
    head = ['train: "images/train"', 'val: "images/train"', *stated, "names:"]
    same(data[: len(head)], head, "data.yaml")
    names = {int(k): json.loads(v) for k, v in (line.strip().split(": ") for line in data[len(head) :])}
    same(names, {i - 1: name for i, name in CATEGORIES.items()}, "names")
    checked = moved_boxes = 0
    for view in views:
        image = root / "images/train" / f"{view.name}.png"
        same_image(image, view)
        # Ultralytics derives the label's path from the image's.
        labels = labels_of(pathlib.Path(str(image).replace("/images/", "/labels/")).with_suffix(".txt"), len(names))
        wanted = view.shown() if masks == "visible" else view.ids
        same([c for c, _ in labels], [view.category[n] - 1 for n in wanted], view.name)
        for (_, points), n in zip(labels, wanted):
            mask = (view.visible if masks == "visible" else view.amodal)[n]
            if task == "segment":
                same_mask(filled(points, mask.shape), mask, f"{view.name} {n}")
            else:
                same(len(points), 4, "corners")
                moved = ((points == 0) | (points == 1)).any()
                moved_boxes += moved
                if not moved:
                    encloses(points * mask.shape[::-1], mask, f"{view.name} {n}")
            checked += 1
    assert moved_boxes < checked / 2
    return checked


def main():
    kind, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    views = [View(json.loads(line)) for line in (folder / "truth.jsonl").read_text().splitlines()]
    checked = globals()[f"check_{kind}"](folder / "data", views, "".join(sys.argv[3:]))
    assert checked > 50, f"only {checked} objects"
    print(f"{kind}: {checked} objects")


if __name__ == "__main__":
    main()
