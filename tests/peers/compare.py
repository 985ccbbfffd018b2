#!/usr/bin/env python3
"""Compares a renderer with Mitsuba 3, and with Blender's Cycles if it is installed. Not part of CI.

    cargo build --release
    python3 -m venv /tmp/peers && /tmp/peers/bin/pip install mitsuba pyoidn numpy pillow flip-evaluator bpy==5.0.1
    apt-get install libllvm19                # or a newer one
    /tmp/peers/bin/python tests/peers/compare.py

Needs Python 3.11 and, for Mitsuba, an LLVM library: the newest in /usr/lib/*-linux-gnu is taken unless
`DRJIT_LIBLLVM_PATH` names one. `pyoidn` (Open Image Denoise), `flip-evaluator` and `bpy` (Cycles) may be missing: then
what needs them is left out. With `ASSETS` naming a folder that holds `gso`, the comparison of speed takes Google
Scanned Objects in place of the embedded ones.

`correctness`: scenes of materials that mean the same in both renderers go out through the `gltf` writer, are read by
glb.py and rendered by Mitsuba; the mean radiance of every region must agree within 1 % (2 % where surfaces of other
models light it), or three standard errors if that is more.

`speed`: twenty objects in a closed room, 640 × 480, eight bounces. All times are wall-clock and for the scene loaded
and kernels compiled; errors are against each renderer's own converged image. Nothing else should run meanwhile. On a
card: `MITSUBA_VARIANT=cuda_ad_rgb compare.py speed --renderer gpu_path`.

With `--book`, tables and images go to the book.
"""

import argparse
import os
import tempfile
from pathlib import Path

import correctness
import speed
from book import BOOK, ROOT, publish, save


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="?", choices=["correctness", "speed", "all"], default="all")
    parser.add_argument("--binary", type=Path, default=ROOT / "target" / "release" / "syntable")
    parser.add_argument("--work", type=Path, help="folder for what is made on the way; a temporary one if left out")
    parser.add_argument("--renderer", default="cpu_path", help="our renderer in `speed`")
    parser.add_argument("--quick", action="store_true", help="few samples: to see that everything runs")
    parser.add_argument("--patience", type=float, default=120, help="seconds for each converged image of `speed`")
    parser.add_argument("--book", action="store_true", help="write tables and images to the book")
    arguments = parser.parse_args()
    agree = True
    with tempfile.TemporaryDirectory() as temporary:
        work = arguments.work or Path(temporary)
        work.mkdir(parents=True, exist_ok=True)
        if arguments.what != "speed":
            views, samples = (4, 16) if arguments.quick else (24, 32)
            table, image, agree = correctness.compare(arguments.binary, work, views, samples)
            publish(table, "correctness", "compare.py", arguments.book)
            save(image, BOOK / "images" / "comparison.png" if arguments.book else work / "comparison.png")
            print("all regions agree" if agree else "REGIONS DIFFER", flush=True)
        if arguments.what != "correctness":
            assets = os.environ.get("ASSETS")
            patience = 4 if arguments.quick else arguments.patience
            table = speed.compare(arguments.binary, work, Path(assets) if assets else None, patience, arguments.renderer)
            publish(table, "speed", "compare.py", arguments.book)
    return 0 if agree else 1


if __name__ == "__main__":
    raise SystemExit(main())
