"use strict";
/* The slider and the toggles of report.html. Texts are in the page; this only shows and hides. */
(() => {
  const all = (selector) => [...document.querySelectorAll(selector)];
  const one = (selector) => document.querySelector(selector);
  const chosen = (name) => one(`input[name="${name}"]:checked`)?.value;
  const depths = all("#look .depth").map((span) => span.textContent);
  const slide = one("#plane"), compare = one("#compare");
  let wanted = slide ? Number(slide.value) : 0;  // the chosen plane, at which the points may be unknown

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
    const plane = nearest(planes);
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
  };

  slide?.addEventListener("input", () => {
    wanted = planesOf(chosen("points") ?? "all")[Number(slide.value)];
    show();
  });
  for (const button of all(".jumps button")) {
    button.addEventListener("click", () => { wanted = Number(button.dataset.plane); show(); });
  }
  for (const input of all(".controls input:not(#plane)")) input.addEventListener("change", show);
  for (const part of all(".controls")) part.hidden = false;
  show();
})();
