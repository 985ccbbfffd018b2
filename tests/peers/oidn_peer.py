"""Open Image Denoise from PyPI's `pyoidn` (2.5) or `oidn` (1.4), through its C interface.

The module of the older package does not find the TBB beside its library; here that is loaded first.
"""

import ctypes
import importlib.util
import time
from pathlib import Path

import numpy as np

FLOAT3 = 3


def library() -> Path | None:
    """The library of the newer package that is installed."""
    for package, place in (("pyoidn", "oidn/lib/libOpenImageDenoise.so.2"), ("oidn", "lib*/libOpenImageDenoise.so.*")):
        spec = importlib.util.find_spec(package)
        found = sorted(Path(spec.origin).parent.glob(place)) if spec else []
        if found:
            return found[-1]
    return None


class Denoiser:
    """The filter for path-traced images of one size, with guides free of noise."""

    def __init__(self, path: Path, height: int, width: int):
        for tbb in sorted(path.parent.glob("libtbb.so.*"))[:1]:
            ctypes.CDLL(str(tbb), ctypes.RTLD_GLOBAL)
        self._oidn = ctypes.CDLL(str(path))
        for name in ("oidnNewDevice", "oidnNewFilter"):
            getattr(self._oidn, name).restype = ctypes.c_void_p
        self._oidn.oidnGetDeviceError.restype = ctypes.c_int
        self._device = ctypes.c_void_p(self._oidn.oidnNewDevice(1))
        self._oidn.oidnCommitDevice(self._device)
        self._filter = ctypes.c_void_p(self._oidn.oidnNewFilter(self._device, b"RT"))
        names = ("color", "albedo", "normal", "output")
        self._planes = {name: np.zeros((height, width, 3), np.float32) for name in names}
        for name, plane in self._planes.items():
            pointer = ctypes.c_void_p(plane.ctypes.data)
            sizes = [ctypes.c_size_t(x) for x in (width, height, 0, 0, 0)]
            self._oidn.oidnSetSharedFilterImage(self._filter, name.encode(), pointer, FLOAT3, *sizes)
        switch = getattr(self._oidn, "oidnSetFilterBool", None) or self._oidn.oidnSetFilter1b
        for name in (b"hdr", b"cleanAux"):
            switch(self._filter, name, ctypes.c_bool(True))
        self._oidn.oidnCommitFilter(self._filter)

    def denoise(self, color: np.ndarray, guides: np.ndarray) -> tuple[np.ndarray, float]:
        """Radiance without noise and the seconds that it took; `guides` are albedo and normal, `[height, width, 6]`."""
        start = time.perf_counter()
        self._planes["color"][:] = color
        self._planes["albedo"][:] = np.clip(guides[..., :3], 0, 1)
        self._planes["normal"][:] = guides[..., 3:]
        self._oidn.oidnExecuteFilter(self._filter)
        message = ctypes.c_char_p()
        if self._oidn.oidnGetDeviceError(self._device, ctypes.byref(message)):
            raise RuntimeError(f"Open Image Denoise: {message.value.decode()}")
        return self._planes["output"].copy(), time.perf_counter() - start
