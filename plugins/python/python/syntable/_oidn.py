"""Finds Open Image Denoise in the wheel that carries it, so that recipes need no path."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

VARIABLE = "OIDN_LIBRARY"
"""Environment variable with the path of the library, which the denoiser reads."""

PACKAGES = ("pyoidn", "oidn")
"""Packages that carry the library, the newest first."""

PATTERNS = ("libOpenImageDenoise.so", "libOpenImageDenoise.so.*", "libOpenImageDenoise.dylib", "OpenImageDenoise.dll")
"""Names of the library."""


def library() -> Path | None:
    """The library in an installed package; None without one. Imports no package."""
    for package in PACKAGES:
        try:
            spec = importlib.util.find_spec(package)
        except (ImportError, ValueError):
            continue
        for folder in (spec.submodule_search_locations or []) if spec else []:
            for pattern in PATTERNS:
                found = sorted(Path(folder).rglob(pattern))
                if found:
                    return found[0]
    return None


def announce() -> None:
    """Names the library to the denoiser, unless the user has named one."""
    if not os.environ.get(VARIABLE):
        found = library()
        if found is not None:
            os.environ[VARIABLE] = str(found)
