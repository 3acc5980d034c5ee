"use strict";
// Parts of a page that the program which serves it renders anew: each replaces what is there if it differs.
window.putParts = (html) => {
  const made = document.createElement("template");
  made.innerHTML = html;
  for (const part of made.content.querySelectorAll("[data-part]")) {
    const place = document.querySelector(`main [data-part="${part.dataset.part}"]`);
    if (place && place.innerHTML !== part.innerHTML) place.innerHTML = part.innerHTML;
  }
};
