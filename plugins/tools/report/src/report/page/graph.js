// The occlusion graph of a view: layers from top to bottom, who occludes above whom is occluded.
"use strict";
syntable.graph = (() => {
  const { element, color } = syntable;
  const RADIUS = 14, ROW = 54, COLUMN = 44, LEFT = 96, BANDS = ["top", "intermediate", "bottom"];

  /** Rows of ids: objects of the top layer, those between by their place from front to back, those of the bottom layer. */
  const rows = (image) => {
    const layer = new Map(image.objects.map((object) => [object.id, object.layer]));
    const of = (name, ids) => ids.filter((id) => layer.get(id) === name);
    const all = image.graph.depth_layers.flat();
    const between = image.graph.depth_layers.map((ids) => of("intermediate", ids)).filter((ids) => ids.length > 0);
    return [["top", of("top", all)], ...between.map((ids) => ["intermediate", ids]), ["bottom", of("bottom", all)]]
      .filter(([, ids]) => ids.length > 0);
  };

  /** Orders each row by the mean place of those that are linked in rows above, so that fewer links cross. */
  const ordered = (found, edges) => {
    const neighbors = new Map();
    for (const [a, b] of edges) {
      neighbors.set(a, [...(neighbors.get(a) ?? []), b]);
      neighbors.set(b, [...(neighbors.get(b) ?? []), a]);
    }
    // Objects without a link stand at the right.
    const isLinked = (id) => neighbors.has(id);
    let lists = found.map(([name, ids]) => [name, [...ids.filter(isLinked), ...ids.filter((id) => !isLinked(id))]]);
    for (let round = 0; round < 6; round++) {
      const place = new Map(lists.flatMap(([, ids]) => ids.map((id, index) => [id, (index + 0.5) / ids.length])));
      lists = lists.map(([name, ids]) => {
        const mean = (id) => {
          const others = (neighbors.get(id) ?? []).filter((other) => !ids.includes(other) && place.has(other));
          return isLinked(id) ? others.reduce((sum, other) => sum + place.get(other), 0) / Math.max(1, others.length) : 2;
        };
        return [name, ids.map((id) => [mean(id), id]).sort((a, b) => a[0] - b[0] || a[1] - b[1]).map(([, id]) => id)];
      });
    }
    return lists;
  };

  /** Draws the graph of an image; `choose` is called with the id of a node that is clicked. */
  const draw = (svg, image, chosen, choose) => {
    const most = 9, { edges, cycles } = image.graph;
    const lists = ordered(rows(image), edges).flatMap(([name, ids]) =>
      Array.from({ length: Math.ceil(ids.length / most) }, (_, part) => [name, ids.slice(part * most, (part + 1) * most)]));
    const widest = Math.max(4, ...lists.map(([, ids]) => ids.length));
    const [width, height] = [LEFT + widest * COLUMN + 16, lists.length * ROW + 16];
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const place = new Map(), all = [], heads = [];
    lists.forEach(([name, ids], row) => {
      const y = 8 + ROW * (row + 0.5), isBetween = name === "intermediate" && ids.length < widest - 1;
      // Rows of few are shifted against each other, so that links pass beside nodes.
      const gap = isBetween ? COLUMN * 1.5 : (widest * COLUMN) / ids.length, free = widest * COLUMN - gap * ids.length;
      const left = isBetween && free > 0 ? LEFT + free * (0.12 + 0.76 * ((row * 0.618) % 1)) : LEFT + Math.max(0, free) / 2;
      ids.forEach((id, index) => place.set(id, [left + gap * (index + 0.5), y + (index % 2 ? 5 : -5)]));
      if (row === 0 || lists[row - 1][0] !== name) {
        if (row > 0) all.push(element("line", { class: "split", x1: 0, x2: width, y1: y - ROW / 2, y2: y - ROW / 2 }));
        all.push(element("text", { class: "band", x: 12, y: y + 4 }, name[0].toUpperCase() + name.slice(1)));
      }
    });
    const inCycle = (a, b) => cycles.some((set) => set.includes(a) && set.includes(b));
    const links = [...edges].sort((a, b) => a.includes(chosen) - b.includes(chosen));
    for (const [front, back] of links) {
      if (!place.has(front) || !place.has(back)) continue;
      const [[x, y], [u, v]] = [place.get(front), place.get(back)];
      const marks = `${inCycle(front, back) ? " cycle" : ""}${chosen === front || chosen === back ? " near" : ""}`;
      // Links bend to the left of their way, so that the two of a pair are apart.
      const bend = inCycle(front, back) || Math.abs(y - v) < 20 ? 0.22 : 0.06;
      const [mx, my] = [(x + u) / 2 + bend * (v - y), (y + v) / 2 - bend * (u - x)];
      const length = Math.hypot(u - mx, v - my) || 1, [dx, dy] = [(u - mx) / length, (v - my) / length];
      const [ex, ey] = [u - dx * (RADIUS + 2), v - dy * (RADIUS + 2)];
      all.push(element("path", { class: `link${marks}`, d: `M${x} ${y}Q${mx} ${my} ${ex - dx * 5} ${ey - dy * 5}` }));
      heads.push(element("path", {
        class: `head${marks}`, d: `M${ex} ${ey}L${ex - dx * 8 - dy * 4} ${ey - dy * 8 + dx * 4}L${ex - dx * 8 + dy * 4} ${ey - dy * 8 - dx * 4}Z`,
      }));
    }
    const of = new Map(image.objects.map((object) => [object.id, object]));
    for (const [id, [x, y]] of place) {
      const object = of.get(id), says = `${id} ${object?.name || object?.category || ""}`.trim();
      const count = (index) => edges.filter((edge) => edge[index] === id).length;
      const node = element("g", {
        class: "node", role: "button", tabindex: 0, "data-id": id, "aria-pressed": String(id === chosen),
        "aria-label": `Object ${says}: occludes ${count(0)}, occluded by ${count(1)}`,
      }, element("title", {}, says), element("circle", { cx: x, cy: y, r: RADIUS, fill: color(id) }), element("text", { x, y }, String(id)));
      node.addEventListener("click", () => choose(id));
      node.addEventListener("keydown", (event) => {
        if (event.key === "Enter" || event.key === " ") {
          event.preventDefault();
          choose(id);
        }
      });
      all.push(node);
    }
    const focused = document.activeElement?.closest?.(".node")?.dataset.id;
    // Heads lie above nodes that are in the way.
    svg.replaceChildren(...all, ...heads);
    if (focused) svg.querySelector(`.node[data-id="${focused}"]`)?.focus();
  };

  return { draw };
})();
