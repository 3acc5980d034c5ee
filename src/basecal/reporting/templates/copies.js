"use strict";
// Buttons that copy text: those of boxes, and one after each command.
(() => {
  const copied = (text) => {
    const range = document.createRange();
    range.selectNodeContents(text);
    const selection = window.getSelection();
    selection.removeAllRanges();
    selection.addRange(range);
    return document.execCommand("copy");
  };
  const copies = (button, text) => {
    button.hidden = false;
    button.addEventListener("click", async () => {
      let done = copied(text);
      if (!done && navigator.clipboard) {
        done = await navigator.clipboard.writeText(text.textContent).then(() => true, () => false);
      }
      button.textContent = done ? "copied" : "selected";
      setTimeout(() => { button.textContent = "copy"; }, 1500);
    });
  };
  window.offerCopies = (part) => {
    for (const box of part.querySelectorAll(".copy")) copies(box.querySelector("button"), box.querySelector("pre"));
    for (const code of part.querySelectorAll(".do code")) {
      if (!code.textContent.startsWith("basecal ")) continue;
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = "copy";
      code.after(button);
      copies(button, code);
    }
  };
})();
