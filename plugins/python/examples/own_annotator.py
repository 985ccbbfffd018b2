"""An own annotator: the contrast of each object with its surroundings, in samples and in a written dataset.

    python own_annotator.py

The annotator becomes a kind like all others. The command takes it, too:

    syntable --plugin own_annotator.py run builtin:quickstart --set 'write.jsonl.include=["contrast"]' --out data
"""

import argparse
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

import syntable as st


@dataclass
class Options:
    """Fields become options of the recipe: their types, ranges and texts are its schema and its help."""

    ring_px: Annotated[int, st.Range(1, 50)] = 5
    "Width of the surroundings, px."


def grown(mask: np.ndarray, width: int) -> np.ndarray:
    "The mask with all pixels up to `width` rows and columns away."
    height, length = mask.shape
    padded = np.pad(mask, width)
    rows = np.logical_or.reduce([padded[shift : shift + height] for shift in range(2 * width + 1)])
    return np.logical_or.reduce([rows[:, shift : shift + length] for shift in range(2 * width + 1)])


@st.annotator(
    reads=["rgb", "visible_mask"],
    provides={"contrast": st.PerObject(float, doc="Distance of an object's mean color from its surroundings', 0–1.")},
    options=Options,
)
def contrast(view, options):
    "Contrast of each visible object with the pixels around it: 0 for camouflage, 1 for black on white."
    color = view.rgb / 255
    found = {}
    for id, mask in zip(view.ids, view.visible_masks):
        ring = grown(mask, options.ring_px) & ~mask
        if mask.any() and ring.any():
            found[id] = np.linalg.norm(color[mask].mean(axis=0) - color[ring].mean(axis=0)) / np.sqrt(3)
    return found  # an object without an entry has no value


def main(out: Path, scenes: int, size: list[int]) -> None:
    recipe = st.recipe("quickstart").set("dataset.scenes", scenes).set("camera.resolution", size)
    recipe = recipe.set("annotate.contrast.ring_px", 3)

    # In memory, the product is an attribute of samples. `generate` computes only the products that are named.
    for sample in st.generate(recipe, ["contrast"], scenes=range(1)):
        values = np.array(list(sample.contrast.values()))
        print(f"{sample.name}: contrast {values.min():.3f} to {values.max():.3f}, median {np.median(values):.3f}")

    # Every writer with the option `include` can store it. COCO's writer makes it a field of annotations.
    recipe = recipe.set("write.coco", {"include": ["contrast", "object_name"]})
    outcome = st.run(recipe, out)
    labels = json.loads((out / "coco" / "annotations" / "instances_train.json").read_text())
    hardest = sorted((one for one in labels["annotations"] if "contrast" in one), key=lambda one: one["contrast"])
    print(f"{outcome.images} images, {len(labels['annotations'])} annotations; least contrast:")
    for one in hardest[:5]:
        print(f"    {one['contrast']:.3f} {one['object_name']} in image {one['image_id']}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("contrast"), help="folder of the dataset (%(default)s)")
    parser.add_argument("--scenes", type=int, default=2, help="number of scenes (%(default)s)")
    parser.add_argument("--size", type=int, nargs=2, default=[320, 240], metavar="PX", help="width, height (320 240)")
    main(**vars(parser.parse_args()))
