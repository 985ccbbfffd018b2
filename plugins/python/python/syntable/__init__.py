"""Synthetic datasets for unseen-object amodal instance segmentation.

    import syntable as st

    recipe = st.recipe("quickstart").set("dataset.scenes", 3)
    st.run(recipe, "data/first")                     # a dataset in files
    for sample in st.generate(recipe):               # or the same in memory
        sample.rgb, sample.amodal_masks, sample.occlusion_order, sample.camera.K
    dataset = st.open("data/first")                  # and every other format that is read
"""

from __future__ import annotations

from ._syntable import Mask, __version__
from .datasets import Dataset, open
from .errors import Diagnostic, RecipeError, SyntableError
from .generating import Generation, generate
from .drawing import show
from .progress import SyntableWarning
from .recipes import Recipe, recipe, recipes
from .samples import Camera, Object, Sample
from .verbs import Conversion, Fault, Outcome, Validation, convert, run, validate

__all__ = [
    "Camera",
    "Conversion",
    "Dataset",
    "Diagnostic",
    "Fault",
    "Generation",
    "Mask",
    "Object",
    "Outcome",
    "Recipe",
    "RecipeError",
    "Sample",
    "SyntableError",
    "SyntableWarning",
    "Validation",
    "__version__",
    "convert",
    "generate",
    "open",
    "recipe",
    "recipes",
    "run",
    "show",
    "validate",
]
