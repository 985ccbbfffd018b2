// Values that scripts of `data/` hand over, the state behind the `#` of the address, and masks.
"use strict";
const syntable = (() => {
  const wanted = new Map(), asked = new Map();
  const facts = JSON.parse(document.documentElement.dataset.facts);
  // Files of an earlier report at the same place have another address.
  const query = facts.edition ? `?${facts.edition}` : "";

  /** Loads `data/<key>.js`, which calls `put`. A page from a file may not fetch, but it may run scripts. */
  const get = (key, isKept = true) => {
    if (!asked.has(key)) {
      asked.set(key, new Promise((resolve, reject) => {
        wanted.set(key, resolve);
        const script = document.createElement("script");
        script.src = `data/${key}.js${query}`;
        script.addEventListener("load", () => script.remove());
        script.addEventListener("error", () => {
          // The next one who asks tries again.
          asked.delete(key);
          reject(new Error(`data/${key}.js cannot be loaded`));
        });
        document.head.append(script);
      }));
      // What was looked at long ago is forgotten.
      if (asked.size > 400) asked.delete(asked.keys().next().value);
    }
    const found = asked.get(key);
    if (!isKept) asked.delete(key);
    return found;
  };
  const put = (key, value) => {
    wanted.get(key)?.(value);
    wanted.delete(key);
  };

  const six = (number) => String(number).padStart(6, "0");
  const folder = (place) => String(Math.floor(place / facts.per_folder)).padStart(3, "0");
  const view = (place) => get(`view/${folder(place)}/${six(place)}`);
  const imagePath = (kind, place) => `${kind}/${folder(place)}/${six(place)}.jpg${query}`;

  /** The state: names and values behind the `#`. */
  const state = () => new URLSearchParams(location.hash.slice(1));
  const setState = (changes) => {
    const now = state();
    for (const [name, value] of Object.entries(changes)) {
      if (value === null || value === "") now.delete(name); else now.set(name, value);
    }
    history.replaceState(null, "", `#${now}`);
  };
  const whole = (text, low, high) => Math.min(high, Math.max(low, Number.parseInt(text, 10) || 0));

  /** An element with attributes and children; `null` leaves an attribute out. */
  const element = (name, attributes = {}, ...children) => {
    const is = /^(svg|g|path|rect|circle|line|text|title|desc|marker|defs|polygon)$/.test(name);
    const it = is ? document.createElementNS("http://www.w3.org/2000/svg", name) : document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) if (value !== null) it.setAttribute(key, value);
    it.append(...children);
    return it;
  };

  /** A color of an object, by its id: neighbors differ. */
  const color = (id) => `hsl(${(id * 137.508) % 360} ${id % 2 ? 85 : 70}% ${id % 3 ? 62 : 72}%)`;

  /** Run lengths of COCO's text: differences to the run before last, five bits a letter. */
  const runs = (text) => {
    const counts = [];
    for (let at = 0; at < text.length;) {
      let value = 0, shift = 0, more = true;
      while (more) {
        const group = text.charCodeAt(at++) - 48;
        value |= (group & 31) << shift;
        shift += 5;
        more = (group & 32) !== 0;
        if (!more && group & 16) value |= -1 << shift;
      }
      counts.push(counts.length > 2 ? value + counts[counts.length - 2] : value);
    }
    return counts;
  };

  /** The edges of a mask's pixels as the data of a path, the mask to the right. Runs go down the columns. */
  const outline = (text, [width, height]) => {
    const columns = width + 1, right = new Set(), down = new Set(), left = new Set(), up = new Set();
    const set = new Uint8Array(width * height);
    let position = 0, value = 0;
    for (const count of runs(text)) {
      if (value) set.fill(1, position, position + count);
      position += count;
      value ^= 1;
    }
    position = 0; value = 0;
    const at = (x, y) => x >= 0 && y >= 0 && x < width && y < height && set[x * height + y] === 1;
    for (const count of runs(text)) {
      if (value) {
        for (let index = position; index < position + count; index++) {
          const x = Math.floor(index / height), y = index % height;
          if (!at(x, y - 1)) right.add(y * columns + x);
          if (!at(x + 1, y)) down.add(y * columns + x + 1);
          if (!at(x, y + 1)) left.add((y + 1) * columns + x + 1);
          if (!at(x - 1, y)) up.add((y + 1) * columns + x);
        }
      }
      position += count;
      value ^= 1;
    }
    const leaving = [right, down, left, up], steps = [1, columns, -1, -columns];
    let path = "";
    for (const start of right) {
      let corner = start, direction = 0;
      path += `M${start % columns} ${Math.floor(start / columns)}`;
      while (leaving[direction].delete(corner)) {
        corner += steps[direction];
        // Parts that touch at a corner are apart: the turn to the right comes first.
        const next = [1, 0, 3].map((turn) => (direction + turn) % 4).find((other) => leaving[other].has(corner));
        if (next === undefined) break;
        if (next !== direction) {
          path += direction % 2 ? `V${Math.floor(corner / columns)}` : `H${corner % columns}`;
          direction = next;
        }
      }
      path += "Z";
    }
    return path;
  };

  /** Whether a key belongs to a field of the page, or to the browser. */
  const isTyping = (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return true;
    const field = event.target instanceof Element ? event.target.closest("input, select, textarea") : null;
    if (field?.type === "radio") return event.key.startsWith("Arrow");
    return field !== null && field.type !== "checkbox";
  };

  const fail = (error) => {
    const place = document.getElementById("failed");
    if (place) {
      place.textContent = error.message;
      place.hidden = false;
    }
  };

  return { facts, get, put, view, imagePath, state, setState, whole, element, color, runs, outline, isTyping, fail };
})();
