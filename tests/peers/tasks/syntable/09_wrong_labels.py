"""Wrong labels and damaged files of a dataset: `09_wrong_labels.py DATASET`."""

import sys

import syntable as st

print(st.verify(sys.argv[1]))
print(*st.validate(sys.argv[1]).faults, sep="\n")
