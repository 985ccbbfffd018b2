"""Four images with visible masks: `01_first_images.py OUT`."""

import sys

import syntable as st

st.run(st.recipe("quickstart"), sys.argv[1])
