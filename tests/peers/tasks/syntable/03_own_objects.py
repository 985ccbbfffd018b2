"""Objects of a folder fall on a table: `03_own_objects.py FOLDER_OF_MESHES OUT`."""

import sys

import syntable as st

recipe = st.recipe("quickstart").set("assets.objects", {"kind": "google_scanned_objects", "root": sys.argv[1]})
st.run(recipe, sys.argv[2])
