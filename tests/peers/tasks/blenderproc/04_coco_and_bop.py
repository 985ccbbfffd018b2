"""One run as COCO and as BOP: `04_coco_and_bop.py FOLDER_OF_MESHES OUT`."""

import sys

import blenderproc as bproc

bproc.init()
from scene import build

objects = build(sys.argv[1])
bproc.renderer.enable_depth_output(activate_antialiasing=False)
bproc.renderer.enable_segmentation_output(map_by=["category_id", "instance", "name"])
data = bproc.renderer.render()
bproc.writer.write_coco_annotations(
    f"{sys.argv[2]}/coco",
    instance_segmaps=data["instance_segmaps"],
    instance_attribute_maps=data["instance_attribute_maps"],
    colors=data["colors"],
)
bproc.writer.write_bop(f"{sys.argv[2]}/bop", objects, depths=data["depth"], colors=data["colors"])
