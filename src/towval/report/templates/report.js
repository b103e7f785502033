"use strict";
// The inverse of `packed` in towval.report.inline: eight characters hold seven bytes.
const unpacked = (text, length) => {
  const bytes = new Uint8Array(length);
  let bits = 0, have = 0, at = 0;
  for (let i = 0; i < text.length; i += 1) {
    bits = ((bits << 7) | (text.charCodeAt(i) & 127)) & 0x7fff;
    have += 7;
    if (have >= 8) { have -= 8; bytes[at++] = bits >> have; }
  }
  return bytes;
};
const json = (element) => JSON.parse(element.textContent);

// What is drawn over a film: points of each frame in pixels of the upright picture, projected beforehand.
const COLOURS = { rover: "#4096ff", simulated: "#000", measured: "#ff3c24", taut: "#ffd650", slack: "#fff" };
class Layers {
  constructor(figure) {
    Object.assign(this, json(figure.querySelector(".layers")));
    this.points = Object.values(this.counts).reduce((sum, count) => sum + count, 0);
    const frames = this.taut.length;
    const bytes = unpacked(figure.querySelector(".places").textContent, 4 * frames * this.points);
    this.places = new Int16Array(bytes.buffer);
    this.first = {};
    let sum = 0;
    for (const [name, count] of Object.entries(this.counts)) { this.first[name] = sum; sum += count; }
  }

  // Strokes `count` points from the index `at` of the array, `stride` apart; missing points leave gaps.
  stroke(context, at, count, stride, colour, width, dash = []) {
    const scale = context.canvas.width / this.size[0];
    let down = false;
    context.beginPath();
    for (let i = 0; i < count; i += 1, at += stride) {
      const u = this.places[2 * at], v = this.places[2 * at + 1];
      if (u === -32768) { down = false; continue; }
      context[down ? "lineTo" : "moveTo"]((u * this.unit + 0.5) * scale, (v * this.unit + 0.5) * scale);
      down = true;
    }
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.setLineDash(dash);
    context.stroke();
  }

  draw(context, frame, shown) {
    const line = Math.max(1.25, context.canvas.width / 480);
    const own = (name, ...rest) => this.stroke(context, frame * this.points + this.first[name], this.counts[name], 1, ...rest);
    // As many points of a path as can be told apart.
    const skip = Math.max(1, Math.ceil(frame / 2000));
    const path = (name, ...rest) =>
      this.stroke(context, this.first[`${name} path`], Math.floor(frame / skip) + 1, skip * this.points, ...rest);
    context.lineJoin = "round";
    if (shown.has("paths")) {
      if (shown.has("rover")) { path("rover", COLOURS.rover, 0.7 * line); }
      if (shown.has("simulated")) { path("simulated", COLOURS.simulated, line); }
      if (shown.has("measured")) { path("measured", COLOURS.measured, 0.8 * line); }
    }
    if (shown.has("tether")) {
      const taut = this.taut[frame];
      own("tether", taut ? COLOURS.taut : COLOURS.slack, taut ? line : 0.7 * line);
    }
    if (shown.has("rover")) { own("rover", COLOURS.rover, line); }
    if (shown.has("simulated")) {
      own("simulated", COLOURS.slack, 2.6 * line);
      own("simulated", COLOURS.simulated, 1.6 * line);
    }
    if (shown.has("measured")) { own("measured", COLOURS.measured, line, [4 * line, 4 * line]); }
  }
}

// Index of the last time that is not after the given one.
const before = (times, time) => {
  let low = 0, high = times.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) { low = middle; } else { high = middle; }
  }
  return low;
};
const nearest = (times, time) => {
  const i = before(times, time);
  return i + 1 < times.length && times[i + 1] - time < time - times[i] ? i + 1 : i;
};
const signed = (value, digits, unit) => (value < 0 ? "\u2212" : "+") + Math.abs(value).toFixed(digits) + unit;

// One time cursor a run: the plots, the slider and the film with what is drawn over it stand at the same frame.
class Run {
  constructor(section) {
    this.section = section;
    this.one = (selector) => section.querySelector(selector);
    this.series = json(this.one(".series"));
    this.last = this.series.time_s.length - 1;
    this.plots = [...section.querySelectorAll(".timeplot")];
    this.slider = this.one(".time");
    this.slider.addEventListener("input", () => this.go(Number(this.slider.value)));
    for (const plot of this.plots) { this.listen(plot); }
    const video = this.one("video");
    if (video) { this.prepare(video); }
    this.show(0);
  }

  listen(plot) {
    const point = (event) => {
      const box = plot.getBoundingClientRect();
      const { left, right, first, last } = plot.dataset;
      const share = ((event.clientX - box.left) / box.width - left) / (right - left);
      this.go(nearest(this.series.time_s, Number(first) + share * (last - first)));
    };
    plot.addEventListener("pointerdown", (event) => { plot.setPointerCapture(event.pointerId); point(event); });
    plot.addEventListener("pointermove", (event) => { if (plot.hasPointerCapture(event.pointerId)) { point(event); } });
  }

  // Everything at a frame: only here do cursor, numbers and outlines change.
  show(frame) {
    this.frame = frame;
    const now = this.series.time_s[frame];
    for (const plot of this.plots) {
      const { left, right, first, last } = plot.dataset, cursor = plot.querySelector(".cursor");
      const share = Math.min(1, Math.max(0, (now - first) / (last - first)));
      cursor.style.left = `${100 * (Number(left) + (right - left) * share)}%`;
      cursor.style.visibility = "visible";
    }
    if (!this.seeking) { this.slider.value = frame; }
    this.slider.setAttribute("aria-valuetext", `${now.toFixed(2)} s`);
    this.one(".readout").textContent = this.words(frame);
    this.section.dataset.frame = frame;
    this.draw();
  }

  words(i) {
    const { time_s, along_mm, across_mm, heading_deg, tension_N } = this.series;
    const error = along_mm[i] === null ? `object not ${tension_N[i] === null ? "simulated" : "tracked"}`
      : `error ${Math.hypot(along_mm[i], across_mm[i]).toFixed(2)} mm (along ${signed(along_mm[i], 2, "")}, across ` +
        `${signed(across_mm[i], 2, "")}), ${signed(heading_deg[i], 2, "\u00b0")}`;
    return `${time_s[i].toFixed(2)} s: ${error}${tension_N[i] === null ? "" : `, tension ${tension_N[i].toFixed(1)} N`}`;
  }

  // To a frame: the film seeks and shows it, without a film it is shown at once.
  go(frame) {
    this.section.classList.add("moved");
    const target = Math.min(this.last, Math.max(0, frame));
    if (!this.ready) { this.show(target); return; }
    this.video.pause();
    this.wanted = target;
    this.slider.value = target;
    this.seek();
  }

  seek() {
    if (this.wanted === undefined || this.seeking) { return; }
    const { film_s } = this.series, i = this.wanted;
    // Well within the frame, so that rounding does not show the one before.
    const length = i < this.last ? film_s[i + 1] - film_s[i] : film_s[i] - film_s[Math.max(0, i - 1)];
    this.seeking = true;
    this.wanted = undefined;
    this.video.currentTime = this.start + film_s[i] + length / 4;
  }

  // A browser may present a frame without a call: where the film stands still, its clock says which one it shows.
  settle() {
    requestAnimationFrame(() => requestAnimationFrame(() => {
      if (!this.ready || this.seeking || !this.video.paused) { return; }
      const frame = before(this.series.film_s, this.video.currentTime - this.start + 1e-4);
      if (frame !== this.presented) { this.presented = frame; this.show(frame); }
    }));
  }

  prepare(video) {
    this.video = video;
    this.canvas = this.one("canvas");
    this.shown = new Set();
    for (const box of this.section.querySelectorAll(".layer input")) {
      const changed = () => { this.shown[box.checked ? "add" : "delete"](box.value); if (this.layers) { this.draw(); } };
      box.addEventListener("change", changed);
      changed();
    }
    const play = this.one(".play");
    play.addEventListener("click", () => {
      this.section.classList.add("moved");
      if (video.paused) { video.play(); } else { video.pause(); }
    });
    for (const event of ["play", "pause", "ended"]) {
      video.addEventListener(event, () => {
        play.textContent = video.paused ? "\u25b6" : "\u23f8";
        play.setAttribute("aria-label", video.paused ? "Play" : "Pause");
      });
    }
    video.addEventListener("click", () => play.click());
    video.addEventListener("seeked", () => { this.seeking = false; this.seek(); this.settle(); });
    video.addEventListener("error", () => { if (video.src) { this.one(".unplayable").hidden = false; this.stop(); } });
    this.one(".unplayable input").addEventListener("change", ({ target }) => {
      const [file] = target.files;
      if (file) { target.value = ""; this.open(file); } // emptied, so that the same file can be chosen again
    });
    this.one(".enlarge").addEventListener("click", () => this.one(".stage").requestFullscreen());
    this.one(".save").addEventListener("click", () => this.save());
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    // A film is unpacked when the reader comes near it.
    const near = new IntersectionObserver((seen) => {
      if (seen.some((entry) => entry.isIntersecting)) { near.disconnect(); this.load(); }
    }, { rootMargin: "1000px" });
    near.observe(this.section);
  }

  load() {
    this.layers = new Layers(this.section);
    const content = this.one(".content");
    // A browser does not give away the pictures of a file beside the page.
    this.one(".save").hidden = !content;
    if (!content) { this.video.src = this.video.dataset.address; this.follow(); return; }
    const bytes = unpacked(content.textContent, Number(content.dataset.bytes));
    this.open(new Blob([bytes], { type: this.video.dataset.kind }));
  }

  open(file) {
    this.one(".unplayable").hidden = true;
    this.one(".save").hidden = false;
    this.section.classList.remove("unseen");
    this.video.src = URL.createObjectURL(file);
    this.follow();
  }

  stop() {
    this.ready = this.seeking = false;
    this.section.classList.remove("ready");
    this.section.classList.add("unseen");
  }

  // Shows the frame that the browser presents, by the time that the file itself gives it.
  follow() {
    const film = this.video, source = film.src;
    const presented = (mediaTime) => {
      if (!this.ready) {
        // Some files start late: the first frame presented is the first of the file.
        this.start = mediaTime;
        this.ready = true;
        this.section.classList.add("ready");
        // The cursor may have been moved before the film was there.
        if (this.frame > 0) { this.presented = 0; this.go(this.frame); return; }
      }
      this.presented = nearest(this.series.film_s, mediaTime - this.start);
      this.show(this.presented);
    };
    if ("requestVideoFrameCallback" in film) {
      const next = (_, { mediaTime }) => {
        if (film.src !== source) { return; }
        presented(mediaTime);
        film.requestVideoFrameCallback(next);
      };
      film.requestVideoFrameCallback(next);
      return;
    }
    // Without that call the clock of the film has to do, which may be a frame ahead of the picture.
    const by_clock = () => {
      if (film.src !== source) { return; }
      const i = before(this.series.film_s, film.currentTime - (this.start || 0) + 1e-4);
      if (film.readyState >= 2 && (!this.ready || i !== this.frame)) { presented(this.ready ? this.series.film_s[i] + this.start : 0); }
      requestAnimationFrame(by_clock);
    };
    by_clock();
  }

  draw() {
    if (!this.layers || !this.ready) { return; }
    const { canvas } = this, context = canvas.getContext("2d");
    const width = Math.round(canvas.clientWidth * devicePixelRatio), height = Math.round(canvas.clientHeight * devicePixelRatio);
    if (canvas.width !== width || canvas.height !== height) { Object.assign(canvas, { width, height }); }
    context.clearRect(0, 0, width, height);
    if (this.printing) { context.drawImage(this.video, 0, 0, width, height); }
    // What belongs to the picture, even while the cursor waits for another.
    this.layers.draw(context, this.presented, this.shown);
  }

  save() {
    if (!this.ready) { return; }
    const [width, height] = this.layers.size, picture = Object.assign(document.createElement("canvas"), { width, height });
    const context = picture.getContext("2d");
    context.drawImage(this.video, 0, 0, width, height);
    this.layers.draw(context, this.presented, this.shown);
    const time = this.series.time_s[this.presented].toFixed(2);
    picture.toBlob((blob) => {
      const link = document.createElement("a");
      Object.assign(link, { href: URL.createObjectURL(blob), download: `run_${this.section.dataset.name}_${time}s.png` });
      link.click();
    });
  }
}
const runs = [...document.querySelectorAll(".run")].map((section) => new Run(section));

// The canvas prints, a video does not: the frame shown is drawn into it.
const printing = (on) => () => { for (const run of runs) { run.printing = on; if (run.ready) { run.draw(); } } };
window.addEventListener("beforeprint", printing(true));
window.addEventListener("afterprint", printing(false));

// A link to a folded part opens it.
const unfold = () => {
  const part = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (part && part.matches("details")) { part.open = true; part.scrollIntoView(); }
};
window.addEventListener("hashchange", unfold);
unfold();
// What is unfolded comes into the window, as far as its heading stays there.
for (const part of document.querySelectorAll("details.part")) {
  part.querySelector("summary").addEventListener("click", () => requestAnimationFrame(() => {
    const { top, bottom } = part.getBoundingClientRect();
    if (part.open && bottom > innerHeight) { scrollBy({ top: Math.min(bottom - innerHeight, top), behavior: "instant" }); }
  }));
}
