"use strict";
// Requests the state of the capture twice a second until it ends, and sends a stop.
(() => {
  const shown = {}; // number of the image of each camera
  let arms = ""; // as they are drawn
  const stop = document.querySelector(".stop"), lost = document.querySelector(".lost");
  const send = async () => {
    stop.disabled = true;
    const sent = await fetch("/stop", { method: "POST" }).then((answer) => answer.ok, () => false);
    stop.textContent = sent ? "Stop sent" : "Not sent. Use the emergency stop!";
    stop.disabled = sent;
  };
  stop.addEventListener("click", send);
  document.addEventListener("keydown", (event) => { if (event.key === "Escape" && !stop.disabled) send(); });
  const look = async () => {
    let over = false;
    try {
      const now = await (await fetch("/state")).json();
      window.putParts(now.html);
      if (window.moveArms && arms !== (arms = JSON.stringify(now.arms))) window.moveArms(now.arms);
      for (const [camera, number] of Object.entries(now.images)) {
        if (shown[camera] === number) continue;
        shown[camera] = number;
        const image = await (await fetch(`/image?camera=${encodeURIComponent(camera)}`)).text();
        document.querySelector(`[data-camera="${CSS.escape(camera)}"]`).innerHTML = image;
      }
      over = now.over;
      lost.hidden = true;
    } catch {
      lost.hidden = false;
    }
    if (!over) setTimeout(look, 500);
  };
  look();
})();
