"""Makes a dataset with Ray on three nodes of this machine. One is removed: python3 - OUT RECIPE SETTING..."""

import sys
import threading
import time
import tomllib
from pathlib import Path

import ray
import syntable as st
import syntable.ray
from ray.cluster_utils import Cluster

out, recipe, *settings = sys.argv[1:]
node = {"num_cpus": 1, "object_store_memory": 100 * 2**20}
cluster = Cluster(initialize_head=True, head_node_args={**node, "include_dashboard": False})
cluster.add_node(**node)
lost = cluster.add_node(**node)
ray.init(address=cluster.address, log_to_driver=False)


def lose() -> None:
    lines = Path(out, ".syntable", "journal")
    while not lines.is_dir() or not any(lines.iterdir()):
        time.sleep(0.05)
    cluster.remove_node(lost, allow_graceful=False)


threading.Thread(target=lose, daemon=True).start()
made = st.Recipe(recipe)
for setting in settings:
    key, value = setting.split("=", 1)
    made = made.set(key, tomllib.loads(f"value = {value}")["value"])
assert syntable.ray.run(made, out, lease=3.0).complete
ray.shutdown()
cluster.shutdown()
