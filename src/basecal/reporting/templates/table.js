"use strict";
// A table that is sorted by a click on a column's heading, and filtered by typed text.
(() => {
  const table = document.querySelector(".sortable"), body = table.tBodies[0], rows = [...body.rows];
  const filter = document.querySelector(".filter input");
  filter.closest(".filter").hidden = false;
  filter.addEventListener("input", () => {
    const wanted = filter.value.toLowerCase();
    for (const row of rows) row.hidden = !row.textContent.toLowerCase().includes(wanted);
  });
  [...table.tHead.rows[0].cells].forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = head.textContent;
    head.replaceChildren(button);
    button.addEventListener("click", () => {
      const up = head.getAttribute("aria-sort") !== "ascending";
      for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      const text = (row) => row.cells[column].textContent;
      const order = (a, b) => {
        const [x, y] = [a, b].map((row) => parseFloat(text(row)));
        return isNaN(x) || isNaN(y) ? text(a).localeCompare(text(b)) : x - y;
      };
      body.append(...rows.sort((a, b) => (up ? 1 : -1) * order(a, b)));
    });
  });
})();
