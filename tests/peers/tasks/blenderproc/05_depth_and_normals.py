"""Perfect depth, depth as an Azure Kinect measures it, and normals: `05_depth_and_normals.py FOLDER_OF_MESHES OUT`."""

import sys

import blenderproc as bproc
import numpy as np

bproc.init()
from scene import build

build(sys.argv[1])
bproc.renderer.enable_depth_output(activate_antialiasing=False)
bproc.renderer.enable_normals_output()
data = bproc.renderer.render()
data["depth_sensed"] = bproc.postprocessing.add_kinect_azure_noise([d.copy() for d in data["depth"]], data["colors"])
bproc.writer.write_hdf5(sys.argv[2], data)
for perfect, sensed in zip(data["depth"], data["depth_sensed"]):
    print("lost", np.mean(sensed == 0), "error in m", np.std((sensed - perfect)[(sensed > 0) & (perfect < 3)]))
