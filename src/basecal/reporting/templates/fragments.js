"use strict";
// Parts of a page that the server renders again: each replaces the current part if it differs.
const put = {}; // as rendered by the server, without the added buttons
window.putParts = (html) => {
  const made = document.createElement("template");
  made.innerHTML = html;
  for (const part of made.content.querySelectorAll("[data-part]")) {
    const name = part.dataset.part, place = document.querySelector(`main [data-part="${name}"]`);
    if (!place || put[name] === part.innerHTML) continue;
    place.innerHTML = put[name] = part.innerHTML;
    if (window.offerCopies) window.offerCopies(place);
  }
};
