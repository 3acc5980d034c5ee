"use strict";
// Buttons that copy, and the choice of a sample, which the bars, the slider and the 3-D picture share.
(() => {
  const copied = (pre) => {
    const range = document.createRange();
    range.selectNodeContents(pre);
    const selection = window.getSelection();
    selection.removeAllRanges();
    selection.addRange(range);
    return document.execCommand("copy");
  };
  for (const box of document.querySelectorAll(".copy")) {
    const button = box.querySelector("button");
    button.hidden = false;
    button.addEventListener("click", () => {
      button.textContent = copied(box.querySelector("pre")) ? "copied" : "selected";
      setTimeout(() => { button.textContent = "copy"; }, 1500);
    });
  }

  const show = window.showSample;
  if (!show) return;
  const samples = JSON.parse(document.getElementById("scene-data").textContent).samples;
  const slider = document.getElementById("sample");
  const output = document.querySelector(".slider output");
  const bars = [...document.querySelectorAll("[data-sample]")];
  const choose = (index) => {
    slider.value = index;
    show(index);
    const chosen = String(samples[index]);
    const values = [];
    for (const bar of bars) {
      const own = bar.dataset.sample === chosen;
      bar.classList.toggle("chosen", own);
      if (own) values.push(bar.querySelector("title").textContent.split(": ").pop());
    }
    output.textContent = `${chosen}${values.length ? ": " + values.join(", ") : ""}`;
  };
  const nearest = (sample) => samples.reduce((best, s, i) => Math.abs(s - sample) < Math.abs(samples[best] - sample) ? i : best, 0);
  for (const bar of bars) bar.addEventListener("click", () => choose(nearest(Number(bar.dataset.sample))));
  slider.addEventListener("input", () => choose(Number(slider.value)));
  choose(Math.floor(samples.length / 2));
})();
