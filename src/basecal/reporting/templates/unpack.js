"use strict";
// Unpacks and runs the script of the scene after the page is painted; otherwise the still image remains.
window.addEventListener("load", () => setTimeout(async () => {
  if (!window.DecompressionStream) return;
  const packed = atob(document.getElementById("scene-script").textContent);
  const bytes = new Blob([Uint8Array.from(packed, (letter) => letter.charCodeAt(0))]);
  const script = document.createElement("script");
  script.textContent = await new Response(bytes.stream().pipeThrough(new DecompressionStream("gzip"))).text();
  document.body.append(script);
}));
