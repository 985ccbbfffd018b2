"""Figures of the package, each beside its baseline: ``python package.py [NAME ...]``, on quiet cores.

==========  =====================================================================================
annotator   time of a call beside the time in the function, for views of 640 × 480 with 20 objects
generate    `generate` beside `run` with a writer that does nothing, in turn
memory      resident memory over 10,000 samples
leaks       growth of resident memory over 100,000 calls
read        decoded samples a second with one and two threads, beside zlib alone
==========  =====================================================================================
"""

from __future__ import annotations

import gc
import json
import pathlib
import sys
import tempfile
import threading
import time
import zlib
from collections.abc import Callable

import numpy as np

import syntable as st

QUICKSTART = st.recipe("quickstart").set({"render.samples_per_pixel": 1, "denoise.kind": "none"})
SMALL = QUICKSTART.set({"camera.resolution": [64, 48], "place[2].count": 5, "settle.duration_s": 0.5})
MASKS = ["visible_mask", "amodal_mask"]


def resident_mb() -> float:
    gc.collect()
    return int(pathlib.Path("/proc/self/statm").read_text().split()[1]) * 4096 / 2**20


def annotator(folder: pathlib.Path) -> None:
    inside = [0.0]

    @st.annotator(reads=["rgb", "visible_mask"], provides={"bench_share": st.PerObject(float)})
    def bench_share(view):
        start = time.perf_counter()
        shares = {id: 0.5 for id in view.ids}
        inside[0] += time.perf_counter() - start
        return shares

    sizes = {"dataset.scenes": 2, "dataset.views_per_scene": 10}
    recipe = QUICKSTART.set(sizes).set("write", {"jsonl": {"include": ["bench_share"]}})
    st.run(recipe, folder, threads=1, progress=False)
    stages = json.loads((folder / ".syntable/times.jsonl").read_text().splitlines()[0])["stages"]
    whole = stages["annotate.bench_share"]
    per_view, own = 1000 * whole["seconds"] / whole["calls"], 1000 * inside[0] / whole["calls"]
    print(
        f"annotator: {per_view:.2f} ms a view, {own:.2f} ms of it in the function: {per_view - own:.2f} ms of overhead"
    )


def generate(folder: pathlib.Path) -> None:
    @st.writer(reads=["rgb", *MASKS])
    class BenchNothing:
        def write(self, view, out):
            pass

    sizes = {"dataset.scenes": 4, "dataset.views_per_scene": 4, "camera.resolution": [320, 240]}
    recipe = QUICKSTART.set(sizes).set("write", {"bench_nothing": {}})

    def made() -> None:
        assert sum(1 for _ in st.generate(recipe, ["rgb", *MASKS], threads=2)) == 16

    seconds: dict[str, list[float]] = {"run": [], "generate": []}
    for turn in range(7):
        works = {"run": lambda: st.run(recipe, folder / str(turn), threads=2, progress=False), "generate": made}
        # Whatever the first of a pair warms up serves the second.
        for name in sorted(works, reverse=turn % 2 == 0):
            start = time.perf_counter()
            works[name]()
            # The first turn fills the cache of assets.
            if turn > 0:
                seconds[name].append(time.perf_counter() - start)
    run, generated = (float(np.mean(seconds[name])) for name in ("run", "generate"))
    print(f"generate: {generated:.2f} s for 16 views, run: {run:.2f} s, ratio {generated / run:.3f}")


def memory(folder: pathlib.Path) -> None:
    recipe = SMALL.set({"dataset.scenes": 200, "dataset.views_per_scene": 50})
    for number, sample in enumerate(st.generate(recipe, ["rgb", "depth", *MASKS]), 1):
        assert sample.rgb.any() and len(sample.visible_masks) == len(sample.amodal_masks)
        if number % 1000 == 0:
            print(f"memory: {resident_mb():.0f} MB after {number} samples", flush=True)


def leaks(folder: pathlib.Path) -> None:
    mask = np.zeros((48, 64), bool)
    mask[3:9, 4:20] = True
    sample = next(iter(st.generate(SMALL.set("dataset.scenes", 1), ["rgb", *MASKS, "occlusion_order"])))
    calls: dict[str, tuple[int, Callable[[], object]]] = {
        "Mask.array": (100_000, lambda: st.Mask(mask).array()),
        "Mask.rle": (100_000, lambda: st.Mask(mask).rle()),
        "sample": (100_000, lambda: (sample["occlusion_order"], sample.amodal_masks, sample.objects)),
        "Recipe.set": (5_000, lambda: SMALL.set("dataset.seed", 3)),
    }
    for name, (count, call) in calls.items():
        for _ in range(2000):
            call()
        before, start = resident_mb(), time.perf_counter()
        for _ in range(count):
            call()
        each = 1e6 * (time.perf_counter() - start) / count
        print(f"leaks: {name}: {resident_mb() - before:+.2f} MB over {count} calls of {each:.1f} µs")


def rate(count: int, read: Callable[[int], object], threads: int) -> float:
    """Calls a second."""
    numbers, lock = iter(range(count)), threading.Lock()

    def work() -> None:
        while True:
            with lock:
                number = next(numbers, None)
            if number is None:
                return
            read(number)

    workers = [threading.Thread(target=work) for _ in range(threads)]
    start = time.perf_counter()
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    return count / (time.perf_counter() - start)


def read(folder: pathlib.Path) -> None:
    st.run(QUICKSTART.set({"dataset.scenes": 10, "dataset.views_per_scene": 5}), folder, progress=False)
    dataset = st.open(folder)
    images = len(dataset)
    for products in (["rgb"], ["depth"], MASKS, ["rgb", *MASKS], ["rgb", "depth", *MASKS]):
        rates = [rate(4 * images, lambda at: dataset[at % images].read(*products), threads) for threads in (1, 2)]
        print(f"read: {' + '.join(products)}: {rates[0]:.0f} and {rates[1]:.0f} samples/s with one and two threads")
    packed = zlib.compress(np.ascontiguousarray(dataset[0].rgb).tobytes())
    rates = [rate(4 * images, lambda at: zlib.decompress(packed), threads) for threads in (1, 2)]
    print(f"read: zlib alone on the bytes of rgb: {rates[0]:.0f} and {rates[1]:.0f} images/s")


BENCHES = {bench.__name__: bench for bench in (annotator, generate, memory, leaks, read)}


def main() -> None:
    names = sys.argv[1:] or list(BENCHES)
    unknown = sorted(set(names) - set(BENCHES))
    if unknown:
        sys.exit(f"unknown: {', '.join(unknown)}; it measures {', '.join(BENCHES)}")
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            BENCHES[name](pathlib.Path(folder) / "data")


if __name__ == "__main__":
    main()
