"""Perfect depth, depth as an Azure Kinect measures it, and normals: `05_depth_and_normals.py OUT`."""

import sys

import numpy as np
import syntable as st

recipe = (
    st.recipe("quickstart")
    .set("sensor.depth_camera", {"model": "azure_kinect"})
    .set("write.hdf5", {"include": ["depth_sensed"]})
)
st.run(recipe, sys.argv[1])
for sample in st.open(f"{sys.argv[1]}/hdf5"):
    sensed, perfect = sample.depth_sensed, sample.depth
    print("lost", np.mean(sensed == 0), "error in m", np.std((sensed - perfect)[(sensed > 0) & (perfect < 3)]))
