"use strict";
// The token has become a cookie: it need not stay in sight.
if (location.search) history.replaceState(null, "", location.pathname + location.hash);
const at = id => document.getElementById(id);
let version = Number(document.documentElement.dataset.version);
function say(id, text) {
  const element = at(id);
  if (element.textContent !== text) element.textContent = text;
  if (element.tagName === "PRE") element.hidden = text === "";
}
/** Shows what is new, and returns whether the image of it is there. */
async function show(state) {
  let isThere = true;
  if (!state.mistakes && state.version > 0) {
    // The new image takes the place of the old one when it is there as a whole.
    const next = new Image();
    next.src = "sheet.png?version=" + state.version;
    try { await next.decode(); } catch { isThere = false; }
    if (isThere) {
      const sheet = at("sheet");
      next.id = "sheet";
      next.alt = state.alt;
      next.className = sheet.className;
      sheet.replaceWith(next);
    }
  } else {
    at("sheet").hidden = true;
  }
  document.title = (state.mistakes ? "✗ " : "") + state.title;
  say("title", state.title);
  say("status", state.status);
  say("mistakes", state.mistakes);
  say("warnings", state.warnings);
  return isThere;
}
async function follow() {
  for (;;) {
    try {
      const answer = await fetch("changes?after=" + version);
      // Another preview has this port now, with an address of its own.
      if (answer.status === 403) return say("status", "This preview has ended. Open the new address that the terminal shows.");
      const news = await answer.json();
      if (news.version !== version) {
        const state = await (await fetch("state.json")).json();
        // An image that was not there as a whole is asked for again.
        if (await show(state)) version = state.version;
        else await new Promise(done => setTimeout(done, 300));
      }
    } catch {
      say("status", "the preview has ended, or cannot be reached");
      await new Promise(done => setTimeout(done, 1000));
      // The state is asked for again, which replaces this status.
      version = 0;
    }
  }
}
function resize() {
  const is = at("sheet").classList.toggle("actual");
  at("size").setAttribute("aria-pressed", String(is));
}
at("size").addEventListener("click", resize);
document.addEventListener("keydown", event => {
  if (event.key === "z" && !event.ctrlKey && !event.metaKey && !event.altKey) resize();
});
follow();
