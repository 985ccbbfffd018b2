"""The library of the denoiser is found in the packages that carry it."""

import os
import sys

import syntable._oidn as oidn


def test_a_package_with_the_library_is_found_without_import(tmp_path, monkeypatch):
    inside = tmp_path / "pyoidn" / "oidn" / "lib"
    inside.mkdir(parents=True)
    (tmp_path / "pyoidn" / "__init__.py").write_text("raise RuntimeError('imported')\n")
    (inside / "libOpenImageDenoise.so.2").write_text("")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "pyoidn", raising=False)
    monkeypatch.setenv(oidn.VARIABLE, "")
    oidn.announce()
    assert oidn.library() == inside / "libOpenImageDenoise.so.2"
    monkeypatch.setenv(oidn.VARIABLE, "mine")
    oidn.announce()
    assert os.environ[oidn.VARIABLE] == "mine"


def test_without_a_package_nothing_is_named(monkeypatch):
    monkeypatch.setattr(oidn, "PACKAGES", ("no_such_package",))
    monkeypatch.setenv(oidn.VARIABLE, "")
    oidn.announce()
    assert os.environ[oidn.VARIABLE] == ""
