"""Four images with visible masks: `01_first_images.py FOLDER_OF_MESHES OUT [SEED]`."""

import sys

import kubric as kb
from scene import build

scene, renderer, objects = build(sys.argv[1], "scratch", int(sys.argv[3]) if len(sys.argv) > 3 else 0)
frames = renderer.render(return_layers=["rgba", "segmentation"])
frames["segmentation"] = kb.adjust_segmentation_idxs(frames["segmentation"], scene.assets, objects)
kb.write_image_dict(frames, sys.argv[2])
kb.write_json({"objects": [body.asset_id for body in objects]}, f"{sys.argv[2]}/metadata.json")
