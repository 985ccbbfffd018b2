// The preview: a grid of views that follows every save, and one view large, at final quality.
"use strict";
{
  const { element, overlay, state, setState } = syntable;
  const by = (id) => document.getElementById(id);
  const grid = by("grid"), form = by("choice"), dialog = by("large");
  const SCROLL = `syntable-preview-scroll ${location.pathname}`;
  let version = Number(document.documentElement.dataset.version), shown = null, isRestored = false;

  // What the user chose is part of the address, so that a reload shows it again.
  const CHOSEN = ["seed", "first", "scenes", "views", "large"];
  const choice = () => {
    const now = state(), out = new URLSearchParams();
    for (const name of CHOSEN) if (now.get(name)) out.set(name, now.get(name));
    return out;
  };
  const tell = (options = {}) => fetch(`choose?${choice()}`, options).catch(() => {});
  const choose = (changes) => {
    setState(changes);
    tell();
    fillForm();
  };
  const base = () => (["depth", "normal"].includes(state().get("base")) ? state().get("base") : "color");
  const opened = () => /^(\d+)\.(\d+)$/.exec(state().get("large") ?? "")?.slice(1).map(Number) ?? null;
  const isAt = (cell, place) => place !== null && cell.scene === place[0] && cell.view === place[1];

  const say = (id, text) => {
    if (by(id).textContent !== text) by(id).textContent = text;
  };
  const percent = (rate) => `${Math.round(100 * rate)} %`;
  const numbers = ({ objects, rates, seconds }) => [
    objects === null ? null : `${objects} object${objects === 1 ? "" : "s"}`,
    rates ? `hidden ${percent(rates[0])}, max ${percent(rates[1])}` : null, `${seconds.toFixed(1)} s`,
  ].filter(Boolean).join(" · ");

  const read = new Map();
  /** The labels of a view, read once. */
  const labelsOf = (shot) => {
    if (!read.has(shot.key)) {
      read.set(shot.key, fetch(`shot/${shot.key}/labels.json`).then((answer) => answer.ok ? answer.json() : Promise.reject(new Error(answer.status))));
      read.get(shot.key).catch(() => read.delete(shot.key));
      if (read.size > 400) read.delete(read.keys().next().value);
    }
    return read.get(shot.key);
  };
  const imageOf = (shot) => `shot/${shot.key}/${shot.images.includes(base()) ? base() : "color"}.png`;
  /** Shows an image once it is there as a whole. */
  const put = async (img, source) => {
    if (img.dataset.wanted === source) return;
    img.dataset.wanted = source;
    const next = new Image();
    next.src = source;
    try { await next.decode(); } catch { return; }
    if (img.dataset.wanted === source) img.src = source;
  };
  const label = async (svg, shot, chosen = null, pick = null) => {
    const on = overlay.on();
    svg.dataset.key = shot.key;
    if (on.length === 0 && !pick) return svg.replaceChildren();
    const labels = await labelsOf(shot).catch(() => null);
    if (labels && svg.dataset.key === shot.key) overlay.draw(svg, labels, overlay.on(), chosen, pick);
  };

  /** The card of a view; cards stay, so that the focus and the scroll position do. */
  const cards = new Map();
  const cardOf = (cell) => {
    const name = `${cell.scene}.${cell.view}`;
    if (!cards.has(name)) {
      const frame = element("div", { class: "frame" }, element("img", { alt: "", hidden: "" }), element("svg", { "aria-hidden": "true" }));
      const button = element("button", { type: "button", class: "view-card", "data-view": name }, frame, element("span", { class: "says" }, element("span"), element("span")));
      button.addEventListener("click", () => open([cell.scene, cell.view]));
      cards.set(name, element("li", {}, button));
    }
    return cards.get(name);
  };
  const fillCard = (cell, size) => {
    const card = cardOf(cell), button = card.firstChild, frame = button.firstChild, [img, svg] = frame.children;
    const [name, says] = button.lastChild.children, { shot } = cell;
    frame.style.aspectRatio = (shot?.size ?? size).join(" / ");
    button.className = `view-card ${cell.state}`;
    button.disabled = !shot;
    name.textContent = `Scene ${cell.scene}, view ${cell.view}`;
    says.textContent = { waiting: "waiting", failed: "failed", before: "before the change", current: shot ? numbers(shot) : "" }[cell.state];
    button.setAttribute("aria-label", `${name.textContent}: ${says.textContent}`);
    frame.querySelector(".waits, .reason")?.remove();
    if (cell.state === "waiting") frame.append(element("span", { class: "waits" }, "waiting"));
    if (cell.state === "failed") frame.append(element("p", { class: "reason" }, cell.reason));
    img.hidden = svg.style.display === "none" || !shot;
    if (shot) {
      put(img, imageOf(shot)).catch(() => {});
      label(svg, shot);
    } else {
      svg.replaceChildren();
      img.removeAttribute("src");
      delete img.dataset.wanted;
    }
    return card;
  };

  /** How much smaller views may be so that rows hold whole scenes. */
  const WHOLE = 1.2;
  /** The number of columns with which the views are largest without scrolling. */
  const arrange = () => {
    if (!shown || shown.cells.length === 0) return;
    const size = shown.cells.find((cell) => cell.shot)?.shot.size ?? [4, 3], ratio = size[0] / size[1];
    const width = grid.clientWidth, height = innerHeight - grid.getBoundingClientRect().top - scrollY - 24, GAP = 14, SAYS = 48, LEAST = 260;
    const many = shown.cells.length, views = shown.views.length || 1;
    let best = [0, 1, 0];
    for (let columns = 1; columns <= Math.min(many, 12); columns++) {
      const rows = Math.ceil(many / columns), wide = (width - GAP * (columns - 1)) / columns;
      const fits = Math.min(wide, (height / rows - SAYS - GAP) * ratio);
      // Small windows scroll rather than show views that are too small.
      const edge = Math.max(fits, Math.min(wide, LEAST)) * (columns % views === 0 || views % columns === 0 ? WHOLE : 1);
      if (edge > best[0]) best = [edge, columns, fits];
    }
    grid.style.setProperty("--columns", best[1]);
    grid.style.setProperty("--widest", best[2] >= LEAST ? `${Math.floor(best[2])}px` : "1fr");
  };

  const enable = () => {
    const shots = shown.cells.map((cell) => cell.shot).filter(Boolean);
    const has = (test) => shots.length === 0 || shots.some(test);
    const tests = { visible: "has_masks", amodal: "has_masks", hidden: "has_masks", boxes: "has_boxes", order: "has_order", ids: "has_masks" };
    for (const input of document.querySelectorAll("[data-switch]")) input.disabled = !has((shot) => shot[tests[input.dataset.switch]]);
    for (const input of document.querySelectorAll("[name=base]")) {
      input.disabled = !has((shot) => shot.images.includes(input.value));
      input.checked = input.value === base();
    }
  };
  const fillForm = () => {
    if (!shown) return;
    const now = state(), values = { seed: shown.seed, first: shown.scenes[0] ?? 0, scenes: shown.scenes.length, views: shown.views.length };
    for (const [name, value] of Object.entries(values)) {
      const field = form.elements.namedItem(name);
      if (field !== document.activeElement) field.value = now.get(name) ?? value;
    }
    by("of-recipe").hidden = !["seed", "first", "scenes", "views"].some((name) => now.get(name) !== null);
  };

  const show = (next) => {
    shown = next;
    document.title = (next.mistakes ? "✗ " : "") + next.title;
    document.body.classList.toggle("mistaken", next.mistakes !== "");
    say("title", next.title);
    say("status", next.status);
    say("mistakes", next.mistakes);
    by("mistakes").hidden = next.mistakes === "";
    by("warnings").hidden = next.warnings.length === 0;
    by("warnings").firstChild.textContent = `${next.warnings.length} warning${next.warnings.length === 1 ? "" : "s"}`;
    by("warnings").lastChild.textContent = next.warnings.join("\n");
    const size = next.cells.find((cell) => cell.shot)?.shot.size ?? [4, 3];
    const wanted = next.cells.map((cell) => fillCard(cell, size));
    if (wanted.length !== grid.children.length || wanted.some((card, at) => grid.children[at] !== card)) grid.replaceChildren(...wanted);
    for (const [name, card] of cards) if (!wanted.includes(card)) cards.delete(name);
    fillForm();
    enable();
    arrange();
    showLarge();
    if (!isRestored && wanted.length > 0) {
      isRestored = true;
      scrollTo(0, Number(sessionStorage.getItem(SCROLL) ?? 0));
    }
    document.documentElement.dataset.version = String(next.version);
  };
  const draw = () => {
    if (shown) show(shown);
  };

  // One view, large.
  let picked = null;
  const zoom = syntable.zoom(by("frame"), by("canvas"), () => requestAnimationFrame(showLarge));
  const pick = (id) => {
    picked = picked === id ? null : id;
    showLarge();
  };
  const showLarge = () => {
    const place = opened();
    if (place === null || !shown) {
      if (dialog.open) {
        grid.before(by("layers"));
        dialog.close();
      }
      return;
    }
    const draft = shown.cells.find((cell) => isAt(cell, place)) ?? null;
    const final = shown.large && isAt(shown.large, place) ? shown.large : null;
    const cell = final?.shot && final.state === "current" ? final : draft?.shot ? draft : final?.shot ? final : null;
    if (!dialog.open) {
      // Behind the dialog, the switches could not be used.
      dialog.firstElementChild.after(by("layers"));
      dialog.showModal();
    }
    say("large-title", `Scene ${place[0]}, view ${place[1]}`);
    const isFinal = cell !== null && cell === final && final.state === "current";
    const size = cell?.shot.size ?? [4, 3];
    say("large-status", shown.mistakes ? "the recipe has errors"
      : final?.state === "failed" ? `failed: ${final.reason}`
      : isFinal ? `final quality · ${size.join(" × ")} px · ${numbers(cell.shot)}`
      : draft === null ? "this view is not on the page" : "rendering at final quality …");
    const at = shown.cells.findIndex((it) => isAt(it, place));
    for (const [id, step] of [["large-back", -1], ["large-next", 1]]) {
      const to = at < 0 ? undefined : shown.cells[at + step];
      by(id).disabled = !to;
      by(id).onclick = () => open([to.scene, to.view]);
    }
    by("canvas").classList.toggle("draft", !isFinal);
    dialog.dataset.final = isFinal ? cell.shot.key : "";
    by("image").hidden = cell === null;
    if (cell === null) return by("labels").replaceChildren();
    by("frame").style.setProperty("--ratio", size[0] / size[1]);
    by("image").alt = `Scene ${place[0]}, view ${place[1]}`;
    put(by("image"), imageOf(cell.shot));
    label(by("labels"), cell.shot, picked, pick);
    labelsOf(cell.shot).then((labels) => {
      const object = labels.objects.find((it) => it.id === picked);
      say("picked", object ? `${object.id} ${object.name || object.category}${object.rate === null ? "" : `, hidden ${percent(object.rate)}`}` : "Click an object to highlight it; wheel, two fingers or + and − zoom.");
    }).catch(() => {});
  };
  const open = (place) => {
    if (opened() === null) by("image").removeAttribute("src");
    picked = null;
    zoom.reset();
    choose({ large: place.join(".") });
    showLarge();
  };
  const close = () => {
    const place = opened();
    choose({ large: null });
    showLarge();
    if (place) cards.get(place.join("."))?.firstChild.focus();
  };
  by("close").addEventListener("click", close);
  dialog.addEventListener("cancel", (event) => {
    event.preventDefault();
    if (picked !== null) pick(picked);
    else if (zoom.isZoomed()) zoom.reset();
    else close();
  });
  by("closer").addEventListener("click", () => zoom.by(1.5));
  by("farther").addEventListener("click", () => zoom.by(1 / 1.5));
  by("entire").addEventListener("click", zoom.reset);
  // Who leaves does not need the large image any more.
  addEventListener("pagehide", () => {
    sessionStorage.setItem(SCROLL, String(scrollY));
    if (opened()) {
      const left = choice();
      left.delete("large");
      fetch(`choose?${left}`, { keepalive: true }).catch(() => {});
    }
  });

  const seed = (step) => {
    const next = BigInt(shown?.seed ?? 0) + BigInt(step);
    if (next >= 0n && next < 1n << 64n) choose({ seed: String(next) });
  };
  by("seed-back").addEventListener("click", () => seed(-1));
  by("seed-next").addEventListener("click", () => seed(1));
  by("of-recipe").addEventListener("click", () => choose({ seed: null, first: null, scenes: null, views: null }));
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("change", ({ target }) => {
    if (/^\d+$/.test(target.value)) choose({ [target.name]: target.value });
    else fillForm();
  });
  for (const input of document.querySelectorAll("[name=base]")) {
    input.addEventListener("change", () => {
      setState({ base: input.value === "color" ? null : input.value });
      draw();
    });
  }
  const { show: follow } = overlay.switches(draw);
  addEventListener("keydown", (event) => {
    if (syntable.isTyping(event)) return;
    const to = [...document.querySelectorAll("[data-base-key]")].find((it) => it.dataset.baseKey === event.key);
    if (to && !to.disabled) to.click();
    else if (event.key === "[") seed(-1);
    else if (event.key === "]") seed(1);
    else if (opened() && !zoom.key(event) && ["ArrowLeft", "ArrowRight"].includes(event.key)) {
      by(event.key === "ArrowLeft" ? "large-back" : "large-next").click();
    } else if (!opened()) move(event);
  });
  /** Arrow keys, Home and End move between the views of the grid. */
  const move = (event) => {
    const all = [...grid.querySelectorAll("button:enabled")], at = all.indexOf(document.activeElement);
    const columns = Number(grid.style.getPropertyValue("--columns")) || 1;
    const steps = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -columns, ArrowDown: columns, Home: -all.length, End: all.length };
    if (!(event.key in steps) || all.length === 0) return;
    event.preventDefault();
    all[at < 0 ? 0 : Math.min(all.length - 1, Math.max(0, at + steps[event.key]))].focus();
  };
  addEventListener("resize", () => {
    arrange();
    showLarge();
  });
  addEventListener("hashchange", () => {
    follow();
    tell();
    draw();
  });

  const pause = (time) => new Promise((done) => setTimeout(done, time));
  const update = async () => {
    for (;;) {
      try {
        const answer = await fetch(`changes?after=${version}`);
        // Another preview has this port now, with an address of its own.
        if (answer.status === 403) return say("status", "This preview has ended. Open the new address that the terminal shows.");
        const news = await answer.json();
        if (news.version !== version || !shown) {
          const next = await (await fetch("state.json")).json();
          version = next.version;
          if (version > 0) show(next);
        }
      } catch {
        say("status", "the preview has ended, or cannot be reached");
        await pause(1000);
        // The state is asked for again, which replaces this status.
        version = 0;
      }
    }
  };
  // A choice in the address comes before that of another page.
  const start = async () => {
    if (choice().size > 0) await tell();
    if (version > 0) show(await (await fetch("state.json")).json());
    update();
  };
  start();
}
