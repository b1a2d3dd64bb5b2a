"use strict";
/* The slider, the toggles and the read-out of report.html. Texts are in the page; this only shows, hides and
   fills in numbers. */
(() => {
  const all = (selector) => [...document.querySelectorAll(selector)];
  const one = (selector) => document.querySelector(selector);
  const chosen = (name) => one(`input[name="${name}"]:checked`)?.value;
  const depths = all("#look .depth").map((span) => span.textContent);
  const slide = one("#plane"), compare = one("#compare");
  let wanted = slide ? Number(slide.value) : 0;  // the chosen plane, at which the points may be unknown
  let plane = wanted;

  /* Planes at which the chosen points are known; all of them without a choice. */
  const planesOf = (points) => {
    const known = all(`.kept[data-points="${points}"]`).map((image) => Number(image.dataset.plane));
    return points === "all" ? depths.map((_, number) => number) : known.sort((a, b) => a - b);
  };
  const nearest = (planes) => planes.reduce((best, other) =>
    Math.abs(depths[other] - depths[wanted]) < Math.abs(depths[best] - depths[wanted]) ? other : best);

  const show = () => {
    const light = chosen("light") ?? "0", points = chosen("points") ?? "all";
    const planes = planesOf(points);
    plane = nearest(planes);
    const hasComparison = one(`.compared[data-points="${points}"]`) !== null;
    const isCompared = hasComparison && compare.checked;
    for (const image of all("#look .light, #look .kept, #look .compared")) {
      const here = Number(image.dataset.plane) === plane;
      const mine = image.dataset.points === points;
      if (image.className === "light") image.hidden = !here || image.dataset.light !== light;
      if (image.className === "kept") image.hidden = !here || !mine || isCompared;
      if (image.className === "compared") image.hidden = !here || !mine || !isCompared;
    }
    if (compare) compare.disabled = !hasComparison;
    if (slide) {
      slide.max = planes.length - 1;
      slide.value = planes.indexOf(plane);
      slide.disabled = planes.length < 2;
      slide.setAttribute("aria-valuetext", `${depths[plane]} mm`);
      one("#depth-shown").textContent = `${depths[plane]} mm`;
    }
    for (const button of all(".jumps button")) {
      button.setAttribute("aria-pressed", String(Number(button.dataset.plane) === plane));
    }
    one("#shown").textContent = all("#look .frame img").filter((image) => !image.hidden)
      .map((image) => image.alt).join(", ");
    read();
  };

  /* Maps of numbers: code c > 0 of two bytes, the lower first, stands for origin + (c - 1) step. */
  const maps = {};
  for (const { dataset } of all("#look .map")) {
    const text = atob(dataset.values);
    maps[dataset.name] = (block) => {
      const code = text.charCodeAt(2 * block) + 256 * text.charCodeAt(2 * block + 1);
      return code ? Number(dataset.origin) + (code - 1) * Number(dataset.step) : null;
    };
  }
  const names = all("#look .name").map((span) => span.textContent);
  const blocks = Object.fromEntries(
    Object.entries(one("#blocks").dataset).map(([name, text]) => [name, Number(text)]));
  let place = null;  // row and column in the crop, in pixels

  const length = (value) => value === null ? null : `${value.toFixed(blocks.digits)} mm`;
  const read = () => {
    if (place === null) return;
    const [row, col] = place;
    const block = Math.floor(row / blocks.step) * Math.ceil(blocks.width / blocks.step)
      + Math.floor(col / blocks.step);
    const value = (name) => maps[name] ? maps[name](block) : null;
    const estimate = value("estimate"), truth = value("truth");
    const error = estimate === null || truth === null ? null : estimate - truth;
    const here = value(`plane${plane}`);
    const texts = {
      pixel: `${blocks.top + row}, ${blocks.left + col}`,
      estimate: length(estimate) ?? "none",
      confidence: value("confidence")?.toFixed(2),
      truth: length(truth) ?? "nothing there",
      error: error === null ? "–" : (error < 0 ? "−" : "+") + length(Math.abs(error)),
      object: names[value("object") ?? 0],
      counts: here?.toFixed(0),
    };
    for (const field of all(".readout dd")) field.textContent = texts[field.dataset.read] ?? "–";
    for (const cross of all(".frame i")) {
      cross.hidden = false;
      cross.style.left = `${100 * (col + 0.5) / blocks.width}%`;
      cross.style.top = `${100 * (row + 0.5) / blocks.height}%`;
    }
  };
  const clamp = (value, size) => Math.min(Math.max(value, 0), size - 1);
  const point = (row, col) => {
    place = [clamp(row, blocks.height), clamp(col, blocks.width)];
    read();
  };
  /* What a screen reader says after a key: the read-out as a sentence. */
  const say = (frame) => {
    const readout = all(".readout").find((list) =>
      frame.compareDocumentPosition(list) & Node.DOCUMENT_POSITION_FOLLOWING);
    one("#said").textContent = [...readout.querySelectorAll("div")]
      .map((pair) => `${pair.children[0].textContent} ${pair.children[1].textContent}`).join("; ");
  };
  const moves = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] };

  for (const frame of all(".frame")) {
    const follow = (event) => {
      const box = frame.getBoundingClientRect();
      point(Math.floor((event.clientY - box.top) / box.height * blocks.height),
            Math.floor((event.clientX - box.left) / box.width * blocks.width));
    };
    frame.addEventListener("pointermove", follow);
    frame.addEventListener("pointerdown", follow);
    frame.addEventListener("keydown", (event) => {
      const move = moves[event.key];
      if (!move) return;
      event.preventDefault();
      const far = blocks.step * (event.shiftKey ? 10 : 1);
      const [row, col] = place ?? [blocks.height >> 1, blocks.width >> 1];
      point(row + far * move[0], col + far * move[1]);
      say(frame);
    });
  }
  slide?.addEventListener("input", () => {
    wanted = planesOf(chosen("points") ?? "all")[Number(slide.value)];
    show();
  });
  for (const button of all(".jumps button")) {
    button.addEventListener("click", () => { wanted = Number(button.dataset.plane); show(); });
  }
  for (const input of all(".controls input:not(#plane)")) input.addEventListener("change", show);
  for (const part of all(".controls, .readout")) part.hidden = false;
  show();
})();
