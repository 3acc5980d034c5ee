"use strict";
// Selection of the text to copy, and of the sample that bars, slider and 3-D view share.
(() => {
  window.offerCopies(document);
  const offer = (selector, act) => {
    for (const button of document.querySelectorAll(selector)) {
      button.hidden = false;
      button.addEventListener("click", act);
    }
  };
  offer(".print", () => window.print());
  offer(".copy-answer", () => document.querySelector(".answer .copy:not([hidden]) button").click());

  const pickers = [...document.querySelectorAll(".picker")];
  // The format is selected for all transforms together, the direction for each.
  const pick = (kind) => {
    for (const picker of pickers) {
      const panes = [...picker.querySelectorAll(".copy")];
      const ways = picker.querySelector(".way");
      const own = panes.some((pane) => pane.dataset.kind === kind) ? kind : panes[0].dataset.kind;
      const way = ways ? ways.value : panes[0].dataset.way;
      const exact = panes.some((pane) => pane.dataset.kind === own && pane.dataset.way === way);
      picker.dataset.kind = own;
      for (const chip of picker.querySelectorAll(".chip")) chip.setAttribute("aria-pressed", chip.dataset.kind === own);
      for (const pane of panes) pane.hidden = pane.dataset.kind !== own || (exact && pane.dataset.way !== way);
    }
  };
  for (const picker of pickers) {
    const ways = picker.querySelector(".way");
    for (const chip of picker.querySelectorAll(".chip")) chip.addEventListener("click", () => pick(chip.dataset.kind));
    if (ways) ways.addEventListener("change", () => pick(picker.dataset.kind));
    picker.querySelector(".choices").hidden = false;
  }
  if (pickers.length) pick(pickers[0].querySelector(".chip").dataset.kind);

  document.addEventListener("scene", () => {
    const { samples, labels, opening } = JSON.parse(document.getElementById("scene-data").textContent);
    const slider = document.getElementById("sample");
    const output = document.querySelector(".slider output");
    const bars = [...document.querySelectorAll("[data-sample]")];
    const choose = (index) => {
      slider.value = index;
      window.showSample(index);
      const chosen = String(samples[index]);
      for (const bar of bars) bar.classList.toggle("chosen", bar.dataset.sample === chosen);
      output.textContent = `sample ${chosen}${index === opening && labels[index] ? ", the worst" : ""}${labels[index] ? " · " + labels[index] : ""}`;
    };
    const nearest = (sample) => samples.reduce((best, s, i) => Math.abs(s - sample) < Math.abs(samples[best] - sample) ? i : best, 0);
    for (const bar of bars) bar.addEventListener("click", () => choose(nearest(Number(bar.dataset.sample))));
    slider.addEventListener("input", () => choose(Number(slider.value)));
    choose(opening);
  });
})();
