"use strict";
// Selected and excluded samples; the page always requests the whole selection, and uses only the latest answer.
(() => {
  const run = document.querySelector(".run"), slider = document.querySelector(".slider input");
  const lost = document.querySelector(".lost");
  const exclude = document.querySelector(".exclude");
  const chips = [...document.querySelectorAll(".samples .chip")];
  const numbers = chips.map((chip) => chip.dataset.number);
  const without = new Set();
  const chosen = () => numbers[Number(slider.value)];
  const latest = {}; // latest request by path
  const ask = async (path, more) => {
    const query = new URLSearchParams({ run: run.value, without: [...without].join(","), ...more });
    const asked = (latest[path] = `${path}?${query}`);
    const [ok, text] = await fetch(asked).then(async (answer) => [answer.ok, await answer.text()], () => [false, "basecal view has ended."]);
    if (latest[path] !== asked) return;
    lost.hidden = ok;
    if (ok) window.putParts(text);
    else lost.textContent = text;
    mark();
  };
  const mark = () => {
    for (const chip of chips) chip.setAttribute("aria-pressed", !without.has(chip.dataset.number));
    for (const bar of document.querySelectorAll("[data-sample]")) bar.classList.toggle("chosen", bar.dataset.sample === chosen());
    exclude.textContent = without.has(chosen()) ? "take again" : "exclude";
  };
  const look = () => { mark(); if (numbers.length) ask("/sample", { number: chosen() }); };
  const toggle = (number) => {
    if (!without.delete(number)) without.add(number);
    ask("/answer");
    look();
  };
  const choose = (place) => { slider.value = place; look(); };
  run.addEventListener("change", () => { ask("/answer"); look(); });
  slider.addEventListener("input", look);
  exclude.addEventListener("click", () => toggle(chosen()));
  for (const chip of chips) chip.addEventListener("click", () => toggle(chip.dataset.number));
  for (const step of document.querySelectorAll("[data-step]")) {
    step.addEventListener("click", () => choose(Number(slider.value) + Number(step.dataset.step)));
  }
  document.querySelector('[data-part="residuals"]').addEventListener("click", (event) => {
    const bar = event.target.closest("[data-sample]");
    if (bar) choose(numbers.indexOf(bar.dataset.sample));
  });
  ask("/answer");
  look();
})();
