"""Compares Parquet tables with the products that they were made from.

usage: check_parquet.py FOLDER instances|views files|embedded|none
       check_parquet.py FOLDER pandas
       check_parquet.py FOLDER datasets instances|views
"""

import io
import json
import pathlib
import sys

import numpy as np

ROOT, MODE = pathlib.Path(sys.argv[1]), sys.argv[2]
TABLES = ROOT / "table"
TRUTH = [json.loads(line) for line in (ROOT / "truth.jsonl").open()]
BY_VIEW = {(line["scene"], line["view"]): line["products"] for line in TRUTH}
CATEGORIES = {1: "object", 2: "böwl", 3: "mug"}


def same(got, want, what):
    assert got == want, f"{what}: {got!r}, not {want!r}"


def image_of(scene, view):
    return np.frombuffer((ROOT / f"{scene}_{view}.rgb").read_bytes(), np.uint8).reshape(48, 64, 3)


def strict(text):
    """JSON without what only Python takes."""
    def refuse(constant):
        raise ValueError(constant)
    return json.loads(text, parse_constant=refuse)


def wants_of_instance(products, i):
    """The cells of an instance by column, from the products."""
    of = lambda name: products[name].get(i)
    flat = lambda rows: [x for row in rows for x in row]
    info, counts = of("object_info"), of("visibility")
    return {
        "asset": info["asset"],
        "obj_id": info.get("obj_id"),
        "mass_kg": None,
        "model_origin_m": info.get("model_origin_m"),
        "world_from_object": flat(info["world_from_object"]),
        "camera_from_object": flat(info["camera_from_object"]),
        "object_name": of("object_name"),
        "visible_box": of("visible_box"),
        "occlusion_rate": of("occlusion_rate"),
        "visible_mask": of("visible_mask"),
        "amodal_mask": of("amodal_mask"),
        "flag": of("flag"),
        "wide": of("wide"),
        **{k: counts[k] for k in ("px_count_all", "px_count_in_frame", "px_count_valid", "px_count_visib", "visib_fract")},
    }


def check_instance(row, products, i):
    from pycocotools import mask as coco

    what = f"{row['scene']} {row['view']} {i}"
    for column, want in wants_of_instance(products, i).items():
        same(row[column], want, f"{what}: {column}")
    for name in ("visible_mask", "amodal_mask"):
        pixels = coco.decode(row[name])
        same((pixels.shape, int(pixels.sum())), ((48, 64), row[f"{name}_area"]), f"{what}: {name}")
        if name == "visible_mask" and pixels.any():
            same([int(x) for x in coco.toBbox(row[name])], row["visible_box"], f"{what}: box")
    same(strict(row["amodal_outline"]), products["amodal_outline"][i], f"{what}: outline")
    same(row["category"], CATEGORIES[row["category_id"]], f"{what}: category")


def check_view(row, products):
    what = f"{row['scene']} {row['view']}"
    same((row["width"], row["height"]), (64, 48), f"{what}: size")
    same(row["K"], [x for r in products["camera"]["K"] for x in r], f"{what}: K")
    same(len(row["world_from_camera"]), 16, f"{what}: pose")
    distortion = "distortion_k1_k2_p1_p2_k3"
    same(row[distortion], products["camera"].get(distortion), f"{what}: distortion")
    same(row[distortion] is not None, row["view"] == 1, f"{what}: which view has distortion")
    for name in ("label_policy", "note", "settle_report", "late"):
        text = row[name]
        same(None if text is None else strict(text), products[name], f"{what}: {name}")


def check_image(row, images):
    from PIL import Image

    want = image_of(row["scene"], row["view"])
    if images == "files":
        image = Image.open(TABLES / MODE / row["image_file"])
    elif images == "embedded":
        same(row["image"]["path"], f"{row['scene']:06}_{row['view']:04}.png", "path")
        image = Image.open(io.BytesIO(row["image"]["bytes"]))
    else:
        assert "image" not in row and "image_file" not in row
        return
    assert (np.array(image) == want).all() and image.mode == "RGB"


def check_pyarrow(images):
    import pyarrow as pa
    import pyarrow.parquet as pq

    paths = sorted((TABLES / MODE).glob("*.parquet"))
    same([p.name for p in paths], [f"{i:06}.parquet" for i in range(4)], "tables")
    schemas = [pq.read_schema(path) for path in paths]
    assert all(schema.equals(schemas[0], check_metadata=True) for schema in schemas), schemas
    one = lambda t: t if MODE == "instances" else pa.list_(t)
    rle = pa.struct([("size", pa.list_(pa.int64())), ("counts", pa.string())])
    of_type = lambda t: pa.list_(t) if t in (pa.int64(), pa.float64()) else t
    wants = {
        "scene": pa.int64(), "instance": one(pa.int64()), "occlusion_rate": one(pa.float64()), "flag": one(pa.bool_()),
        "asset": one(pa.string()), "visible_box": one(pa.list_(pa.int64())), "K": pa.list_(pa.float64()),
        "visible_mask": one(rle), "note": pa.string(), "amodal_outline": one(pa.string()), "mass_kg": one(pa.float64()),
    }
    for column, want in wants.items():
        got = schemas[0].field(column).type
        # Names of list elements do not matter.
        assert str(got).replace("element:", "item:") == str(want).replace("element:", "item:"), f"{column}: {got}"
    rows = pa.concat_tables([pq.read_table(path) for path in paths]).to_pylist()
    counted = {"rows": len(rows), "instances": 0, "hidden": 0, "null": 0, "empty views": 0}
    found = []
    for row in rows:
        products = BY_VIEW[row["scene"], row["view"]]
        check_view(row, products)
        check_image(row, images)
        if MODE == "instances":
            found.append((row["scene"], row["view"], row["instance"]))
            instances = [row]
        else:
            ids = row["instance"]
            found.extend((row["scene"], row["view"], i) for i in ids)
            counted["empty views"] += not ids
            lists = [k for k in row if k in wants_of_instance(products, str(ids[0])) or k in (
                "visible_mask_area", "amodal_mask_area", "amodal_outline", "category", "category_id")] if ids else []
            assert all(len(row[k]) == len(ids) for k in lists)
            instances = [{**row, **{k: row[k][n] for k in lists}} for n in range(len(ids))]
        for instance, (_, _, i) in zip(instances, found[-len(instances):] if instances else [], strict=True):
            check_instance(instance, products, str(i))
            counted["instances"] += 1
            counted["hidden"] += instance["visible_mask_area"] == 0
            counted["null"] += instance["flag"] is None
    same(found, [(l["scene"], l["view"], int(i)) for l in TRUTH for i in l["products"]["amodal_mask"]], "instances")
    if MODE == "views":
        same([(r["scene"], r["view"]) for r in rows], list(BY_VIEW), "views")
        assert counted["empty views"] > 2
    else:
        same(pq.read_table(paths[3]).num_rows, 0, "rows of a scene in which nothing is seen")
    assert min(counted[k] for k in ("instances", "hidden", "null")) > 3, counted
    print(f"parquet {MODE}, images {images}: {counted}")


def check_pandas():
    import pandas

    table = pandas.read_parquet(TABLES / "instances")
    rates = [r for l in TRUTH for r in l["products"]["occlusion_rate"].values()]
    same(len(table[table.occlusion_rate > 0.5]), sum(r > 0.5 for r in rates), "hidden instances")
    same(table.visible_mask_area.sum(), sum(v["px_count_visib"] for l in TRUTH for v in l["products"]["visibility"].values()), "pixels")
    same([str(table[c].dtype) for c in ("scene", "occlusion_rate", "wide")], ["int64", "float64", "int64"], "types")
    same(int(table.wide.min()), -(2**63) + 1, "large integers")
    print(f"pandas: {len(table)} rows")


def check_datasets(rows):
    import datasets
    from pycocotools import mask as coco

    files = str(TABLES / rows / "*.parquet")
    data = datasets.load_dataset("parquet", data_files=files, split="train", cache_dir=str(ROOT / "cache"))
    counted = 0
    if rows == "views":
        assert isinstance(data.features["image"], datasets.Image), data.features
        for row in data:
            products = BY_VIEW[row["scene"], row["view"]]
            assert (np.array(row["image"]) == image_of(row["scene"], row["view"])).all()
            same([coco.area(rle) for rle in row["visible_mask"]], row["visible_mask_area"], "areas")
            same(row["occlusion_rate"], list(products["occlusion_rate"].values()), "rates")
            counted += 1
        same(counted, len(TRUTH), "views")
    else:
        for row in data.filter(lambda row: row["occlusion_rate"] > 0.3):
            same(row["occlusion_rate"], BY_VIEW[row["scene"], row["view"]]["occlusion_rate"][str(row["instance"])], "rate")
            counted += 1
        assert counted > 5
    print(f"datasets {rows}: {counted} rows")


if MODE == "pandas":
    check_pandas()
elif MODE == "datasets":
    check_datasets(sys.argv[3])
else:
    check_pyarrow(sys.argv[3])
