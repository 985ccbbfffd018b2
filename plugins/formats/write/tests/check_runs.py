#!/usr/bin/env python3
"""Compares compressed runs with those of pycocotools, byte for byte.

    python3 check_runs.py FILE      lines of {"size": [height, width], "counts": ..., "rows": ["01..", ...]}
"""

import json
import pathlib
import sys

import numpy as np
from pycocotools import mask as coco_mask


def main():
    lines = pathlib.Path(sys.argv[1]).read_text().splitlines()
    for line in lines:
        record = json.loads(line)
        pixels = np.array([[int(c) for c in row] for row in record["rows"]], dtype=np.uint8)
        want = coco_mask.encode(np.asfortranarray(pixels))
        assert list(want["size"]) == record["size"], record
        assert want["counts"].decode() == record["counts"], f"{record} instead of {want}"
        got = {"size": record["size"], "counts": record["counts"]}
        assert int(coco_mask.area(got)) == record["area"] == int(pixels.sum()), record
        assert coco_mask.toBbox(got).astype(int).tolist() == record["bbox"], (record, coco_mask.toBbox(got))
    assert lines
    print(f"{len(lines)} masks")


if __name__ == "__main__":
    main()
