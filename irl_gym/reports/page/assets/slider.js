"use strict";
// The lambda slider: puts the reward, the policy and the margins of one piece into the figures of its section.

(() => {
  const path = DATA.slider;
  const range = document.getElementById("lambda-range");
  if (!path || !range) return;
  const told = document.getElementById("lambda-told");
  let pending = false;

  function put(name, changing, i) {
    const spec = DATA.figures[name];
    const value = changing.values[i];
    if (changing.kind === "z") spec.data[changing.trace].z = value;
    if (changing.kind === "x") spec.data[changing.trace].x = value;
    if (changing.ends) scale(spec, changing, changing.ends[i]);
    if (changing.kind === "arrows") spec.arrows.sets = value;
    if (changing.kind === "cursor") Object.assign(spec.layout.shapes[0], { x0: value, x1: value });
    spec.layout.datarevision = i;
  }

  function scale(spec, changing, [low, high]) {
    if (changing.kind === "z") Object.assign(spec.data[changing.trace], { zmin: low, zmax: high });
    else spec.layout.xaxis.range = [low, high];
  }

  function tell(i) {
    const piece = path.pieces[i];
    Object.entries(piece).forEach(([key, text]) => {
      const place = told.querySelector(`[data-key="${key}"]`);
      if (place.textContent !== text) place.textContent = text;
    });
    range.setAttribute("aria-valuetext", `lambda ${piece.span}, piece ${piece.number}`);
  }

  function show() {
    pending = false;
    const i = Number(range.value);
    Object.entries(path.figures).forEach(([name, changing]) => {
      put(name, changing, i);
      drawFigure(name);
    });
    refreshTables();
  }

  function refreshTables() {
    Object.keys(path.figures).forEach((name) => {
      const details = document.querySelector(`details[data-of="${name}"]`);
      if (details && details.open) details.dispatchEvent(new Event("toggle"));
    });
  }

  range.addEventListener("input", () => {
    tell(Number(range.value));
    if (pending) return; // one drawing a frame, of the newest position
    pending = true;
    window.requestAnimationFrame(show);
  });
  range.value = String(path.start);
  tell(path.start);
  window.drawn.then(show);
})();
