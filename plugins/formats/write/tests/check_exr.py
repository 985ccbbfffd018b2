#!/usr/bin/env python3
"""Compares the files of the exr writer, read by OpenEXR, with those of the npy writer.

    python3 check_exr.py DATASET

The dataset has the folders `exr` and `npy` with the same products, and `layers/exr` with the same in one file.
"""

import pathlib
import sys

import numpy as np
import OpenEXR

CHANNELS = {
    "radiance": "RGB", "depth": "Z", "normal": "XYZ", "heat": "Y", "flow": "XY", "layers": "RGBA", "thickness": "Y",
}


def main():
    root = pathlib.Path(sys.argv[1])
    files = sorted((root / "exr").rglob("*.exr"))
    (layered,) = (root / "layers" / "exr").glob("*.exr")
    layers = OpenEXR.File(str(layered), separate_channels=True).channels()
    for path in files:
        product = path.parent.name
        if product == "thickness":
            stem, instance = path.stem.rsplit("_", 1)
            ids = np.load(root / "npy" / product / f"{stem}_ids.npy")
            want = np.load(root / "npy" / product / f"{stem}.npy")[list(ids).index(int(instance))]
        else:
            want = np.load(root / "npy" / product / f"{path.stem}.npy")
        channels = OpenEXR.File(str(path), separate_channels=True).channels()
        assert sorted(channels) == sorted(CHANNELS[product]), f"{path}: {sorted(channels)}"
        got = np.stack([channels[name].pixels for name in CHANNELS[product]], axis=-1)
        want = want.reshape(got.shape)
        assert got.dtype == want.dtype == np.float32, f"{path}: {got.dtype}"
        assert np.array_equal(got.view(np.uint32), want.view(np.uint32)), f"{path}: other values"
        layer = f"thickness_{int(instance):04}" if product == "thickness" else product
        prefix = "" if product == "radiance" else f"{layer}."
        same = np.stack([layers.pop(prefix + name).pixels for name in CHANNELS[product]], axis=-1)
        assert np.array_equal(same.view(np.uint32), want.view(np.uint32)), f"{layered}: {layer} differs"
    assert len(files) == 8 and not layers, (files, sorted(layers))
    print(f"{len(files)} EXR files")


if __name__ == "__main__":
    main()
