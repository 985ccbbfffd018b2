"""One run as COCO and as BOP: `04_coco_and_bop.py OUT`."""

import sys

import syntable as st

recipe = st.recipe("quickstart").set("write.coco", {}).set("write.bop", {})
st.run(recipe, sys.argv[1])
