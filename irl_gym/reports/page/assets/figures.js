"use strict";
// Draws the figures of the page with Plotly. A colour "var(--name)" is the style sheet's, looked up at each change of colours.

// A finger scrolls the page; a mouse zooms in by drawing a frame, and back by a double click. Enlarged, both have buttons.
const FINE = window.matchMedia("(pointer: fine)");
const CONFIG = { displayModeBar: false, displaylogo: false, responsive: false, scrollZoom: false, doubleClick: "reset" };
const MOST_ROWS = 400;
const NARROW = 480;
const READABLE = 25; // pixels of a cell

function resolved(value, style) {
  if (typeof value === "string") {
    const found = /^var\((--[\w-]+)\)$/.exec(value);
    return found ? style.getPropertyValue(found[1]).trim() : value;
  }
  if (Array.isArray(value)) {
    const plainNumbers = value.every((one) => typeof one === "number" || one === null);
    return plainNumbers ? value : value.map((one) => resolved(one, style));
  }
  if (value && typeof value === "object") {
    return Object.fromEntries(Object.entries(value).map(([key, one]) => [key, resolved(one, style)]));
  }
  return value;
}

// An arrow along (down, right) from (row, column): a shaft and a head, in cells. Alone in its cell it stands in the middle.
function arrow(row, column, down, right, alone, size, x, y) {
  const length = Math.hypot(down, right);
  const [dy, dx] = [down / length, right / length];
  const [from, to] = alone ? [-0.32 * size, 0.34 * size] : [0.06 * size, 0.44 * size];
  const [shaft, head, back] = [0.035 * size, 0.12 * size, to - 0.19 * size];
  const corners = [[from, shaft], [back, shaft], [back, head], [to, 0], [back, -head], [back, -shaft], [from, -shaft], [from, shaft]];
  corners.forEach(([along, across]) => {
    x.push(column + along * dx - across * dy);
    y.push(row + along * dy + across * dx);
  });
  x.push(null);
  y.push(null);
}

// A dot for an action that stays: large where it is alone, else between the shafts of the others.
function dot(row, column, alone, size, x, y) {
  const radius = (alone ? 0.15 : 0.07) * size;
  for (let i = 0; i <= 16; i += 1) {
    x.push(column + radius * Math.cos((i * Math.PI) / 8));
    y.push(row + radius * Math.sin((i * Math.PI) / 8));
  }
  x.push(null);
  y.push(null);
}

// The outlines of all arrows, those of shaded cells apart: {plain: {x, y}, off: {x, y}}.
function outlines(drawn) {
  const [rows, columns] = drawn.shape;
  const made = { plain: { x: [], y: [] }, off: { x: [], y: [] } };
  for (let row = 0; row < rows; row += drawn.every) {
    for (let column = 0; column < columns; column += drawn.every) {
      const cell = row * columns + column;
      const taken = drawn.directions.map((_, a) => a).filter((a) => (drawn.sets[cell] >> a) & 1);
      const into = drawn.off[cell] ? made.off : made.plain;
      taken.forEach((a) => {
        const [down, right] = drawn.directions[a];
        const alone = taken.length === 1;
        if (down || right) arrow(row, column, down, right, alone, drawn.every, into.x, into.y);
        else dot(row, column, alone, drawn.every, into.x, into.y);
      });
    }
  }
  return made;
}

function heightOf(spec, width) {
  if (!spec.aspect) return spec.height;
  const inner = Math.max(width - 90, 120);
  return Math.round(Math.min(Math.max(inner * spec.aspect, 70), 620) + 46);
}

// In small cells letters shrink, and numbers that could not be read are left to the table of numbers.
function fitLetters(figure, width) {
  const map = figure.data.find((one) => one.name === "values" && one.z);
  const letters = figure.data.find((one) => one.name === "letters");
  if (!map && !letters) return;
  const columns = map ? map.z[0].length : figure.data[0].z[0].length;
  const cell = Math.max(width - 90, 120) / Math.max(columns, 1);
  if (letters) letters.textfont.size = Math.round(Math.min(Math.max(0.27 * cell, 7), 11));
  if (!map || !map.texttemplate) return;
  if (cell < READABLE) map.texttemplate = "";
  else if (map.text) fitNumbers(map, cell);
}

// Plotly's own fit makes all numbers as small as the longest would be in a wider font.
function fitNumbers(map, cell) {
  const longest = Math.max(...map.text.flat().map((one) => one.length), 3);
  map.texttemplate = "%{text}";
  map.textfont = { size: Math.min(cell / (0.62 * longest), 12) };
}

// A number in two digits, so that small ones beside large ones do not read 0.00: 0.13, 0.0015, 7e-4.
function short(value) {
  if (value === null) return "";
  const size = Math.abs(value);
  if (size >= 10 || value === 0) return String(Math.round(value));
  return size < 0.001 ? value.toExponential(0) : String(Number(value.toPrecision(2)));
}

// What a cell of a map is called where its place and number do not say it: the action, and of a field of a cell the cell.
function calledCells(spec, z) {
  if (spec.fields) {
    return z.map((row, r) => row.map((_, c) => [Math.floor(r / 3), Math.floor(c / 3), spec.fields[r % 3][c % 3]]));
  }
  return spec.actions ? z.map((row) => row.map((a) => [a === null ? "" : spec.actions[a]])) : undefined;
}

function drawFigure(name) {
  const box = document.getElementById(name);
  const spec = DATA.figures[name];
  const size = { width: box.clientWidth, height: heightOf(spec, box.clientWidth) };
  return drawInto(box, spec, { ...size, dragmode: FINE.matches ? "zoom" : false }, CONFIG);
}

function drawInto(box, spec, layout, config) {
  const { width, height } = layout;
  const figure = resolved({ data: spec.data, layout: spec.layout }, getComputedStyle(document.documentElement));
  if (spec.arrows) {
    const { plain, off } = outlines(spec.arrows);
    Object.assign(figure.data[1], plain);
    Object.assign(figure.data[2], off);
  }
  const map = figure.data.find((one) => one.name === "values" && one.z);
  if (map) map.customdata = calledCells(spec, map.z);
  if (map && spec.short) map.text = map.z.map((row) => row.map(short));
  fitLetters(figure, width);
  if (width < NARROW) {
    figure.layout.font = { ...figure.layout.font, size: 11 };
  }
  Object.assign(figure.layout, layout, { uirevision: "kept", autosize: false });
  box.style.height = `${height}px`;
  return Plotly.react(box, figure.data, figure.layout, config);
}

function drawAll() {
  return Promise.all(Object.keys(DATA.figures).map(drawFigure));
}

let waiting = 0;
let drawnAt = window.innerWidth;
window.addEventListener("resize", () => {
  if (window.innerWidth === drawnAt) return; // a phone's address bar comes and goes
  drawnAt = window.innerWidth;
  window.clearTimeout(waiting);
  waiting = window.setTimeout(drawAll, 150);
});
themed.push(drawAll);

// Paper is light: the style sheet sees to the page, and the figures are drawn again.
let worn;
window.addEventListener("beforeprint", () => {
  worn = document.documentElement.dataset.theme;
  document.documentElement.dataset.theme = "light";
  drawAll();
});
window.addEventListener("afterprint", () => {
  if (worn) document.documentElement.dataset.theme = worn;
  else delete document.documentElement.dataset.theme;
  drawAll();
});
window.drawn = drawAll();

// The numbers behind a figure, as a table that is made when it is opened.
function cellText(value) {
  return value === null || value === undefined ? "" : String(value);
}

function plain(text) {
  const line = String(text).replaceAll("<br>", " ");
  const made = new DOMParser().parseFromString(line, "text/html"); // undoes the escapes of plotted text
  return made.body.textContent;
}

function rowsOf(spec) {
  const map = spec.data.find((one) => one.name === "values");
  if (map) {
    const at = (axis, i) => (axis ? axis[i] : i);
    const heading = (axis, usual) => (axis.title && axis.title.text) || usual;
    const places = [heading(spec.layout.yaxis, "row"), heading(spec.layout.xaxis, "column")];
    const called = calledCells(spec, map.z);
    const rows = map.z.flatMap((row, r) => row.map((value, c) => {
      if (spec.fields) return [...called[r][c].slice(0, 2), plain(called[r][c][2]), value];
      const cell = [at(map.y, r), at(map.x, c)];
      if (value === null) return [...cell, null];
      return [...cell, spec.actions ? plain(called[r][c][0]) : value];
    }));
    const headings = spec.fields ? [...places, "action", "value"] : [...places, spec.actions ? "action" : "value"];
    if (spec.fields) rows.sort((one, other) => one[0] - other[0] || one[1] - other[1]); // the fields of a cell together
    return [headings, rows.filter((one) => one.at(-1) !== null)];
  }
  if (spec.arrows) {
    const columns = spec.arrows.shape[1];
    const words = (set) => spec.arrows.directions.map((d, a) => [d, a]).filter(([, a]) => (set >> a) & 1).map(([d]) => compass(d));
    const rows = spec.arrows.sets.map((set, cell) => [Math.floor(cell / columns), cell % columns, words(set).join(", "), spec.arrows.off[cell] ? "deviates" : ""]);
    return [["row", "column", "actions", ""], rows.filter((one) => one[2])];
  }
  const lines = spec.data.filter((one) => one.x && one.hoverinfo !== "skip");
  const horizontal = lines.some((one) => one.orientation === "h");
  const rows = lines.flatMap((one) => one.x.map((x, i) => {
    const name = one.text ? one.text[i] : one.name || "";
    return (horizontal ? [one.y[i], one.name || "", x] : [name, x, one.y[i]]).map((value) => (typeof value === "string" ? plain(value) : value));
  }));
  return [horizontal ? ["name", "of", "value"] : ["of", "x", "y"], rows];
}

function compass([down, right]) {
  return [["", "down", "up"].at(down), ["", "right", "left"].at(right)].filter(Boolean).join(" ") || "stay";
}

document.querySelectorAll("details.numbers").forEach((details) => {
  details.addEventListener("toggle", () => {
    if (!details.open) return;
    const spec = DATA.figures[details.dataset.of];
    const [headings, rows] = rowsOf(spec);
    const left = rows.length - MOST_ROWS;
    const caption = spec.title + (left > 0 ? `; ${left} more rows are left out` : "");
    const shown = rows.slice(0, MOST_ROWS).map((row) => row.map(cellText));
    details.querySelector(".scroll").replaceChildren(tableOf(caption, headings, shown));
  });
});
