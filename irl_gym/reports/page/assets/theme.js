"use strict";
// Light and dark: what the system asks for, until the button is pressed; remembered while the page is open, and no longer.

const DATA = JSON.parse(document.getElementById("data").textContent);
const system = window.matchMedia("(prefers-color-scheme: dark)");
const themed = []; // called with nothing after each change of colours

function isDark() {
  const asked = document.documentElement.dataset.theme;
  return asked ? asked === "dark" : system.matches;
}

function nameTheme() {
  document.getElementById("theme").textContent = isDark() ? "Light colours" : "Dark colours";
}

function setTheme() {
  nameTheme();
  themed.forEach((one) => one());
}

document.getElementById("theme").addEventListener("click", () => {
  document.documentElement.dataset.theme = isDark() ? "light" : "dark";
  setTheme();
});
system.addEventListener("change", setTheme);
nameTheme();

// A box that scrolls is a stop for the keyboard; one that does not is none. For the last few rows nobody has to scroll.
const FEW_MORE = 120; // pixels

function stops() {
  document.querySelectorAll(".scroll").forEach((box) => {
    box.classList.remove("more", "wide", "whole");
    if (box.scrollHeight <= box.clientHeight + FEW_MORE) box.classList.add("whole");
    const wide = box.scrollWidth > box.clientWidth + 1;
    const scrolls = wide || box.scrollHeight > box.clientHeight + 1;
    box.classList.toggle("more", scrolls);
    box.classList.toggle("wide", wide);
    if (scrolls) box.setAttribute("tabindex", "0");
    else box.removeAttribute("tabindex");
  });
}
window.addEventListener("resize", stops);
document.addEventListener("toggle", () => window.setTimeout(stops), true); // after what is opened was filled
stops();

document.querySelectorAll(".command").forEach((box) => {
  box.querySelector(".copy").addEventListener("click", async () => {
    const told = box.querySelector(".copied");
    const command = box.querySelector("pre");
    try {
      await navigator.clipboard.writeText(command.textContent);
      told.textContent = "Copied.";
    } catch {
      const range = document.createRange(); // from disk the clipboard may be closed: then the text is marked for the keyboard
      range.selectNodeContents(command);
      const marked = window.getSelection();
      marked.removeAllRanges();
      marked.addRange(range);
      told.textContent = "Marked: copy it with the keyboard.";
    }
  });
});

function element(kind, text, attributes = {}) {
  const made = document.createElement(kind);
  if (text !== undefined) made.textContent = text;
  Object.entries(attributes).forEach(([name, value]) => made.setAttribute(name, value));
  return made;
}

function tableOf(caption, headings, rows) {
  const table = element("table");
  table.append(element("caption", caption));
  const head = table.createTHead().insertRow();
  headings.forEach((one) => head.append(element("th", one, { scope: "col" })));
  const body = table.createTBody();
  rows.forEach((row) => {
    const line = body.insertRow();
    row.forEach((one, i) => line.append(i ? element("td", one) : element("th", one, { scope: "row" })));
  });
  return table;
}
