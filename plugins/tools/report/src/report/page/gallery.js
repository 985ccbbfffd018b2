// The gallery: a page of images at a time, labels over those that are on screen.
"use strict";
{
  const { facts, element, filter, overlay, state, setState, whole, imagePath } = syntable;
  const grid = document.getElementById("grid"), number = document.getElementById("page");
  let pages = Math.ceil(facts.images / facts.per_page);
  const page = () => whole(state().get("page") ?? "1", 1, pages);
  const percent = (rate) => `${Math.round(100 * rate)} %`;

  const label = async (card) => {
    const svg = card.querySelector("svg"), on = overlay.on();
    if (on.length === 0) {
      svg.replaceChildren();
      return;
    }
    const image = await syntable.view(Number(card.dataset.place));
    if (card.isConnected && card.dataset.visible) overlay.draw(svg, image, overlay.on());
  };
  const watch = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      if (isIntersecting) target.dataset.visible = "1"; else delete target.dataset.visible;
      if (isIntersecting) label(target).catch(syntable.fail);
    }
  }, { rootMargin: "200px" });

  const card = (place, row) => {
    const [scene, view] = row.place, [width, height] = row.size;
    const frame = element("div", { class: `frame${row.has_image ? "" : " bare"}` });
    frame.style.aspectRatio = `${width} / ${height}`;
    if (row.has_image) {
      frame.append(element("img", { src: imagePath("image", place), alt: "", loading: "lazy", width, height }));
    }
    frame.append(element("svg", { "aria-hidden": "true" }));
    const objects = `${row.objects} object${row.objects === 1 ? "" : "s"}`;
    const says = row.most === null ? objects : `${objects} · max ${percent(row.most)}`;
    const name = element("span", {}, element("bdi", {}, row.name.split("/").pop()));
    const link = element("a", {
      class: "card", href: `view.html#i=${place}`, "data-place": place,
      "aria-label": `Scene ${scene}, view ${view}: ${row.objects} objects${row.faults ? `, ${row.faults} faults` : ""}`,
      title: `${row.name}: scene ${scene}, view ${view}`,
    }, frame, element("div", { class: "says" }, name, element("span", {}, says)));
    link.addEventListener("click", () => {
      link.href = `view.html${filter.carried({ i: place })}`;
    });
    watch.observe(link);
    return element("li", {}, link);
  };

  const many = (number, one) => `${number.toLocaleString("en-US")} ${one}${number === 1 ? "" : "s"}`;
  /** The rows of a page: of all images, or of those that meet the conditions. */
  const rowsOf = async (now) => {
    const chosen = await filter.rows((read) => {
      document.getElementById("which").textContent = `Reading labels: ${read.toLocaleString("en-US")} of ${many(facts.images, "image")}`;
    });
    const first = (now - 1) * facts.per_page;
    const all = chosen ? chosen.length : facts.images;
    const rows = chosen ? chosen.slice(first, first + facts.per_page)
      : (await syntable.get(`rows/${now - 1}`)).map((row, index) => ({ ...row, at: first + index }));
    return { rows, first, all };
  };

  let latest = 0;
  const show = async (focus = null) => {
    const turn = ++latest;
    if (!filter.isActive()) pages = Math.ceil(facts.images / facts.per_page);
    let found = await rowsOf(page());
    if (turn !== latest) return;
    pages = Math.max(1, Math.ceil(found.all / facts.per_page));
    const now = page();
    if (found.first !== (now - 1) * facts.per_page) found = await rowsOf(now);
    number.value = now;
    number.max = pages;
    document.getElementById("pages").textContent = pages.toLocaleString("en-US");
    for (const [id, to] of [["first", 1], ["back", now - 1], ["next", now + 1], ["last", pages]]) {
      const button = document.getElementById(id);
      button.disabled = to === now || to < 1 || to > pages;
      button.onclick = () => go(to);
    }
    const { rows, first, all } = found;
    const part = rows.length < all ? `Images ${(first + 1).toLocaleString("en-US")} to ${(first + rows.length).toLocaleString("en-US")} of ` : "";
    const of = filter.isActive() ? `${many(all, "image")}, of ${facts.images.toLocaleString("en-US")}` : many(all, "image");
    document.getElementById("which").textContent = all === 0 ? "No image meets the conditions." : part + of;
    watch.disconnect();
    grid.replaceChildren(...rows.map((row) => card(row.at, row)));
    grid.dataset.ready = String(now);
    grid.dataset.all = String(all);
    if (focus !== null) grid.querySelectorAll("a")[focus < 0 ? rows.length - 1 : focus]?.focus();
  };
  const go = (to, focus = null) => {
    setState({ page: to === 1 ? null : to });
    scrollTo(0, 0);
    show(focus).catch(syntable.fail);
  };

  number.addEventListener("change", () => go(whole(number.value, 1, pages)));
  const { show: follow } = overlay.switches(() => {
    for (const link of grid.querySelectorAll("[data-visible]")) label(link).catch(syntable.fail);
  });
  const form = filter.form(() => show().catch(syntable.fail));
  /** The card to start from: the one with the focus, or the first that is in sight. */
  const start = (cards) => {
    const focused = cards.indexOf(document.activeElement?.closest("#grid a"));
    return focused >= 0 ? [focused, true] : [Math.max(0, cards.findIndex((it) => it.getBoundingClientRect().bottom > 0)), false];
  };
  addEventListener("keydown", (event) => {
    if (syntable.isTyping(event) || event.shiftKey) return;
    const cards = [...grid.querySelectorAll("a")], now = page();
    if (cards.length === 0) return;
    const columns = Math.max(1, cards.filter((it) => it.offsetTop === cards[0].offsetTop).length);
    const steps = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -columns, ArrowDown: columns, Home: -cards.length, End: cards.length };
    if (event.key in steps) {
      const [at, isFocused] = start(cards), isStep = event.key.startsWith("Arrow");
      cards[Math.min(cards.length - 1, Math.max(0, at + (isFocused || !isStep ? steps[event.key] : 0)))].focus();
    } else if (event.key === "PageDown") {
      if (now < pages) go(now + 1, 0); else cards.at(-1).focus();
    } else if (event.key === "PageUp") {
      if (now > 1) go(now - 1, 0); else cards[0].focus();
    } else if (event.key === "Escape") {
      document.activeElement?.blur();
      return;
    } else {
      return;
    }
    event.preventDefault();
  });
  addEventListener("hashchange", () => {
    follow();
    form.show();
    show().catch(syntable.fail);
  });
  show().catch(syntable.fail);
}
