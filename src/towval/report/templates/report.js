"use strict";
// Some browsers (iOS) do not play a video from a data URI but do from a blob.
const asBlob = (address) => {
  const bytes = Uint8Array.from(atob(address.slice(address.indexOf(",") + 1)), (letter) => letter.charCodeAt(0));
  return URL.createObjectURL(new Blob([bytes], { type: "video/mp4" }));
};
// One time cursor per run, synchronised with the video.
for (const pair of document.querySelectorAll(".pair[data-run]")) {
  // The keyboard moves the slider; every plot shows the cursor and can be clicked.
  const plots = pair.querySelectorAll(".timeplot");
  const plot = pair.querySelector(".timeplot[role=slider]");
  const readout = pair.querySelector(".readout");
  const film = pair.querySelector("video");
  const series = JSON.parse(pair.querySelector(".series").textContent);
  const ends = (one) => [Number(one.dataset.left), Number(one.dataset.right)];
  const first = Number(plot.getAttribute("aria-valuemin")), last = Number(plot.getAttribute("aria-valuemax"));
  // The video starts at its first frame, the time axis at the camera's clock.
  const filmStart = film ? Number(film.dataset.start) : 0;
  const dots = [...pair.querySelectorAll(".plan")].flatMap((plan) =>
    ["rover", "measured"].map((body) => [plan, plan.querySelector(`.dot.${body}`), series[body]]));
  const share = (value, [low, high]) => (value - low) / (high - low);
  let now = first;

  const nearest = (time) => {
    let low = 0, high = series.time_s.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (series.time_s[middle] <= time) { low = middle; } else { high = middle; }
    }
    return time - series.time_s[low] <= series.time_s[high] - time ? low : high;
  };
  const signed = (value, digits, unit) => (value < 0 ? "\u2212" : "+") + Math.abs(value).toFixed(digits) + unit;
  const words = (i) => {
    const seen = series.x_mm[i] !== null;
    const error = seen
      ? `x ${signed(series.x_mm[i], 2, " mm")}, y ${signed(series.y_mm[i], 2, " mm")}, heading ${signed(series.heading_deg[i], 3, "°")}`
      : "object not tracked";
    return `${series.time_s[i].toFixed(2)} s: ${error}, tension ${series.tension_N[i].toFixed(1)} N`;
  };
  const place = (plan, dot, at) => {
    dot.style.visibility = at ? "visible" : "hidden";
    if (!at) { return; }
    const [across, up] = [plan.dataset.x, plan.dataset.y].map((text) => text.split(" ").map(Number));
    const [west, east, north, south] = ["left", "right", "top", "bottom"].map((side) => Number(plan.dataset[side]));
    dot.style.left = `${100 * (west + (east - west) * share(at[0], across))}%`;
    dot.style.top = `${100 * (south + (north - south) * share(at[1], up))}%`;
  };
  const show = (time) => {
    now = Math.min(last, Math.max(first, time));
    for (const one of plots) {
      const [left, right] = ends(one), cursor = one.querySelector(".cursor");
      cursor.style.left = `${100 * (left + (right - left) * (now - first) / (last - first))}%`;
      cursor.style.visibility = "visible";
    }
    const sample = nearest(now);
    readout.textContent = words(sample);
    for (const [plan, dot, places] of dots) { place(plan, dot, places[sample]); }
    plot.setAttribute("aria-valuenow", now.toFixed(2));
    plot.setAttribute("aria-valuetext", readout.textContent);
  };
  const go = (time) => {
    show(time);
    // Half a millisecond into the frame, so that rounding does not show the previous one.
    if (film) { film.currentTime = Math.max(0, now - filmStart + 5e-4); }
  };

  const follow = () => show(film.currentTime + filmStart);
  const run = () => { follow(); if (!film.paused && !film.ended) { requestAnimationFrame(run); } };
  if (film) {
    film.addEventListener("error", () => { film.src = asBlob(film.src); }, { once: true });
    film.addEventListener("play", run);
    for (const event of ["timeupdate", "seeked"]) { film.addEventListener(event, follow); }
  }
  for (const one of plots) {
    const point = (event) => {
      const box = one.getBoundingClientRect();
      if (film) { film.pause(); }
      go(first + (last - first) * share((event.clientX - box.left) / box.width, ends(one)));
    };
    one.addEventListener("pointerdown", (event) => { one.setPointerCapture(event.pointerId); point(event); });
    one.addEventListener("pointermove", (event) => { if (one.hasPointerCapture(event.pointerId)) { point(event); } });
  }
  plot.addEventListener("keydown", (event) => {
    const here = nearest(now);
    const steps = { ArrowLeft: here - 1, ArrowRight: here + 1, Home: 0, End: series.time_s.length - 1 };
    if (!(event.key in steps)) { return; }
    event.preventDefault();
    const target = Math.min(series.time_s.length - 1, Math.max(0, steps[event.key]));
    if (film) { film.pause(); }
    go(series.time_s[target]);
  });
  show(first);
}
// Print what is folded on screen.
window.addEventListener("beforeprint", () => {
  for (const folded of document.querySelectorAll("details:not(.reference)")) { folded.open = true; }
});
