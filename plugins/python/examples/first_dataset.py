"""A first dataset: from a recipe to images, labels, a report and a COCO file.

    python first_dataset.py

All files are in the folder `first`. Open `first/report/index.html` in a browser afterwards.
"""

import argparse
from pathlib import Path

import syntable as st


def main(out: Path, scenes: int, size: list[int]) -> None:
    # A recipe states what a dataset contains. It never changes: `set` returns another recipe.
    recipe = st.recipe("quickstart").set("dataset.scenes", scenes).set("camera.resolution", size)

    # `check` finds every mistake before anything is rendered.
    recipe.check()
    try:
        recipe.set("camera.size", size).check()
    except st.RecipeError as error:
        print(error)

    # A quick look: few samples per pixel, small images, labels beside them. No dataset is written.
    out.mkdir(parents=True, exist_ok=True)
    st.preview(recipe, scenes=range(1), width=min(size[0], 320), labels=True).save(out / "preview.png")

    # The dataset. The same call continues it after a stop, and adds scenes if the recipe has more.
    outcome = st.run(recipe, out / "data")
    print(f"{outcome.images} images of {outcome.scenes} scenes, complete: {outcome.complete}")

    # Images, labels, camera and poses as NumPy arrays.
    dataset = outcome.open()
    for sample in dataset:
        rates = sample.occlusion_rates
        first, second = sample.occlusion_order.nonzero()
        print(f"{sample.name}: {len(sample.ids)} objects, {(rates > 0).sum()} occluded, by {len(set(first))} others")
        worst = rates.argmax()
        print(f"    most occluded: {sample.objects[worst].name}, {rates[worst]:.0%} hidden")

    # Contact sheet: each image beside its labels. Filled: visible. Striped: hidden. Outline: amodal mask.
    sample = dataset[0]
    sample.save(out / "sample.png")

    # Web pages with statistics, all images and their labels; and the labels in the format that most detectors read.
    st.report(dataset, out / "report", overwrite=True)
    if not (out / "coco").exists():
        dataset.to_coco(out / "coco")
    print(f"{st.open(out / 'coco')}, sound: {st.validate(out / 'coco').sound}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("first"), help="folder for all files (%(default)s)")
    parser.add_argument("--scenes", type=int, default=2, help="number of scenes (%(default)s)")
    parser.add_argument("--size", type=int, nargs=2, default=[320, 240], metavar="PX", help="width, height (320 240)")
    main(**vars(parser.parse_args()))
