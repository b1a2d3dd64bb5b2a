"use strict";
/* The slider of report.html: it shows the section at the chosen depth. */
(() => {
  const slide = document.querySelector("#plane");
  if (!slide) return;
  const images = [...document.querySelectorAll("#look .frame img")];
  const show = () => {
    const plane = Number(slide.value);
    images.forEach((image, number) => { image.hidden = number !== plane; });
    document.querySelector("#depth-shown").textContent = images[plane].alt;
    slide.setAttribute("aria-valuetext", images[plane].alt);
  };
  slide.addEventListener("input", show);
  document.querySelector("#look .slide").hidden = false;
  show();
})();
