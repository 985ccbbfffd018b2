"""The Python blocks of the book run, one after the other."""

import pathlib
import re

import pytest

BOOK = pathlib.Path(__file__).resolve().parents[3] / "book" / "src"


@pytest.mark.parametrize("page", ["python.md"])
def test_blocks_run(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (BOOK / page).read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    assert len(blocks) > 3
    names: dict = {}
    for block in blocks:
        line = text[: text.index(block)].count("\n")
        exec(compile("\n" * line + block, str(BOOK / page), "exec"), names)
