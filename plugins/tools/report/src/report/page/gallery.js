// The gallery: a page of images at a time, labels over those that are on screen.
"use strict";
{
  const { facts, element, overlay, state, setState, whole, imagePath } = syntable;
  const grid = document.getElementById("grid"), number = document.getElementById("page");
  const pages = Math.ceil(facts.images / facts.per_page);
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
      const on = state().get("on");
      link.href = `view.html#i=${place}${on ? `&on=${on}` : ""}`;
    });
    watch.observe(link);
    return element("li", {}, link);
  };

  const show = async (focus = false) => {
    const now = page();
    number.value = now;
    for (const [id, to] of [["first", 1], ["back", now - 1], ["next", now + 1], ["last", pages]]) {
      const button = document.getElementById(id);
      button.disabled = to === now || to < 1 || to > pages;
      button.onclick = () => go(to, false);
    }
    const rows = await syntable.get(`rows/${now - 1}`);
    if (now !== page()) return;
    const first = (now - 1) * facts.per_page;
    document.getElementById("which").textContent = `Images ${first + 1} to ${first + rows.length} of ${facts.images.toLocaleString("en-US")}`;
    watch.disconnect();
    grid.replaceChildren(...rows.map((row, index) => card(first + index, row)));
    grid.dataset.ready = String(now);
    if (focus) grid.querySelector("a").focus();
  };
  const go = (to, focus) => {
    setState({ page: to === 1 ? null : to });
    scrollTo(0, 0);
    show(focus).catch(syntable.fail);
  };

  number.max = pages;
  document.getElementById("pages").textContent = pages.toLocaleString("en-US");
  number.addEventListener("change", () => go(whole(number.value, 1, pages), false));
  const { show: follow } = overlay.switches(() => {
    for (const link of grid.querySelectorAll("[data-visible]")) label(link).catch(syntable.fail);
  });
  grid.addEventListener("keydown", (event) => {
    const cards = [...grid.querySelectorAll("a")], at = cards.indexOf(document.activeElement);
    if (at < 0) return;
    const columns = Math.max(1, cards.filter((it) => it.offsetTop === cards[0].offsetTop).length);
    const steps = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -columns, ArrowDown: columns };
    const now = page();
    if (event.key in steps) {
      event.preventDefault();
      cards[Math.min(cards.length - 1, Math.max(0, at + steps[event.key]))].focus();
    } else if (event.key === "PageDown" && now < pages) {
      event.preventDefault();
      go(now + 1, true);
    } else if (event.key === "PageUp" && now > 1) {
      event.preventDefault();
      go(now - 1, true);
    }
  });
  addEventListener("hashchange", () => {
    follow();
    show().catch(syntable.fail);
  });
  show().catch(syntable.fail);
}
