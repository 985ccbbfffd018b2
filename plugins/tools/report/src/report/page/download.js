// Files from a page: masks as PNG of one channel, and images.
"use strict";
syntable.download = (() => {
  const TABLE = Uint32Array.from({ length: 256 }, (_, byte) => {
    for (let bit = 0; bit < 8; bit++) byte = byte & 1 ? 0xedb88320 ^ (byte >>> 1) : byte >>> 1;
    return byte;
  });
  const crc = (bytes) => ~bytes.reduce((sum, byte) => TABLE[(sum ^ byte) & 255] ^ (sum >>> 8), ~0);
  const chunk = (name, data) => {
    const bytes = new Uint8Array(12 + data.length), view = new DataView(bytes.buffer);
    view.setUint32(0, data.length);
    bytes.set(new TextEncoder().encode(name), 4);
    bytes.set(data, 8);
    view.setInt32(8 + data.length, crc(bytes.subarray(4, 8 + data.length)));
    return bytes;
  };

  /** A mask as a PNG file of 8-bit gray: 255 inside, 0 outside. */
  const png = async (text, [width, height]) => {
    // Each row of samples starts with its filter, none.
    const samples = new Uint8Array((width + 1) * height);
    let position = 0, value = 0;
    for (const count of syntable.runs(text)) {
      for (let at = position; value && at < position + count; at++) {
        samples[(at % height) * (width + 1) + 1 + Math.floor(at / height)] = 255;
      }
      position += count;
      value ^= 1;
    }
    const packed = new Blob([samples]).stream().pipeThrough(new CompressionStream("deflate"));
    const header = new DataView(new ArrayBuffer(13));
    header.setUint32(0, width);
    header.setUint32(4, height);
    header.setUint8(8, 8);
    return new Blob([
      Uint8Array.of(137, 80, 78, 71, 13, 10, 26, 10), chunk("IHDR", new Uint8Array(header.buffer)),
      chunk("IDAT", new Uint8Array(await new Response(packed).arrayBuffer())), chunk("IEND", new Uint8Array()),
    ], { type: "image/png" });
  };

  const link = (address, name) => {
    const it = syntable.element("a", { href: address, download: name });
    document.body.append(it);
    it.click();
    it.remove();
  };
  const save = (blob, name) => {
    const address = URL.createObjectURL(blob);
    link(address, name);
    setTimeout(() => URL.revokeObjectURL(address), 60_000);
  };

  /** A name of a file from the name of an image and parts. */
  const named = (image, ...parts) => {
    const stem = image.name.split("/").pop().replace(/\.[^.]*$/, "");
    return [stem, ...parts].map((part) => String(part).replace(/[^\w.-]+/g, "-")).join("_");
  };

  return { png, save, link, named };
})();
