#!/usr/bin/env python3
"""Statistics of a dataset's clutter, as the SynTable paper defines them (Table 1), beside the published ones.

    python3 tests/statistics.py dataset DIR...                      of datasets in SynTable's layout
    python3 tests/statistics.py recipe RECIPE... [--scenes 60] [--views 3] [--set KEY=VALUE]...

`recipe` runs the scenes of a recipe with labels alone, without light, into a temporary folder. The program is
`--program`, by default target/release/syntable.

Columns:
  VI/image   records per image: pairs of object and view with at least one visible pixel
  OI/VI      fraction of these records of which another object hides at least one pixel
  rate       hidden pixels of all records over amodal pixels of all records (weighted by pixels, not a mean of rates)
  area       amodal pixels per record
  kept       objects that are still on the table over objects that were dropped

`+-` is the standard error over scenes, by the jackknife: views of a scene are not independent.
"""

import argparse
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile
from collections import defaultdict

from pycocotools import mask as coco_mask

# Records, records with a hidden pixel, rate and amodal pixels of the published annotation files; images.
PUBLISHED = {
    "SynTable-Sim train, published": (654837, 437431, 0.178626, 3684639182, 45000),
    "SynTable-Sim val, published": (89617, 45490, 0.116292, 189557555, 5000),
}
COLUMNS = ("VI/image", "OI/VI", "rate", "area")


class Counts:
    """Sums over the views of a scene."""

    def __init__(self):
        self.images = self.visible = self.occluded = self.hidden_px = self.amodal_px = 0

    def add(self, visible_px, hidden_px, amodal_px):
        if visible_px > 0:
            self.visible += 1
            self.occluded += hidden_px > 0
            self.hidden_px += hidden_px
            self.amodal_px += amodal_px

    def row(self):
        ratio = lambda a, b: a / b if b else math.nan
        return (ratio(self.visible, self.images), ratio(self.occluded, self.visible),
                ratio(self.hidden_px, self.amodal_px), ratio(self.amodal_px, self.visible))


def total(scenes):
    sums = Counts()
    for scene in scenes:
        for name, value in vars(scene).items():
            setattr(sums, name, getattr(sums, name) + value)
    return sums.row()


def errors(scenes):
    """Standard errors of the columns by the jackknife over scenes."""
    n = len(scenes)
    if n < 2:
        return (math.nan,) * len(COLUMNS)
    rows = [total(scenes[:i] + scenes[i + 1:]) for i in range(n)]
    means = [sum(column) / n for column in zip(*rows)]
    return tuple(math.sqrt((n - 1) / n * sum((value - mean) ** 2 for value in column))
                 for column, mean in zip(zip(*rows), means))


def area(rle):
    return int(coco_mask.area({"size": rle["size"], "counts": rle["counts"].encode()}))


def of_dataset(root):
    data = json.loads((root / "annotation_final.json").read_text())
    scenes, scene_of = defaultdict(Counts), {}
    for image in data["images"]:
        if image["id"] not in scene_of:
            scene_of[image["id"]] = pathlib.PurePath(image["file_name"]).stem.split("_")[0]
            scenes[scene_of[image["id"]]].images += 1
    for record in data["annotations"]:
        masks = (record["visible_mask"], record["occluded_mask"], record["segmentation"])
        scenes[scene_of[record["image_id"]]].add(*map(area, masks))
    return list(scenes.values()), None


def of_recipe(recipe, options):
    """Runs a recipe with labels alone. Returns the counts of its scenes, and the fraction of objects that stay."""
    with tempfile.TemporaryDirectory() as folder:
        derived, out = pathlib.Path(folder) / "labels.toml", pathlib.Path(folder) / "dataset"
        plan = subprocess.run([options.program, "plan", recipe] + sets(options), check=True, capture_output=True, text=True)
        writers = sorted(set(re.findall(r"\bwrite\.\w+", plan.stdout)))
        derived.write_text(
            f"extends = {json.dumps(str(pathlib.Path(recipe).resolve()))}\nremove = {json.dumps(writers)}\n"
            '[write.jsonl]\ninclude = ["visible_mask", "occlusion_mask", "amodal_mask"]\n'
            '[write.reports]\nkind = "jsonl"\ninclude = ["settle_report"]\nper = "scene"\n')
        subprocess.run(
            [options.program, "run", derived, "--out", out, "--set", f"dataset.scenes={options.scenes}", "--views",
             str(options.views)] + sets(options),
            check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL if options.quiet else None)
        scenes = defaultdict(Counts)
        for line in (out / "jsonl.jsonl").read_text().splitlines():
            record = json.loads(line)
            counts = scenes[record["scene"]]
            counts.images += 1
            for key, amodal in record["amodal_mask"].items():
                counts.add(area(record["visible_mask"][key]), area(record["occlusion_mask"][key]), area(amodal))
        reports = [json.loads(line)["settle_report"] for line in (out / "reports.jsonl").read_text().splitlines()]
        kept = sum(report["objects"] for report in reports)
        dropped = kept + sum(len(report["removed"]) for report in reports)
        return list(scenes.values()), kept / dropped


def sets(options):
    return [argument for value in options.set for argument in ("--set", value)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("of", choices=["dataset", "recipe"])
    parser.add_argument("paths", nargs="+", type=pathlib.Path)
    parser.add_argument("--scenes", type=int, default=60)
    parser.add_argument("--views", type=int, default=3)
    parser.add_argument("--set", action="append", default=[])
    parser.add_argument("--quiet", action="store_true", help="do not show what the program says")
    parser.add_argument("--program", default="target/release/syntable")
    options = parser.parse_args()
    print(f"{'':38} {'VI/image':>14} {'OI/VI':>15} {'rate':>17} {'area':>13} {'kept':>6}")
    for name, (visible, occluded, rate, amodal_px, images) in PUBLISHED.items():
        print(f"{name:38} {visible / images:8.1f}       {occluded / visible:9.3f}       {rate:9.3f}         "
              f"{amodal_px / visible:9.0f}")
    for path in options.paths:
        scenes, kept = of_dataset(path) if options.of == "dataset" else of_recipe(path, options)
        (vi, oi, rate, px), (e_vi, e_oi, e_rate, e_px) = total(scenes), errors(scenes)
        print(f"{str(path)[-38:]:38} {vi:8.1f} +-{e_vi:4.1f}{oi:9.3f} +-{e_oi:5.3f}{rate:9.3f} +-{e_rate:5.3f}"
              f"{px:9.0f} +-{e_px:4.0f}" + (f"{kept:6.2f}" if kept is not None else ""), flush=True)


if __name__ == "__main__":
    sys.exit(main())
