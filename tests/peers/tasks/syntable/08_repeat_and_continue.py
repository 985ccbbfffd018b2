"""A dataset from a seed; the second call continues after Ctrl-C: `08_repeat_and_continue.py OUT`."""

import sys

import syntable as st

st.run(st.recipe("quickstart").set("dataset.seed", 7), sys.argv[1])
