"""Faults of a page in a browser: cut text, and violations that axe-core finds, if it is available."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from tests.shared.browser import Tab

SIZES = ((1400, 900), (820, 1000), (375, 812))  # of windows [px]
SCHEMES = ("light", "dark")
_SMALLEST_PX = 9.0  # of letters in a drawing

_CUT = f"""(() => {{
  const found = new Set(), short = (element) => element.textContent.trim().slice(0, 60);
  for (const each of document.querySelectorAll("body *")) {{
    if (each.closest("svg") || !each.offsetParent) continue;
    if (![...each.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim())) continue;
    const style = getComputedStyle(each), box = each.getBoundingClientRect();
    if (style.clipPath === "none" && style.overflowX === "hidden" && each.scrollWidth > each.clientWidth + 1)
      found.add(`cut: ${{short(each)}}`);
    if (box.right > innerWidth + 1 && !each.closest(".scroll, pre")) found.add(`beyond the window: ${{short(each)}}`);
  }}
  for (const table of document.querySelectorAll(".scroll:has(.numbers)"))
    if (table.scrollWidth > table.clientWidth + 1) found.add(`numbers that scroll: ${{short(table)}}`);
  for (const drawing of document.querySelectorAll("svg")) {{
    const frame = drawing.getBoundingClientRect();
    const labels = [...drawing.querySelectorAll("text")].filter((each) => each.getClientRects().length);
    const boxes = labels.map((each) => each.getBoundingClientRect());
    labels.forEach((each, k) => {{
      const box = boxes[k];
      if (box.left < frame.left - 1 || box.right > frame.right + 1 || box.bottom > frame.bottom + 2)
        found.add(`leaves its drawing: ${{short(each)}}`);
      if (box.height < {_SMALLEST_PX}) found.add(`small: ${{short(each)}}`);
      boxes.slice(0, k).forEach((other, i) => {{
        const width = Math.min(box.right, other.right) - Math.max(box.left, other.left);
        const height = Math.min(box.bottom, other.bottom) - Math.max(box.top, other.top);
        if (width > 2 && height > 4) found.add(`one on another: ${{short(labels[i])}}, ${{short(each)}}`);
      }});
    }});
  }}
  if (document.documentElement.scrollWidth > innerWidth + 1) found.add("the page scrolls sideways");
  return [...found];
}})()"""

_RUN_AXE = """axe.run(document, { resultTypes: ["violations"] }).then((found) => found.violations.map(
  (each) => `axe ${each.id}: ${each.help}: ${each.nodes.map((node) => node.target.join(" ")).join(", ")}`))"""


def shown_sizes(tab: Tab, address: str, selector: str = "body") -> Iterator[str]:
    """Load a page at each size, light and dark, and yield a name for each."""
    for width, height in SIZES:
        for scheme in SCHEMES:
            tab.resize(width, height, scheme)
            tab.go(address, selector)
            yield f"{width}_{scheme}"


def faults(tab: Tab, axe: Path | None = None) -> Sequence[str]:
    """Faults of the page in a tab; `axe` is the file of axe-core."""
    messages = [*tab.value(_CUT), *(f"console: {error}" for error in tab.visit.errors)]
    messages += [f"asks for {one}" for one in tab.visit.requests if one.startswith("http") and "127.0.0.1" not in one]
    if axe is not None:
        tab.value(axe.read_text(encoding="utf-8"))
        messages += tab.value(_RUN_AXE)
    return messages
