"""AP and overlap F of predicted amodal masks: `10_scores.py DATASET`.

The predictions are the labels, moved by three pixels.
"""

import sys

import numpy as np
import syntable as st

truth = st.open(sys.argv[1])
predictions = [
    {"masks": np.roll(one.visible_masks, 3, axis=2), "amodal_masks": np.roll(one.amodal_masks, 3, axis=2)}
    for one in truth
]
scores = st.evaluate(truth, predictions)
print("amodal AP", scores.amodal_ap, "amodal F", scores.amodal_f)
