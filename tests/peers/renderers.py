#!/usr/bin/env python3
"""Compares the images and labels of `gpu_path` with those of `cpu_path`, on whole recipes. Not part of CI.

    renderers.py make FOLDER        renders every recipe with both; needs a graphics card, and nothing but Python
    renderers.py judge FOLDER       prints the table; needs numpy, pillow and flip-evaluator

With `ASSETS` naming a folder of real objects (the book's page on them says what lies in it), the recipes with real objects
are rendered, too. The numbers of both renderers are the same, so that noise cancels where rounding sends no path another
way; z is the difference of a pixel's luminance over its standard error as if they were independent.
"""

import argparse
import os
import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
KINDS = ("cpu_path", "gpu_path")
EMBEDDED = ("quickstart", "window-room", "ceiling-room", "clutter", "open-sky")
REAL = ("real-objects", "real-surroundings")
INCLUDE = ["radiance", "radiance_variance", "depth", "instance", "coverage"]

# Regions of fewer pixels say little.
SMALLEST_REGION = 200

# Relative error of a sum of samples.
ROUNDING = 1e-5


def make(binary: Path, folder: Path, samples: int, size: list[int]) -> None:
    """One view of one scene of each recipe."""
    for recipe in EMBEDDED + (REAL if "ASSETS" in os.environ else ()):
        for kind in KINDS:
            settings = [
                f'render.kind="{kind}"',
                f"render.samples_per_pixel={samples}",
                f"camera.resolution={size}",
                'denoise.kind="none"',
                f"write={{ npz = {{ include = {INCLUDE} }} }}",
                "dataset.scenes=1",
                "dataset.views_per_scene=1",
            ]
            out = folder / recipe / kind
            command = [binary, "run", ROOT / "recipes" / f"{recipe}.toml", "--out", out, "--overwrite"]
            subprocess.run(command + [word for set in settings for word in ("--set", set)], check=True)


def judge(folder: Path, book: bool) -> bool:
    """Whether all agree."""
    import numpy as np

    import measures
    from book import publish

    lines = [
        "| recipe | pixels | RMS of z | region that differs most | mean | FLIP | depths | instances, coverages |",
        "|---" * 8 + "|",
    ]
    shown, agree, pixels, others = [], True, 0, 0
    for recipe in EMBEDDED + REAL:
        paths = [folder / recipe / kind / "npz" / "000000_0000.npz" for kind in KINDS]
        if not all(path.exists() for path in paths):
            continue
        try:
            cpu, gpu = (np.load(path) for path in paths)
        except (ValueError, zipfile.BadZipFile) as error:
            raise SystemExit(f"{recipe}: {error}; render it again") from error
        a, b = (one["radiance"].astype(np.float64) for one in (cpu, gpu))
        ya, yb = a @ measures.LUMINANCE, b @ measures.LUMINANCE
        variance = cpu["radiance_variance"].astype(np.float64) + gpu["radiance_variance"]
        # Sums of lights that are seen have no variance, and are rounded.
        z = np.sqrt(np.mean((yb - ya) ** 2 / np.maximum(variance, (ROUNDING * ya) ** 2)))
        worst, error = max(
            (abs(yb[mask].mean() / ya[mask].mean() - 1), np.sqrt(variance[mask].sum()) / ya[mask].sum())
            for mask in _regions(cpu["instance"])
        )
        mean = yb.mean() / ya.mean() - 1
        flip = measures.flip(b, a)
        depths = int((~np.isclose(cpu["depth"], gpu["depth"], rtol=1e-5, atol=0)).sum())
        labels = int(((cpu["instance"] != gpu["instance"]) | (cpu["coverage"] != gpu["coverage"]).any(-1)).sum())
        agree &= z < 0.3 and worst < max(0.005, 3 * error) and (flip is None or flip < 0.002)
        agree &= depths < ya.size / 1000
        (pixels, others) = (pixels + ya.size, others + labels)
        lines.append(
            f"| `{recipe}` | {ya.size} | {z:.3f} | {100 * worst:.3f} ± {100 * error:.2f} % | {100 * mean:+.4f} % "
            f"| {'' if flip is None else f'{flip:.5f}'} | {depths} | {labels} |"
        )
        shown.append((a, b))
    if not shown:
        raise SystemExit(f"{folder} has no recipe that both rendered; make it first")
    publish("\n".join(lines), "renderers", "renderers.py", book, page="graphics-cards.md")
    _strip(shown, ROOT / "book/src/images/renderers.jpg" if book else folder / "renderers.jpg")
    return agree and others * 100_000 <= pixels


def _regions(instances):
    """Every object, and what is none in the twelve parts of the image."""
    import numpy as np

    height, width = instances.shape
    y, x = np.mgrid[0:height, 0:width]
    parts = np.where(instances > 0, instances.astype(int), -1 - (y * 3 // height * 4 + x * 4 // width))
    for part in np.unique(parts):
        mask = parts == part
        if mask.sum() >= SMALLEST_REGION:
            yield mask


def _strip(pairs, path: Path) -> None:
    """`cpu_path`, `gpu_path` and the difference of what is shown, 20 times as large; one row per recipe."""
    import measures
    import numpy as np
    from PIL import Image

    rows = []
    for a, b in pairs:
        left, right = (measures.developed(one, a) for one in (a, b))
        rows.append(np.concatenate([left, right, np.clip(20 * np.abs(left - right), 0, 1)], axis=1))
    image = Image.fromarray((255 * np.concatenate(rows)).round().astype(np.uint8))
    image.resize((720, round(720 * image.height / image.width)), Image.LANCZOS).save(path, quality=85)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["make", "judge"])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--binary", type=Path, default=ROOT / "target" / "release" / "syntable")
    parser.add_argument("--samples", type=int, default=1024)
    parser.add_argument("--size", type=int, nargs=2, default=[400, 300], metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--book", action="store_true", help="write table and image to the book")
    arguments = parser.parse_args()
    if arguments.what == "make":
        make(arguments.binary.resolve(), arguments.folder, arguments.samples, arguments.size)
        return 0
    return 0 if judge(arguments.folder, arguments.book) else 1


if __name__ == "__main__":
    sys.exit(main())
