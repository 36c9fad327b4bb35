"use strict";
// Players of episodes: pictures, a token on the map, or the words of each moment.

(() => {
  const SVG = "http://www.w3.org/2000/svg";

  function shape(kind, attributes, text) {
    const made = document.createElementNS(SVG, kind);
    Object.entries(attributes).forEach(([name, value]) => made.setAttribute(name, value));
    if (text) made.textContent = text;
    return made;
  }

  function onMap(stage, map, moments) {
    const [rows, columns] = map.shape;
    const svg = shape("svg", { viewBox: `0 0 ${columns} ${rows}`, "aria-hidden": "true" });
    map.blocked.forEach((blocked, cell) => {
      const [row, column] = [Math.floor(cell / columns), cell % columns];
      const letter = map.letters[cell];
      svg.append(shape("rect", { x: column, y: row, width: 1, height: 1, class: `cell ${blocked ? "blocked" : letter}` }));
      if (letter) svg.append(shape("text", { x: column + 0.5, y: row + 0.5 }, letter));
    });
    const spot = (moment) => [(moment.cell % columns) + 0.5, Math.floor(moment.cell / columns) + 0.5];
    const trail = shape("polyline", { class: "trail", points: "" });
    const token = shape("circle", { class: "token", r: 0.28 });
    svg.append(trail, token);
    stage.append(svg);
    const stays = moments.map((moment, i) => (moment.cell === undefined ? null : i)).reduce((known, i) => known.concat(i ?? known.at(-1) ?? 0), []);
    return (at) => {
      const [x, y] = spot(moments[stays[at]]);
      token.style.transform = `translate(${x}px, ${y}px)`;
      const seen = moments.slice(0, at + 1).filter((one) => one.cell !== undefined);
      trail.setAttribute("points", seen.map((one) => spot(one).join(",")).join(" "));
    };
  }

  function withPictures(stage, pictures, moments) {
    const image = document.createElement("img");
    image.alt = "The environment at the start";
    stage.append(image);
    const shown = moments.reduce((known, one) => known.concat(one.picture ?? known.at(-1) ?? 0), []);
    return (at) => {
      const next = pictures[Math.min(shown[at], pictures.length - 1)];
      if (image.src !== next) image.src = next;
      image.alt = `The environment: ${moments[at].text}`;
    };
  }

  function inWords(stage, moments) {
    const words = element("p", "", { class: "words" });
    stage.append(words);
    return (at) => { words.textContent = moments[at].text; };
  }

  function sentence(moment, at, last) {
    const where = `Step ${at} of ${last}: ${moment.text}`;
    if (at === 0) return `Step 0 of ${last}, the start: ${moment.text}.`;
    return `${where}, after ${moment.action}. Paid ${moment.pay}, ${moment.total} so far${moment.learnedTotal && `; by the learned reward ${moment.learned}, ${moment.learnedTotal} so far`}.`;
  }

  function play(film) {
    const box = document.getElementById(`player-${film.name}`);
    const [stage, told, position] = [".stage", ".moment", ".position"].map((one) => box.querySelector(one));
    const button = box.querySelector("[data-do=play]");
    const { moments } = film;
    const last = moments.length - 1;
    const draw = film.pictures.length ? withPictures(stage, film.pictures, moments)
      : film.map ? onMap(stage, film.map, moments) : inWords(stage, moments);
    const steps = box.querySelector("details.steps");
    const title = box.querySelector("h3").textContent;
    let [at, timer] = [0, 0];

    function mark() {
      const table = steps.querySelector("table");
      if (!table) return;
      table.querySelectorAll("tr.now").forEach((one) => one.classList.remove("now"));
      const row = table.tBodies[0].rows[at];
      row.classList.add("now");
      const pane = table.parentElement;
      pane.scrollTop = row.offsetTop - pane.offsetTop - pane.clientHeight / 2;
    }

    function go(to) {
      at = Math.min(Math.max(to, 0), last);
      draw(at);
      told.textContent = sentence(moments[at], at, last);
      stage.setAttribute("aria-label", `${title}: ${moments[at].text}`);
      position.value = String(at);
      position.setAttribute("aria-valuetext", `step ${at} of ${last}`);
      if (at === last) stop();
      mark();
    }

    function stop() {
      window.clearInterval(timer);
      timer = 0;
      button.textContent = "Play";
      button.setAttribute("aria-label", `${title}: play`);
      told.setAttribute("aria-live", "polite");
    }

    function start() {
      if (at === last) go(0);
      const speed = Number(box.querySelector("[data-do=speed]").value);
      timer = window.setInterval(() => go(at + 1), 1000 / speed);
      button.textContent = "Pause";
      button.setAttribute("aria-label", `${title}: pause`);
      told.setAttribute("aria-live", "off"); // read out a step at a time, not a film
    }

    const actions = {
      play: () => (timer ? stop() : start()),
      first: () => { stop(); go(0); },
      back: () => { stop(); go(at - 1); },
      forward: () => { stop(); go(at + 1); },
    };
    Object.entries(actions).forEach(([name, act]) => box.querySelector(`[data-do=${name}]`).addEventListener("click", act));
    position.addEventListener("input", () => { stop(); go(Number(position.value)); });
    box.querySelector("[data-do=speed]").addEventListener("change", () => {
      if (timer) { stop(); start(); }
    });
    steps.addEventListener("toggle", () => {
      if (!steps.open || steps.querySelector("table")) return;
      const paid = moments.some((one) => one.learnedTotal); // there is no learned reward of a learner of policies
      const rows = moments.map((one, i) =>
        [String(i), one.action, one.text, one.pay, one.total, one.learned, one.learnedTotal].slice(0, paid ? 7 : 5));
      const headings = ["step", "action", "leads to", "true reward", "so far", "learned reward", "so far"].slice(0, paid ? 7 : 5);
      steps.querySelector(".scroll").append(tableOf(`Steps of the ${title.toLowerCase()}`, headings, rows));
      mark();
    });
    if (!film.pictures.length && !film.map) steps.open = true;
    go(0);
  }

  ((DATA.episodes && DATA.episodes.players) || []).forEach(play);
})();
