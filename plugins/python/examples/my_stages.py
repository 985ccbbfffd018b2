"""An annotator and a writer. Run them with `syntable --plugin my_stages.py run recipe.toml --out data`."""

from dataclasses import dataclass
from typing import Annotated

import syntable as st


@dataclass
class Options:
    threshold: Annotated[float, st.Range(0, 1)] = 0.2
    "Share of white below which a pixel is dark."


@st.annotator(
    reads=["rgb", "visible_mask"],
    provides={"darkness": st.PerObject(float, doc="Share of dark pixels among the visible ones.")},
    options=Options,
)
def darkness(view, options):
    "Share of dark pixels of each visible object."
    dark = view.rgb.mean(axis=-1) < 255 * options.threshold
    return {id: dark[mask].mean() for id, mask in zip(view.ids, view.visible_masks) if mask.any()}


@st.writer(reads=["rgb", "darkness"])
class DarkObjects:
    "The images, and a table of the darkness of all objects."

    def write(self, view, out):
        out.write(f"{view.name}.png", view.rgb)
        out.record([[view.name, id, share] for id, share in view.darkness.items()])

    def finish(self, dataset, out):
        rows = [f"{name},{id},{share:.3f}\n" for record in dataset.records() for name, id, share in record]
        out.write("darkness.csv", "view,object,darkness\n" + "".join(rows))
