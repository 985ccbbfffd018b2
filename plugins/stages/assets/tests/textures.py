"""Writes one image in the formats that old tools use, each beside the RGBA pixels that Pillow reads from it."""

import sys
from pathlib import Path

from PIL import Image

folder = Path(sys.argv[1])
image = Image.new("RGBA", (7, 5))
image.putdata([(x * 36, y * 50, (x * y * 13) % 256, 255 if (x + y) % 3 else 90) for y in range(5) for x in range(7)])
opaque = image.convert("RGB")
files = {
    "color.bmp": (opaque, {}),
    "palette.bmp": (opaque.quantize(16), {}),
    "gray.bmp": (opaque.convert("L"), {}),
    "palette.gif": (opaque.quantize(16), {}),
    "color.tga": (image, {}),
    "packed.tga": (opaque, {"rle": True}),
    "gray.tga": (opaque.convert("L"), {}),
    "palette.tga": (opaque.quantize(16), {}),
    "color.tiff": (image, {}),
    "packed.tif": (opaque, {"compression": "tiff_lzw"}),
    "deflated.tif": (opaque, {"compression": "tiff_adobe_deflate"}),
}
for name, (content, options) in files.items():
    content.save(folder / name, **options)
    (folder / f"{name}.rgba").write_bytes(Image.open(folder / name).convert("RGBA").tobytes())
