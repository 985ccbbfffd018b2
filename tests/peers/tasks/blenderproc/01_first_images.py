"""Four images with visible masks as COCO: `01_first_images.py FOLDER_OF_MESHES OUT [SEED]`."""

import sys

import blenderproc as bproc

bproc.init()
from scene import build

build(sys.argv[1], int(sys.argv[3]) if len(sys.argv) > 3 else 0)
bproc.renderer.enable_segmentation_output(map_by=["category_id", "instance", "name"])
data = bproc.renderer.render()
bproc.writer.write_coco_annotations(
    sys.argv[2],
    instance_segmaps=data["instance_segmaps"],
    instance_attribute_maps=data["instance_attribute_maps"],
    colors=data["colors"],
)
