// Light or dark: what the system says, until the switch says otherwise.
"use strict";
// A token in the address of `syntable view` has become a cookie: it need not stay in sight.
if (location.search) history.replaceState(null, "", location.pathname + location.hash);
{
  const names = ["system", "light", "dark"];
  const stored = () => {
    try { return localStorage.getItem("syntable-theme"); } catch { return null; }
  };
  const apply = (name) => {
    if (name === "light" || name === "dark") document.documentElement.dataset.theme = name;
    else delete document.documentElement.dataset.theme;
  };
  apply(stored());
  // An image that is not there leaves its place to labels.
  document.addEventListener("error", ({ target }) => {
    if (target instanceof HTMLImageElement && target.closest(".frame")) {
      target.hidden = true;
      target.closest(".frame").classList.add("bare");
    }
  }, true);
  document.addEventListener("DOMContentLoaded", () => {
    const choice = document.getElementById("theme");
    choice.value = names.includes(stored()) ? stored() : "system";
    choice.addEventListener("change", () => {
      apply(choice.value);
      try { localStorage.setItem("syntable-theme", choice.value); } catch { /* The choice holds for this page. */ }
    });
  });
}
