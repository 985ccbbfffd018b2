"""Datasets in a bucket, of a server on this machine."""

from __future__ import annotations

import http.client
import os
import pickle
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import syntable as st

URL = "s3://lab/mine"
#: The server checks no signature, and refuses requests without one.
SIGNED = "AWS4-HMAC-SHA256 Credential=test/20260101/us-east-1/s3/aws4_request"


@pytest.fixture(scope="module")
def bucket(data: Path, tmp_path_factory: pytest.TempPathFactory):
    """The URL of the dataset."""
    server = shutil.which("moto_server")
    if server is None:
        if os.environ.get("SYNTABLE_REQUIRE_TOOLS") == "all":
            pytest.fail("moto_server is missing")
        pytest.skip("no moto_server: `pip install 'moto[server,s3]'`")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    process = subprocess.Popen([server, "-p", str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    at = f"http://127.0.0.1:{port}"

    def put(path: str, content: bytes = b"") -> None:
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
        connection.request("PUT", f"/lab{path}", body=content, headers={"Authorization": SIGNED})
        answer = connection.getresponse()
        answer.read()
        assert answer.status == 200, answer.status

    settings = {
        "AWS_ENDPOINT_URL": at,
        "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test",
        "AWS_REGION": "us-east-1",
        "NO_PROXY": "127.0.0.1",
        "SYNTABLE_CACHE": str(tmp_path_factory.mktemp("cache")),
    }
    before = {name: os.environ.get(name) for name in settings}
    os.environ.update(settings)
    try:
        for _ in range(200):
            try:
                put("")
                break
            except OSError:
                time.sleep(0.1)
        for file in sorted(data.rglob("*")):
            if file.is_file():
                put(f"/mine/{file.relative_to(data).as_posix()}", file.read_bytes())
        yield URL
    finally:
        process.kill()
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def instance_of(dataset: st.Dataset, image: int) -> bytes:
    return np.asarray(dataset[image]["rgb"]).tobytes()


def test_samples_are_the_ones_of_the_folder(bucket: str, data: Path) -> None:
    local, remote = st.open(data), st.open(bucket)
    assert len(remote) == len(local) == 6 and remote.format == local.format and remote.products == local.products
    for image in (5, 0, 3):
        for product in ("rgb", "instance", "depth", "visible_mask"):
            if product in local.products:
                one, other = local[image][product], remote[image][product]
                assert pickle.dumps(one) == pickle.dumps(other), product
    assert st.stats(bucket).images == st.stats(data).images
    assert st.validate(bucket).sound


def test_a_run_into_a_bucket_opens(bucket: str, small: st.Recipe, data: Path) -> None:
    outcome = st.run(small, "s3://lab/other")
    assert instance_of(outcome.open(), 2) == instance_of(st.open(data), 2)


def test_a_missing_url_names_itself(bucket: str) -> None:
    with pytest.raises(st.SyntableError, match="s3://lab/none: no such folder or file"):
        st.open("s3://lab/none")
    with pytest.raises(st.SyntableError, match="lost a `/`"):
        st.open(Path("s3://lab/mine"))


OTHER_PROCESSES = """
import multiprocessing as mp
import sys
import numpy as np
import syntable as st

def rgb(dataset, image):
    return np.asarray(dataset[image]["rgb"]).tobytes()

def inherited(image):
    return rgb(remote, image)

if __name__ == "__main__":
    local, remote = map(st.open, sys.argv[1:])
    # Downloads of the next files begin.
    rgb(remote, 0), rgb(remote, 1)
    with mp.get_context("fork").Pool(2) as pool:
        forked = pool.map(inherited, range(len(remote)), 1)
    with mp.get_context("spawn").Pool(2) as pool:
        spawned = pool.starmap(rgb, [(remote, image) for image in range(len(remote))], 1)
    assert forked == spawned == [rgb(local, image) for image in range(len(local))]
"""


def test_other_processes_read_it(bucket: str, data: Path, tmp_path: Path) -> None:
    script = tmp_path / "processes.py"
    script.write_text(OTHER_PROCESSES)
    # What the other tests have downloaded must not spare the requests.
    environment = os.environ | {"SYNTABLE_CACHE": str(tmp_path / "cache")}
    done = subprocess.run(
        [sys.executable, script, data, bucket], env=environment, capture_output=True, text=True, timeout=120
    )
    assert (done.returncode, done.stderr) == (0, "")
