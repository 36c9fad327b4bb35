"use strict";
// A figure as large as the window, by a button: Plotly's own are drawn again with its buttons for zooming, pictures are shown.

const BUTTONS = ["zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"];
const LARGE = { displayModeBar: true, displaylogo: false, scrollZoom: true, doubleClick: "reset", modeBarButtons: [BUTTONS] };

(() => {
  const dialog = document.getElementById("enlarged");
  const stage = dialog.querySelector(".large");
  const title = dialog.querySelector("h2");
  let shown = null; // name of the figure of Plotly, if it is one

  function draw() {
    if (!shown) return undefined;
    const spec = DATA.figures[shown];
    const [width, height] = [stage.clientWidth, Math.max(stage.clientHeight, 240)];
    const muted = getComputedStyle(document.documentElement).getPropertyValue("--muted");
    const modebar = { bgcolor: "rgba(0,0,0,0)", color: muted, activecolor: muted };
    const margin = { ...spec.layout.margin, t: (spec.layout.margin.t || 0) + 34 }; // room for the buttons
    return drawInto(stage.firstElementChild, spec, { width, height, margin, modebar, dragmode: "zoom" }, LARGE);
  }

  // The buttons of Plotly are no stops for the keyboard by themselves.
  function reached() {
    stage.querySelectorAll(".modebar-btn").forEach((one) => {
      one.setAttribute("tabindex", "0");
      one.setAttribute("role", "button");
      if (one.dataset.title) one.setAttribute("aria-label", one.dataset.title);
    });
  }

  stage.addEventListener("keydown", (event) => {
    const button = event.target.closest(".modebar-btn");
    if (!button || !["Enter", " "].includes(event.key)) return;
    event.preventDefault();
    button.dispatchEvent(new MouseEvent("click", { bubbles: true }));
  });

  function open(name, said, picture) {
    title.textContent = said;
    stage.replaceChildren(picture || element("div"));
    stage.classList.toggle("stage", Boolean(picture));
    shown = picture ? null : name;
    dialog.showModal();
    Promise.resolve(draw()).then(reached);
  }

  document.querySelectorAll("button.enlarge").forEach((button) => {
    button.addEventListener("click", () => {
      const { of } = button.dataset;
      const player = document.getElementById(of).closest(".player");
      const said = document.getElementById(`${of}-title`).textContent;
      open(of, said, player && player.querySelector(".stage").firstElementChild.cloneNode(true));
    });
  });
  dialog.querySelector("button").addEventListener("click", () => dialog.close());
  dialog.addEventListener("click", (event) => { if (event.target === dialog) dialog.close(); });
  dialog.addEventListener("close", () => {
    if (shown) Plotly.purge(stage.firstElementChild);
    stage.replaceChildren();
    shown = null;
  });
  window.addEventListener("resize", draw);
})();
