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
from .drawing import show
from .errors import Diagnostic, RecipeError, SyntableError
from .evaluation import Evaluation, Prediction, evaluate
from .generating import Generation, generate
from .planning import Component, Forecast, Plan, PlannedProduct, plan
from .progress import SyntableWarning
from .recipes import Recipe, recipe, recipes
from .samples import Camera, Object, Sample
from .showing import Preview, Report, View, preview, report, view
from .stages import (
    Image,
    ObjectPool,
    PerObject,
    Range,
    Tensor,
    Unlucky,
    Value,
    annotator,
    asset_source,
    light,
    placer,
    sensor,
    writer,
)
from .statistics import Comparison, Statistics, compare, stats
from .training import Buffer, Stream, Views
from .verbs import (
    Conversion,
    Fault,
    Outcome,
    Status,
    Validation,
    Verification,
    convert,
    merge,
    run,
    status,
    validate,
    verify,
)

__all__ = [
    "Buffer",
    "Camera",
    "Comparison",
    "Component",
    "Conversion",
    "Dataset",
    "Diagnostic",
    "Evaluation",
    "Fault",
    "Forecast",
    "Generation",
    "Image",
    "Mask",
    "Object",
    "ObjectPool",
    "Outcome",
    "PerObject",
    "Plan",
    "PlannedProduct",
    "Prediction",
    "Preview",
    "Range",
    "Recipe",
    "RecipeError",
    "Report",
    "Sample",
    "Statistics",
    "Stream",
    "SyntableError",
    "SyntableWarning",
    "Tensor",
    "Unlucky",
    "Validation",
    "Value",
    "Status",
    "Verification",
    "View",
    "Views",
    "__version__",
    "annotator",
    "asset_source",
    "compare",
    "convert",
    "evaluate",
    "generate",
    "light",
    "merge",
    "open",
    "placer",
    "plan",
    "preview",
    "recipe",
    "recipes",
    "report",
    "run",
    "sensor",
    "show",
    "stats",
    "validate",
    "status",
    "verify",
    "view",
    "writer",
]
