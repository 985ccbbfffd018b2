#!/usr/bin/env python3
"""Compares the samples of the webdataset writer, read by the package webdataset, with the files of other writers.

    python3 check_webdataset.py DATASET

The dataset has the shards `wds` and `float`, the folders `png`, `exr` and `npy`, and `all.jsonl`, of the same views.
"""

import io
import json
import pathlib
import sys
import tarfile

import numpy as np
import webdataset


def samples(folder):
    shards = sorted(folder.glob("*.tar"))
    assert [p.name for p in shards] == [f"{folder.name}-{i:06}.tar" for i in range(3)], shards
    for shard in shards:
        with tarfile.open(shard) as tar:
            for member in tar:
                facts = (member.mtime, member.mode, member.uid, member.gid, member.uname, member.gname, member.isfile())
                assert facts == (0, 0o644, 0, 0, "", "", True), (member.name, facts)
    return list(webdataset.WebDataset([str(p) for p in shards], shardshuffle=False))


def main():
    root = pathlib.Path(sys.argv[1])
    records = {}
    for line in (root / "all.jsonl").read_text().splitlines():
        record = json.loads(line)
        records[f"{record.pop('scene'):06}_{record.pop('view'):04}"] = record
    found = samples(root / "wds")
    assert [s["__key__"] for s in found] == sorted(records) and len(found) == 9, [s["__key__"] for s in found]
    fields = 0
    for sample in found:
        key = sample["__key__"]
        for field, data in sample.items():
            if field.startswith("__"):
                continue
            fields += 1
            name, end = field.split(".", 1)
            if end == "json":
                assert json.loads(data) == records[key][name], f"{key}.{field}"
            elif end == "png":
                assert data == (root / "png" / name / f"{key}.png").read_bytes(), f"{key}.{field}"
            else:
                assert end in ("npy", "ids.npy"), field
                suffix = "_ids" if end == "ids.npy" else ""
                assert data == (root / "npy" / name / f"{key}{suffix}.npy").read_bytes(), f"{key}.{field}"
                np.load(io.BytesIO(data), allow_pickle=False)
    # Two PNG, seven arrays of which three have ids, three records.
    assert fields == 9 * 15, fields
    floats = samples(root / "float")
    for sample in floats:
        key = sample["__key__"]
        assert set(sample) - {"__key__", "__url__", "__local_path__"} == {"depth.exr", "rgb.png"}, set(sample)
        assert sample["depth.exr"] == (root / "exr" / "depth" / f"{key}.exr").read_bytes(), key
    print(f"{len(found)} samples, {fields} fields")


if __name__ == "__main__":
    main()
