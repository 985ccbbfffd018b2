// Which images the gallery shows, and in which order: conditions and order in the address, over an index of all images.
"use strict";
syntable.filter = (() => {
  const { facts } = syntable;
  const AT_ONCE = 4;
  /** Values to sort by; images without a value come last. */
  const orders = {
    occlusion: (row) => row.most,
    objects: (row) => row.objects,
    smallest: (row) => extreme(row, Math.min),
    largest: (row) => extreme(row, Math.max),
  };
  const ranges = ["hidden", "size", "objects"];
  const extreme = (row, of) => {
    const areas = row.of.map((object) => object.area).filter((area) => area > 0);
    return areas.length ? areas.reduce((a, b) => of(a, b)) : null;
  };

  /** A range as in `20-50`, `20-`, `-50`; both ends belong to it. */
  const range = (text) => {
    const found = /^(\d+(?:\.\d+)?)?-(\d+(?:\.\d+)?)?$/.exec(text ?? "");
    return found && (found[1] || found[2]) ? [Number(found[1] ?? -Infinity), Number(found[2] ?? Infinity)] : null;
  };
  const within = (value, ends) => ends === null || (value !== null && value >= ends[0] && value <= ends[1]);

  /** The conditions and the order in the address. */
  const wanted = () => {
    const state = syntable.state();
    const order = Object.hasOwn(orders, state.get("sort") ?? "") ? state.get("sort") : null;
    return {
      text: (state.get("q") ?? "").trim().toLowerCase(), category: state.get("class") ?? "",
      ...Object.fromEntries(ranges.map((name) => [name, range(state.get(name))])),
      order, descending: order !== null && state.get("up") === null,
    };
  };
  const isActive = (it = wanted()) => Boolean(it.text || it.category || it.order) || ranges.some((name) => it[name] !== null);

  /** Whether an object meets all conditions on objects. */
  const meets = (it) => (object) =>
    (!it.text || object.name.toLowerCase().includes(it.text) || object.category.toLowerCase().includes(it.text))
    && (!it.category || object.category === it.category)
    && within(object.rate === null ? null : 100 * object.rate, it.hidden) && within(object.area, it.size);

  /** Places of the images that meet the conditions, in order. One object must meet all conditions on objects. */
  const apply = (rows, it) => {
    const asksObjects = it.text || it.category || it.hidden !== null || it.size !== null;
    const found = rows.filter((row) => within(row.objects, it.objects) && (!asksObjects || row.of.some(meets(it))));
    if (it.order) {
      const value = new Map(found.map((row) => [row, orders[it.order](row)])), sign = it.descending ? -1 : 1;
      found.sort((a, b) => {
        const [x, y] = [value.get(a), value.get(b)];
        if (x === null || y === null) return (x === null) - (y === null) || a.at - b.at;
        return sign * (x - y) || a.at - b.at;
      });
    }
    return found;
  };

  let all = null;
  /** Reads the index, a few parts at a time. `progress` gets the number of images read so far. */
  const index = (progress = () => {}) => {
    all ??= (async () => {
      const parts = Math.ceil(facts.images / facts.per_folder), chunks = new Array(parts);
      let next = 0, read = 0;
      const work = async () => {
        while (next < parts) {
          const part = next++;
          const { texts, rows } = await syntable.get(`index/${part}`, false);
          chunks[part] = rows.map(([name, place, size, has_image, objects, faults, of], at) => {
            const known = of.map(([label, category, rate, area]) => ({ name: texts[label], category: texts[category], rate, area }));
            const rates = known.map((object) => object.rate).filter((rate) => rate !== null);
            const most = rates.length ? rates.reduce((a, b) => Math.max(a, b)) : null;
            return { at: part * facts.per_folder + at, name, place, size, has_image: has_image === 1, objects, faults, most, of: known };
          });
          read += chunks[part].length;
          progress(read);
        }
      };
      await Promise.all(Array.from({ length: AT_ONCE }, work));
      return chunks.flat();
    })();
    all.catch(() => { all = null; });
    return all;
  };

  let last = { key: null, rows: null };
  /** The rows that the address asks for; `null` if it asks for all images in their order. */
  const rows = async (progress) => {
    const it = wanted();
    if (!isActive(it)) return null;
    const read = await index(progress), key = JSON.stringify(it);
    if (last.key !== key) last = { key, rows: apply(read, it) };
    return last.rows;
  };

  /** The part of the address that holds conditions and order, to carry to another page. */
  const names = ["q", "class", ...ranges, "sort", "up"];
  const carried = (more = {}) => {
    const now = syntable.state(), out = new URLSearchParams(more);
    for (const name of [...names, "on"]) if (now.get(name) !== null) out.set(name, now.get(name));
    return `#${out}`;
  };

  /** Makes the form follow the address, and calls `changed` when the user changes it. */
  const form = (changed) => {
    const it = document.getElementById("filter"), field = (name) => it.elements.namedItem(name);
    const show = () => {
      const state = syntable.state();
      for (const name of ["q", "class", "sort"]) field(name).value = state.get(name) ?? "";
      field("up").setAttribute("aria-pressed", String(state.get("up") !== null));
      field("up").disabled = wanted().order === null;
      for (const name of ranges) {
        const [low, high] = (state.get(name) ?? "-").split("-");
        [field(`${name}-low`).value, field(`${name}-high`).value] = [low, high ?? ""];
      }
      field("clear").hidden = !isActive();
      document.getElementById("conditions").open ||= ranges.some((name) => wanted()[name] !== null);
    };
    const use = (up) => {
      const text = (name) => field(name).value.trim();
      const pair = (name) => {
        const [low, high] = [text(`${name}-low`), text(`${name}-high`)];
        return low || high ? `${low}-${high}` : null;
      };
      syntable.setState({
        q: text("q") || null, class: text("class") || null, sort: text("sort") || null, up: text("sort") && up ? 1 : null,
        ...Object.fromEntries(ranges.map((name) => [name, pair(name)])), page: null,
      });
      show();
      changed();
    };
    const isUp = () => field("up").getAttribute("aria-pressed") === "true";
    let timer = null;
    it.addEventListener("input", () => {
      clearTimeout(timer);
      timer = setTimeout(() => use(isUp()), 200);
    });
    it.addEventListener("submit", (event) => event.preventDefault());
    field("up").addEventListener("click", () => use(!isUp()));
    field("clear").addEventListener("click", () => {
      it.reset();
      use(false);
    });
    show();
    return { show };
  };

  return { wanted, isActive, apply, index, rows, carried, form };
})();
