// One image: labels over it, its occlusion graph, its objects.
"use strict";
{
  const { facts, element, download, filter, overlay, graph, color, state, setState, whole, imagePath } = syntable;
  const by = (id) => document.getElementById(id);
  const place = () => whole(state().get("i") ?? "0", 0, facts.images - 1);
  const chosen = () => Number(state().get("object") ?? 0) || null;
  /** How far Page Up and Page Down go. */
  const PAGE = 10;
  let image = null, pointed = null;
  /** The object whose masks a download holds: the one below the pointer, or the highlighted one. */
  const object = () => image?.objects.find((it) => it.id === (pointed ?? chosen()));

  const choose = (id) => {
    setState({ object: chosen() === id ? null : id });
    draw();
  };

  const drawLabels = () => {
    overlay.draw(by("labels"), image, overlay.on(), chosen(), choose, (id) => {
      pointed = id;
    });
  };
  const zoom = syntable.zoom(by("frame"), by("canvas"), () => image && requestAnimationFrame(drawLabels));
  const saveMask = async (kind) => {
    const it = object();
    if (it?.[kind]) download.save(await download.png(it[kind], image.size), `${download.named(image, it.id, kind)}.png`);
  };
  for (const kind of ["visible", "amodal"]) by(`save-${kind}`).addEventListener("click", () => saveMask(kind).catch(syntable.fail));
  by("closer").addEventListener("click", () => zoom.by(1.5));
  by("farther").addEventListener("click", () => zoom.by(1 / 1.5));
  by("entire").addEventListener("click", zoom.reset);
  addEventListener("resize", () => image && drawLabels());

  const meters = (value) => `${value.toFixed(2)} m`;
  const draw = () => {
    if (!image) return;
    const base = state().get("base") === "depth" && image.depth_m ? "depth" : "image";
    const has = base === "depth" || image.has_image;
    const img = by("image"), path = imagePath(base, image.place);
    img.hidden = !has;
    if (has && img.getAttribute("src") !== path) img.src = path;
    img.alt = base === "depth" ? `Depth of ${image.name}` : image.name;
    for (const input of document.querySelectorAll("[name=base]")) {
      input.checked = input.value === base;
      input.disabled = input.value === "depth" ? !image.depth_m : !image.has_image;
    }
    by("legend").hidden = base !== "depth";
    if (image.depth_m) [by("near").textContent, by("far").textContent] = image.depth_m.map(meters);
    drawLabels();
    by("save-image").href = path;
    by("save-image").download = `${download.named(image, ...(base === "depth" ? ["depth"] : []))}.jpg`;
    by("save-image").hidden = !has;
    if (image.graph && image.objects.length > 0) graph.draw(by("graph"), image, chosen(), choose);
    for (const row of by("objects").rows) {
      const is = Number(row.dataset.id) === chosen();
      row.setAttribute("aria-selected", String(is));
      row.querySelector("button").setAttribute("aria-pressed", String(is));
    }
    const picked = image.objects.find((it) => it.id === chosen());
    by("picked").textContent = picked ? `Object ${picked.id} ${picked.name || picked.category} is highlighted.` : "A click on an object highlights it in the image, the graph and the list.";
    for (const kind of ["visible", "amodal"]) by(`save-${kind}`).disabled = !picked?.[kind];
  };

  const fill = () => {
    by("title").textContent = image.name.split("/").pop();
    document.title = `${image.name} · ${document.documentElement.dataset.name}`;
    const many = (list, one) => `${list.length} ${one}${list.length === 1 ? "" : "s"}`;
    const hidden = image.objects.filter((it) => it.is_hidden).length;
    const objects = many(image.objects, "object") + (hidden ? ` (${hidden} fully hidden)` : "");
    by("where").textContent = `${image.name} · scene ${image.scene}, view ${image.view} · ${image.size.join(" × ")} px · ${objects}`;
    by("space").hidden = !image.has_scene;
    by("space").href = `scene.html#scene=${image.scene}&view=${image.view}`;
    const [width, height] = image.size;
    by("frame").style.setProperty("--ratio", (width || 4) / (height || 3));
    const faults = image.faults.map(([check, message]) => element("li", {}, `${check}: ${message}`));
    by("faults").hidden = faults.length === 0;
    by("fault-list").replaceChildren(...faults);
    const { edges = [], cycles = [] } = image.graph ?? {};
    by("graph").toggleAttribute("hidden", !image.graph || image.objects.length === 0);
    by("graph-says").textContent = image.graph
      ? `${many(edges, "edge")}. ${cycles.length ? `${many(cycles, "cycle")}: ${cycles.map((set) => set.join(", ")).join("; ")}, dashed.` : "No cycle."} An arrow leads from the occluder to what it hides.`
      : "The dataset has no occlusion order.";
    by("graph").setAttribute("aria-label", `Occlusion graph: ${many(edges, "edge")}, ${many(cycles, "cycle")}`);
    by("objects").replaceChildren(...image.objects.map((object) => {
      const dot = element("i");
      dot.style.background = color(object.id);
      const button = element("button", { type: "button" }, dot, object.name || object.category || "object");
      button.addEventListener("click", () => choose(object.id));
      const rate = object.rate === null ? "–" : `${(100 * object.rate).toFixed(1)} %`;
      return element("tr", { "data-id": object.id },
        element("td", { class: "number" }, String(object.id)),
        element("td", { class: "word" }, button),
        element("td", { class: "word" }, object.category),
        element("td", { class: "number" }, rate),
        element("td", { class: object.layer ? `layer-${object.layer}` : "" }, object.layer ?? "–"));
    }));
  };

  /** What was predicted of the image, where scores are shown. */
  const fillPredictions = () => {
    if (!by("predicted")) return;
    const found = image.predicted;
    by("predicted").hidden = !found;
    by("unpredicted").hidden = !!found;
    if (!found) return;
    const ids = new Set(found.predictions.map((it) => it.object));
    const missed = image.objects.filter((it) => !ids.has(it.id) && !it.is_hidden).map((it) => it.id);
    const surplus = found.predictions.filter((it) => it.object === null).length;
    by("predicted-says").textContent = [
      missed.length ? `Missed: ${missed.join(", ")}.` : "No visible object is missed.",
      surplus ? `${surplus} of no object, drawn red.` : "",
    ].join(" ");
    by("predictions").replaceChildren(...found.predictions.map((it) => {
      const dot = element("i");
      dot.style.background = it.object === null ? "#ff4136" : color(it.object);
      const button = element("button", { type: "button", disabled: it.object === null ? "" : null }, dot, it.object === null ? "no object" : String(it.object));
      button.addEventListener("click", () => choose(it.object));
      return element("tr", {},
        element("td", { class: "number" }, it.score === undefined ? "–" : it.score.toFixed(2)),
        element("td", {}, button),
        element("td", { class: "number" }, it.amodal_f.toFixed(1)),
        element("td", { class: "number" }, it.visible_f.toFixed(1)),
        element("td", {}, it.occluded ? "yes" : "no"));
    }));
    by("image-scores").replaceChildren(...Object.entries(found.scores).map(([name, value]) =>
      element("div", {}, element("dt", {}, name.replaceAll("_", " ")), element("dd", {}, value.toFixed(1)))));
  };

  const { show: follow, enable } = overlay.switches(() => draw());
  /** The image that is a number of steps on, among those that the gallery shows. */
  let step = () => null;
  const show = async () => {
    const now = place();
    const chosenRows = await filter.rows();
    if (now !== place()) return;
    const places = chosenRows?.map((row) => row.at), count = places ? places.length : facts.images;
    const index = places ? places.indexOf(now) : now;
    step = (steps) => {
      const to = Math.min(count - 1, Math.max(0, index + steps));
      return count === 0 || to === index ? null : places ? places[to] : to;
    };
    for (const [id, steps] of [["back", -1], ["next", 1]]) {
      const to = step(steps);
      by(id).disabled = to === null;
      by(id).onclick = () => go(to);
    }
    const position = index < 0 ? "–" : (index + 1).toLocaleString("en-US");
    by("number").textContent = `${position} of ${count.toLocaleString("en-US")}${places ? " chosen" : ""}`;
    const page = Math.floor(Math.max(0, index) / facts.per_page) + 1;
    by("gallery").href = `gallery.html${filter.carried(page > 1 ? { page } : {})}`;
    by("gallery").textContent = places ? "Chosen images" : "All images";
    const read = await syntable.view(now);
    if (now !== place()) return;
    image = { ...read, place: now };
    pointed = null;
    fill();
    fillPredictions();
    enable(image);
    draw();
    by("frame").dataset.ready = String(now);
    // What comes next is read ahead.
    const ahead = step(1);
    if (ahead !== null) syntable.view(ahead).catch(() => {});
  };
  const go = (to) => {
    if (to === null) return;
    zoom.reset();
    setState({ i: to, object: null });
    show().catch(syntable.fail);
  };
  for (const input of document.querySelectorAll("[name=base]")) {
    input.addEventListener("change", () => {
      setState({ base: input.value === "depth" ? "depth" : null });
      draw();
    });
  }
  addEventListener("keydown", (event) => {
    if (syntable.isTyping(event) || !image) return;
    const steps = { ArrowLeft: -1, ArrowRight: 1, PageUp: -PAGE, PageDown: PAGE, Home: -facts.images, End: facts.images };
    if (zoom.key(event)) return;
    if (event.key === "m" || event.key === "M") saveMask(event.key === "m" ? "visible" : "amodal").catch(syntable.fail);
    else if (event.key === "Escape") {
      if (chosen()) choose(chosen());
      else if (zoom.isZoomed()) zoom.reset();
      else by("gallery").click();
    } else if (event.key in steps && !event.shiftKey) {
      event.preventDefault();
      go(step(steps[event.key]));
    }
  });
  addEventListener("hashchange", () => {
    follow();
    show().catch(syntable.fail);
  });
  show().catch(syntable.fail);
}
