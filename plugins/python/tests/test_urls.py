"""Datasets in a bucket, of a server on this machine."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import shutil
import socket
import subprocess
import time
import urllib.request
from pathlib import Path

import numpy as np
import pytest

import syntable as st

URL = "s3://lab/mine"


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
        urllib.request.urlopen(urllib.request.Request(f"{at}/lab{path}", data=content, method="PUT")).read()

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
    return np.asarray(dataset[image]["instance"]).tobytes()


def read_in_process(dataset: st.Dataset, image: int, answers) -> None:
    answers.put(instance_of(dataset, image))


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


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_other_processes_read_it(bucket: str, data: Path, method: str, tmp_path: Path, monkeypatch) -> None:
    # Nothing is on this machine yet, so that the process must reach the server itself.
    monkeypatch.setenv("SYNTABLE_CACHE", str(tmp_path))
    remote = st.open(bucket)
    context = multiprocessing.get_context(method)
    answers = context.Queue()
    process = context.Process(target=read_in_process, args=(remote, 4, answers))
    process.start()
    answer = answers.get(timeout=60)
    process.join(60)
    assert answer == instance_of(st.open(data), 4)
    # The names of the parent process are still there.
    assert instance_of(remote, 1) == instance_of(st.open(data), 1)


def test_a_run_into_a_bucket_opens(bucket: str, small: st.Recipe, data: Path) -> None:
    outcome = st.run(small, "s3://lab/other")
    assert instance_of(outcome.open(), 2) == instance_of(st.open(data), 2)


def test_a_missing_url_names_itself(bucket: str) -> None:
    with pytest.raises(st.SyntableError, match="s3://lab/none: no such folder or file"):
        st.open("s3://lab/none")
    with pytest.raises(st.SyntableError, match="lost a `/`"):
        st.open(Path("s3://lab/mine"))
