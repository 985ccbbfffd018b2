"""Perfect depth and normals: `05_depth_and_normals.py FOLDER_OF_MESHES OUT`. Kubric has no model of a depth sensor."""

import sys

import kubric as kb
from scene import build

scene, renderer, objects = build(sys.argv[1], "scratch")
kb.write_image_dict(renderer.render(return_layers=["rgba", "depth", "normal"]), sys.argv[2])
