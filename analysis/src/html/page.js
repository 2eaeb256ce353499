// Zoom of figures: Ctrl and mouse wheel (or pinch) zoom at the pointer, double click zooms in, drag moves a zoomed figure, Escape or Shift and double click
// reset. A click on the animation pauses it.
for (const svg of document.querySelectorAll("figure svg")) {
  if (svg.classList.contains("walk")) {
    svg.addEventListener("click", () => (svg.animationsPaused() ? svg.unpauseAnimations() : svg.pauseAnimations()));
    continue;
  }
  const whole = svg.getAttribute("viewBox").split(" ").map(Number);
  let view = whole.slice();
  let grip = null;
  const show = () => {
    svg.setAttribute("viewBox", view.join(" "));
    svg.parentElement.classList.toggle("zoomed", view[2] < whole[2]);
  };
  const at = (event) => {
    const box = svg.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  };
  const zoom = (event, factor) => {
    const [x, y] = at(event);
    const width = Math.min(whole[2], Math.max(whole[2] / 60, view[2] * factor));
    const height = (width * whole[3]) / whole[2];
    view = [view[0] + x * (view[2] - width), view[1] + y * (view[3] - height), width, height];
    if (width === whole[2]) view = whole.slice();
    show();
  };
  svg.addEventListener("wheel", (event) => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    zoom(event, Math.exp(event.deltaY * 0.004));
  }, { passive: false });
  svg.addEventListener("dblclick", (event) => {
    if (event.shiftKey) { view = whole.slice(); show(); } else zoom(event, 0.5);
  });
  svg.addEventListener("pointerdown", (event) => {
    if (view[2] === whole[2]) return;
    grip = [at(event), view.slice()];
    svg.setPointerCapture(event.pointerId);
  });
  svg.addEventListener("pointermove", (event) => {
    if (!grip) return;
    const [x, y] = at(event);
    view = [grip[1][0] - (x - grip[0][0]) * view[2], grip[1][1] - (y - grip[0][1]) * view[3], view[2], view[3]];
    show();
  });
  svg.addEventListener("pointerup", () => { grip = null; });
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape") { view = whole.slice(); show(); }
  });
}
