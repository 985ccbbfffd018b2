#!/usr/bin/env python3
"""Checks a dataset in SynTable's layout as a stranger would: with pycocotools, NumPy and Pillow, from its files alone.

    python3 tests/check_dataset.py DATASET [--compat coco|syntable_1] [--annotations FILE] [--npz FOLDER] [--part I/N]

Checked: files and their types; ids; every mask decodes, encodes back to the same bytes, and visible masks are disjoint;
occlusion = amodal - visible; areas, boxes and rates are those of the masks; the label policy is kept; the occlusion
order equals the paper's Algorithm 1; the archives of the writer npz in FOLDER hold the same labels; cameras and poses are rigid and agree; every image has its companions.

Exit code 0 and a summary if all is well; 1 and the problems if not; 2 if there is nothing to check.
"""

import argparse
import contextlib
import json
import math
import pathlib
import re
import sys

import numpy as np
from PIL import Image
from pycocotools import mask as coco_mask
from pycocotools.coco import COCO

ANNOTATION_KEYS = {
    "id", "image_id", "category_id", "bbox", "visible_bbox", "width", "height", "object_name", "iscrowd",
    "segmentation", "area", "visible_mask", "occluded_mask", "occluded_rate",
}
IMAGE_KEYS = {
    "id", "file_name", "depth_file_name", "occlusion_order_file_name", "width", "height", "date_captured", "license",
    "coco_url", "flickr_url",
}
COCO_ANNOTATION_KEYS = {"instance_id", "amodal_bbox", "visible_area", "occluded_area", "occluded_rate_rounded", "object"}
COCO_IMAGE_KEYS = {"scene_id", "view_id", "instance_ids", "camera", "label_policy", "exposure"}


class Checker:
    """Collects what is wrong with a dataset."""

    def __init__(self, root, compat, annotations, npz, part):
        self.root, self.compat, self.file = root, compat, root / annotations
        self.npz = npz and root / npz
        self.first, self.step = (int(number) for number in part.split("/"))
        self.problems = []
        self.occluded = self.occluded_px = self.amodal_px = self.edges = 0
        self.bbox_kinds = {"visible", "amodal"}

    def expect(self, condition, message):
        if not condition:
            self.problems.append(message)
        return bool(condition)

    def run(self):
        data = json.loads(self.file.read_text())
        self.expect(
            list(data) == ["info", "licenses", "categories", "images", "annotations"]
            + ["scenes"] * (self.compat == "coco"), f"top-level keys {list(data)}")
        self.categories = {category["id"]: category["name"] for category in data["categories"]}
        names = [category["name"] for category in data["categories"]]
        self.expect(names == ["object"] + sorted(set(names) - {"object"}) and (self.compat == "coco" or len(names) == 1)
                    and [c["id"] for c in data["categories"]] == list(range(1, len(names) + 1)),
                    f"categories {data['categories']}")
        with contextlib.redirect_stdout(sys.stderr):
            coco = COCO(str(self.file))
        images, annotations = data["images"], data["annotations"]
        self.bodies = {scene["id"]: {body["id"]: body for body in scene["bodies"]} for scene in data.get("scenes", [])}
        for bodies in self.bodies.values():
            self.expect(list(bodies) == list(range(1, len(bodies) + 1)), "ids of bodies are not 1, 2, 3 ...")
        self.ids(images, annotations)
        self.stems(images)
        unique = list({image["id"]: image for image in images}.values())
        unique = unique[self.first :: self.step]
        for image in unique:
            before = len(self.problems)
            try:
                self.image(image, coco.imgToAnns[image["id"]])
            except Exception as error:  # A reader that stumbles is a finding about the dataset.
                self.problems.append(f"{type(error).__name__}: {error}")
            self.problems[before:] = [f"image {image['id']}: {problem}" for problem in self.problems[before:]]
        self.expect(self.bbox_kinds, "`bbox` is neither always the visible nor always the amodal box")
        recipe = self.root / "parameters" / "recipe.toml"
        if self.expect(recipe.is_file(), "parameters/recipe.toml is missing") and sys.version_info >= (3, 11):
            import tomllib
            tomllib.loads(recipe.read_text())
        return unique, annotations

    def ids(self, images, annotations):
        ids = [annotation["id"] for annotation in annotations]
        self.expect(ids == list(range(1, len(ids) + 1)), "annotation ids are not 1, 2, 3 ...")
        known = {image["id"] for image in images}
        self.expect(all(a["image_id"] in known for a in annotations), "an annotation of an image that is not listed")
        image_ids = [image["id"] for image in images]
        self.expect(image_ids == sorted(image_ids), "images are not in the order of their ids")
        of = [annotation["image_id"] for annotation in annotations]
        self.expect(of == sorted(of), "annotations are not in the order of their images")
        if self.compat == "syntable_1":
            self.expect(image_ids == of, "images[n] is not the image of annotations[n]")
        else:
            self.expect(len(known) == len(images), "an image is listed twice")

    def stems(self, images):
        folders = {name: self.root / "data" / "mono" / name for name in ("rgb", "depth", "occlusion_order")}
        stems = {name: {path.stem for path in folder.iterdir() if re.fullmatch(r"\d+_\d+\.(png|npy)", path.name)}
                 for name, folder in folders.items()}
        self.expect(stems["rgb"] == stems["depth"] == stems["occlusion_order"],
                    "rgb, depth and occlusion_order do not have the same files")
        listed = {pathlib.PurePosixPath(image["file_name"]).stem for image in images}
        self.expect(listed <= stems["rgb"], f"listed but not there: {sorted(listed - stems['rgb'])[:5]}")

    def image(self, image, annotations):
        missing = (IMAGE_KEYS | (COCO_IMAGE_KEYS if self.compat == "coco" else set())) - image.keys()
        if not self.expect(not missing, f"keys missing: {sorted(missing)}"):
            return
        size = (image["width"], image["height"])
        with Image.open(self.root / image["file_name"]) as rgb:
            self.expect(rgb.format == "PNG" and rgb.mode == "RGB" and rgb.size == size,
                        f"{image['file_name']}: {rgb.format} {rgb.mode} {rgb.size}")
            rgb.load()
        with Image.open(self.root / image["depth_file_name"]) as depth:
            self.expect(depth.format == "PNG" and depth.mode in ("I;16", "I") and depth.size == size,
                        f"{image['depth_file_name']}: {depth.format} {depth.mode} {depth.size}")
            depth_mm = np.array(depth, dtype=np.int64)
        stem = pathlib.PurePosixPath(image["file_name"]).stem
        self.expect(image["file_name"] == f"data/mono/rgb/{stem}.png"
                    and image["depth_file_name"] == f"data/mono/depth/{stem}.png"
                    and image["occlusion_order_file_name"] == f"data/mono/occlusion_order/{stem}.npy",
                    "file names do not belong together")

        masks = [self.annotation(annotation, image) for annotation in annotations]
        visible, amodal, occluded = ([m[i] for m in masks] for i in range(3))
        if masks:
            self.expect(np.max(np.sum(visible, axis=0, dtype=int)) <= 1, "visible masks overlap")
            self.expect(np.all(depth_mm[np.any(visible, axis=0)] > 0), "a visible pixel without depth")
        self.order(image, visible, occluded)
        if self.compat == "coco":
            self.coco_image(image, annotations, stem)
            if self.npz:
                self.archive(image, annotations, visible, amodal)

    def archive(self, image, annotations, visible, amodal):
        with np.load(self.npz / f"{image['scene_id']:06}_{image['view_id']:04}.npz", allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        ids = np.array([annotation["instance_id"] for annotation in annotations], dtype=int)
        shown = np.zeros((image["height"], image["width"]), dtype=int)
        for i, mask in zip(ids, visible):
            shown[mask] = i
        bits = np.unpackbits(arrays["amodal_bits"], axis=2, count=image["width"])
        with Image.open(self.root / image["file_name"]) as rgb:
            self.expect(np.array_equal(arrays["rgb"], np.asarray(rgb)), "npz: rgb")
        for name, got, want in (
                ("ids", arrays["ids"], ids), ("visible_ids", arrays["visible_ids"], shown),
                ("amodal_bits", bits, np.array(amodal).reshape((len(ids),) + shown.shape)),
                ("amodal_box", arrays["amodal_box"], [a["amodal_bbox"] for a in annotations]),
                ("category_id", arrays["category_id"], [a["category_id"] for a in annotations]),
                ("occlusion_order", arrays["occlusion_order"], np.load(self.root / image["occlusion_order_file_name"]))):
            self.expect(np.array_equal(got, np.reshape(want, got.shape)), f"npz: {name}")

    def order(self, image, visible, occluded):
        path = self.root / image["occlusion_order_file_name"]
        order = np.load(path)
        raw = path.read_bytes()
        n = len(visible)
        self.expect(raw[:8] == b"\x93NUMPY\x01\x00" and len(raw) == 128 + 8 * n * n,
                    f"{path.name}: not a version 1.0 file with a header of 128 bytes ({len(raw)} bytes)")
        if not self.expect(order.dtype == np.dtype("<f8") and order.shape == (n, n) and order.flags.c_contiguous,
                           f"{path.name}: {order.dtype} {order.shape}, not float64 ({n}, {n})"):
            return
        # Algorithm 1 of the paper.
        want = np.zeros((n, n))
        for i in range(n):
            for j in range(n):
                if i != j and np.count_nonzero(visible[i] & occluded[j]) > 0:
                    want[i, j] = 1.0
        self.expect(np.array_equal(order, want), f"{path.name}: not the order of the masks\n{order}\ninstead of\n{want}")
        self.edges += int(order.sum())

    def annotation(self, annotation, image):
        name = f"annotation {annotation['id']}"
        wanted = ANNOTATION_KEYS | (COCO_ANNOTATION_KEYS if self.compat == "coco" else set())
        self.expect(not wanted - annotation.keys(), f"{name}: keys missing: {sorted(wanted - annotation.keys())}")
        self.expect((annotation["width"], annotation["height"]) == (image["width"], image["height"]), f"{name}: size")
        self.expect(annotation["category_id"] in self.categories and annotation["iscrowd"] == 0,
                    f"{name}: category or iscrowd")
        amodal, visible, occluded = (
            self.decode(annotation[key], image, f"{name}, {key}") for key in ("segmentation", "visible_mask", "occluded_mask"))
        self.expect(amodal.any(), f"{name}: the amodal mask is empty")
        self.expect(not np.any(visible & ~amodal), f"{name}: visible pixels outside the amodal mask")
        self.expect(np.array_equal(occluded, amodal & ~visible), f"{name}: occlusion is not amodal minus visible")
        a, v, o = (int(np.count_nonzero(m)) for m in (amodal, visible, occluded))
        self.amodal_px, self.occluded_px, self.occluded = self.amodal_px + a, self.occluded_px + o, self.occluded + (o > 0)

        visible_box, amodal_box = box(visible), box(amodal)
        self.expect(annotation["visible_bbox"] == visible_box, f"{name}: visible_bbox, not {visible_box}")
        self.bbox_kinds -= {kind for kind, b in (("visible", visible_box if v else amodal_box), ("amodal", amodal_box)) if annotation["bbox"] != b}
        rate = annotation["occluded_rate"]
        self.expect(isinstance(rate, (int, float)) and 0 <= rate <= 1, f"{name}: rate {rate}")
        if self.compat == "syntable_1":
            self.expect(annotation["area"] == 0, f"{name}: area {annotation['area']}, the released program writes 0")
            self.expect(annotation["segmentation"]["area"] == 10 * a, f"{name}: the release writes ten times the area")
            self.expect("/" not in annotation["object_name"], f"{name}: a slash in the name")
            self.expect(annotation["visible_mask"]["area"] == v, f"{name}: area inside visible_mask, not {v}")
            self.expect(annotation["occluded_mask"]["area"] == o, f"{name}: area inside occluded_mask, not {o}")
            self.expect(rate == round(o / a, 2), f"{name}: rate {rate}, not {round(o / a, 2)}")
            self.expect(v > 0 and rate < 1.0, f"{name}: the released program leaves out what is not seen")
        else:
            got = [annotation[key] for key in ("area", "visible_area", "occluded_area")]
            self.expect(got == [a, v, o], f"{name}: areas {got}, not {[a, v, o]}")
            self.expect(annotation["amodal_bbox"] == amodal_box, f"{name}: amodal_bbox, not {amodal_box}")
            self.expect(annotation["occluded_rate_rounded"] == round(rate, 2), f"{name}: rounded rate")
            self.policy(annotation, image["label_policy"], a, v, o, name)
        return visible, amodal, occluded

    def policy(self, annotation, policy, a, v, o, name):
        rate = annotation["occluded_rate"]
        if policy["image_frame"] == "clip":
            self.expect(math.isclose(rate, o / a, rel_tol=1e-12, abs_tol=1e-15), f"{name}: rate {rate}, not {o / a}")
        else:
            # Whole area >= amodal area, so that at least as much is hidden; the whole area is a whole number.
            self.expect(rate >= o / a - 1e-12, f"{name}: rate {rate} below {o / a}")
            if rate < 1:
                whole = v / (1 - rate)
                self.expect(abs(whole - round(whole)) < 1e-6 * max(whole, 1), f"{name}: rate {rate} is no ratio of areas")
        self.expect(v >= policy["min_visible_px"], f"{name}: {v} visible pixels, against the label policy")
        self.expect(rate <= policy["max_occlusion_rate"], f"{name}: rate {rate}, against the label policy")

    def decode(self, rle, image, name):
        keys = {"size", "counts"} | ({"area"} if self.compat == "syntable_1" else set())
        self.expect(set(rle) == keys, f"{name}: keys {sorted(rle)}")
        self.expect(rle["size"] == [image["height"], image["width"]], f"{name}: size {rle['size']}")
        plain = {"size": rle["size"], "counts": rle["counts"]}
        pixels = coco_mask.decode(plain)
        again = coco_mask.encode(np.asfortranarray(pixels))["counts"].decode()
        self.expect(again == rle["counts"], f"{name}: pycocotools encodes it differently")
        self.expect(coco_mask.area(plain) == pixels.sum(), f"{name}: area of the runs")
        if pixels.any():
            self.expect(coco_mask.toBbox(plain).tolist() == box(pixels > 0), f"{name}: box of the runs")
        return pixels > 0

    def coco_image(self, image, annotations, stem):
        self.expect(stem == f"{image['scene_id']}_{image['view_id']}", f"{stem}: not the scene and view of the record")
        ids = [annotation["instance_id"] for annotation in annotations]
        self.expect(ids == image["instance_ids"], f"instance_ids {image['instance_ids']}, annotations {ids}")
        self.expect(ids == sorted(set(ids)) and all(i >= 1 for i in ids), f"instance ids {ids}")
        camera = image["camera"]
        self.expect((camera["width"], camera["height"]) == (image["width"], image["height"]), "size of the camera")
        k = np.array(camera["K"])
        self.expect(k.shape == (3, 3) and k[0, 0] > 0 and k[1, 1] > 0 and k[2].tolist() == [0, 0, 1], f"K {k}")
        world_from_camera, camera_from_world = (
            self.rigid(camera[key], key) for key in ("world_from_camera", "camera_from_world"))
        self.expect(np.allclose(world_from_camera @ camera_from_world, np.eye(4), atol=1e-9), "camera poses disagree")
        for annotation in annotations:
            info = annotation["object"]
            if not self.expect(info is not None, f"annotation {annotation['id']}: it has no `object`"):
                continue
            world, seen = (self.rigid(info[key], key) for key in ("world_from_object", "camera_from_object"))
            self.expect(np.allclose(camera_from_world @ world, seen, atol=1e-9),
                        f"annotation {annotation['id']}: poses disagree")
            self.expect(info["name"] == annotation["object_name"], f"annotation {annotation['id']}: names disagree")
            category = self.categories.get(annotation["category_id"])
            self.expect(category == (info["category"] if info["category"] in self.categories.values() else "object"),
                        f"annotation {annotation['id']}: category {category} of {info['category']}")
            body = self.bodies.get(image["scene_id"], {}).get(annotation["instance_id"], {})
            self.expect(body.get("role") == "object" and body.get("name") == info["name"],
                        f"annotation {annotation['id']}: not in the list of bodies")

    def rigid(self, rows, name):
        pose = np.array(rows, dtype=float)
        rotation = pose[:3, :3]
        self.expect(pose.shape == (4, 4) and pose[3].tolist() == [0, 0, 0, 1]
                    and np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9) and np.linalg.det(rotation) > 0,
                    f"{name} is not a rigid motion: {rows}")
        return pose


def box(mask):
    """[x, y, width, height] of a mask, with width = last - first + 1; zeros if it is empty."""
    ys, xs = np.nonzero(mask)
    if not len(xs):
        return [0, 0, 0, 0]
    return [int(xs.min()), int(ys.min()), int(xs.max() - xs.min() + 1), int(ys.max() - ys.min() + 1)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=pathlib.Path)
    parser.add_argument("--compat", choices=["coco", "syntable_1"], default="coco", help="form of the annotation file")
    parser.add_argument("--annotations", default="annotation_final.json", help="name of the annotation file")
    parser.add_argument("--npz", help="folder of archives of the writer npz, with its default products")
    parser.add_argument("--part", default="0/1", help="look at the images I, I + N, I + 2 N ..., from 0: `I/N`")
    options = parser.parse_args()
    if not (options.dataset / options.annotations).is_file():
        print(f"{options.dataset / options.annotations} is not there", file=sys.stderr)
        return 2
    checker = Checker(options.dataset, options.compat, options.annotations, options.npz, options.part)
    images, annotations = checker.run()
    if checker.problems:
        for problem in checker.problems[:40]:
            print(problem, file=sys.stderr)
        print(f"{options.dataset}: {len(checker.problems)} problems", file=sys.stderr)
        return 1
    if not annotations:
        print(f"{options.dataset}: no annotation, nothing to check", file=sys.stderr)
        return 2
    rate = checker.occluded_px / checker.amodal_px
    print(f"{options.dataset}: {len(images)} images, {len(annotations)} annotations, {checker.occluded} occluded, "
          f"{checker.edges} occlusions in order, {100 * rate:.2f} % of amodal pixels hidden: all checks passed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
