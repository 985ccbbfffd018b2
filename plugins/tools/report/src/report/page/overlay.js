// Labels over an image.
"use strict";
syntable.overlay = (() => {
  const { element, color, outline } = syntable;

  const predictions = (image) => image.predicted?.predictions ?? [];

  /** The switches, in the order in which they are shown: name, what an object must have. */
  const kinds = {
    visible: (image) => image.objects.some((it) => it.visible),
    amodal: (image) => image.objects.some((it) => it.amodal),
    hidden: (image) => image.objects.some((it) => it.amodal),
    boxes: (image) => image.objects.some((it) => it.visible_box || it.amodal_box),
    order: (image) => image.graph !== null,
    ids: (image) => image.objects.length > 0,
    predicted: (image) => predictions(image).some((it) => it.visible),
    predicted_amodal: (image) => predictions(image).some((it) => it.amodal),
    predicted_hidden: (image) => predictions(image).some((it) => it.hidden),
  };
  /** Which mask of predictions each of these shows. */
  const predicted = { predicted_amodal: "amodal", predicted: "visible", predicted_hidden: "hidden" };

  /** What is switched on, from the address. */
  const on = () => (syntable.state().get("on") ?? "").split(".").filter((name) => Object.hasOwn(kinds, name));

  const boxOf = (object) => {
    const box = object.visible_box;
    return box && box[2] > 0 ? box : object.amodal_box;
  };
  const center = (object) => {
    const [x, y, width, height] = boxOf(object) ?? [0, 0, 0, 0];
    return [x + width / 2, y + height / 2];
  };

  const paths = new WeakMap();
  /** The outline of a mask, traced once. */
  const path = (image, object, kind) => {
    if (!object[kind]) return "";
    if (!paths.has(object)) paths.set(object, {});
    return paths.get(object)[kind] ??= outline(object[kind], image.size);
  };

  /** Size of ids and arrow heads on the screen, px. */
  const TAG_PX = 13, HEAD_PX = 9;

  /** Puts what is switched on into an SVG. With `choose`, a click on an object calls it, and `over` gets the object below the pointer. */
  const draw = (svg, image, shown, chosen = null, choose = null, over = () => {}) => {
    const [width, height] = image.size;
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    // Pixels of the image per pixel of the screen: texts and arrow heads keep their size when the image is zoomed.
    const all = [], unit = width / (svg.clientWidth || 640);
    const fill = (object, kind, opacity) => element("path", {
      class: `fill ${kind}`, d: path(image, object, kind), fill: color(object.id), "fill-opacity": opacity, "fill-rule": "evenodd",
    });
    for (const object of image.objects) {
      if (shown.includes("amodal") && object.amodal) {
        all.push(fill(object, "amodal", 0.22), element("path", {
          class: "outline amodal", d: path(image, object, "amodal"), stroke: color(object.id),
        }));
      }
      if (shown.includes("visible") && object.visible) {
        all.push(fill(object, "visible", 0.5), element("path", {
          class: "outline visible", d: path(image, object, "visible"), stroke: color(object.id),
        }));
      }
      if (shown.includes("hidden") && object.hidden) {
        all.push(fill(object, "hidden", 0.75), element("path", {
          class: "outline hidden", d: path(image, object, "hidden"), stroke: "#fff",
        }));
      }
    }
    // Predictions have the color of the object that they stand for; those of none are red.
    for (const [name, kind] of Object.entries(predicted)) {
      if (!shown.includes(name)) continue;
      for (const it of predictions(image)) {
        const d = path(image, it, kind), stroke = it.object === null ? "#ff4136" : color(it.object);
        if (!d) continue;
        all.push(
          element("path", { class: `fill predicted ${kind}`, d, fill: stroke, "fill-opacity": it.object === null ? 0.5 : 0.3, "fill-rule": "evenodd" }),
          element("path", { class: "outline predicted under", d }), element("path", { class: "outline predicted", d, stroke }),
        );
      }
    }
    if (shown.includes("boxes")) {
      for (const object of image.objects) {
        const box = object.amodal_box ?? object.visible_box;
        if (box) {
          const [x, y, w, h] = box;
          all.push(element("rect", { class: "box", x, y, width: w, height: h, stroke: color(object.id) }));
        }
      }
    }
    const picked = image.objects.find((object) => object.id === chosen);
    if (picked) {
      for (const kind of ["amodal", "visible"]) {
        if (!picked[kind]) continue;
        const d = path(image, picked, kind);
        if (kind === "visible" || !picked.visible) {
          all.push(element("path", { class: "fill", d, fill: color(picked.id), "fill-opacity": 0.55, "fill-rule": "evenodd" }));
        }
        all.push(element("path", { class: "chosen under", d }), element("path", { class: "chosen", d, "stroke-dasharray": kind === "amodal" ? "6 4" : null }));
      }
    }
    if (shown.includes("order") && image.graph) {
      const of = new Map(image.objects.map((object) => [object.id, object]));
      for (const [front, back] of image.graph.edges) {
        if (!of.has(front) || !of.has(back)) continue;
        const [from, to] = [center(of.get(front)), center(of.get(back))];
        const length = Math.hypot(to[0] - from[0], to[1] - from[1]) || 1, head = Math.min(HEAD_PX * unit, length / 3);
        const [dx, dy] = [(to[0] - from[0]) / length, (to[1] - from[1]) / length];
        // Ids stand at the ends of arrows, and must not cover their heads.
        const gap = shown.includes("ids") ? Math.min(TAG_PX * unit, length / 4) : 0;
        const [x, y, u, v] = [from[0] + gap * dx, from[1] + gap * dy, to[0] - gap * dx, to[1] - gap * dy];
        const d = `M${x} ${y}L${u} ${v}M${u - head * (dx + dy / 2)} ${v - head * (dy - dx / 2)}L${u} ${v}L${u - head * (dx - dy / 2)} ${v - head * (dy + dx / 2)}`;
        all.push(element("path", { class: "arrow under", d, fill: "none" }), element("path", { class: "arrow", d, fill: "none" }));
      }
    }
    if (shown.includes("ids")) {
      for (const object of image.objects) {
        if (!boxOf(object)) continue;
        const [x, y] = center(object);
        const tag = element("text", { class: "tag", x, y }, String(object.id));
        tag.style.fontSize = `${TAG_PX * unit}px`;
        tag.style.strokeWidth = `${3 * unit}px`;
        all.push(tag);
      }
    }
    if (choose) {
      for (const object of image.objects) {
        const d = path(image, object, object.visible ? "visible" : "amodal");
        if (!d) continue;
        const hit = element("path", { class: "hit", d, "fill-rule": "evenodd", "data-id": object.id },
          element("title", {}, `${object.id} ${object.name || object.category}`));
        hit.addEventListener("click", () => choose(object.id));
        hit.addEventListener("pointerenter", () => over(object.id));
        hit.addEventListener("pointerleave", () => over(null));
        all.push(hit);
      }
    }
    svg.replaceChildren(...all);
  };

  /** Makes switches follow the address, and calls `changed` when one is used. */
  const switches = (changed) => {
    const inputs = [...document.querySelectorAll("[data-switch]")];
    const show = () => inputs.forEach((input) => { input.checked = on().includes(input.dataset.switch); });
    for (const input of inputs) {
      input.addEventListener("change", () => {
        syntable.setState({ on: inputs.filter((it) => it.checked).map((it) => it.dataset.switch).join(".") });
        changed();
      });
    }
    addEventListener("keydown", (event) => {
      const input = inputs.find((it) => it.dataset.key === event.key);
      if (!input || input.disabled || syntable.isTyping(event)) return;
      input.click();
    });
    show();
    return { show, enable: (image) => inputs.forEach((it) => { it.disabled = !kinds[it.dataset.switch](image); }) };
  };

  return { draw, on, switches };
})();
