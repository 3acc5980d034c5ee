"use strict";
// Parts of a page that the program which serves it renders anew: each replaces what is there if it differs.
const put = {}; // as the program rendered them: buttons are added to what is shown
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
