"use strict";
// Poses [x, y, heading] of tops on the floor; pixels (0, 0) is the centre of the first one.
const DATA = JSON.parse(document.getElementById("data").textContent);
const BODIES = Object.keys(DATA.bodies);
const COLOURS = { rover: "#4096ff", object: "#ff3c24" };
const SAMPLES = 160; // along an outline
const byId = (id) => document.getElementById(id);
const view = byId("view"), loupe = byId("loupe");

// ---- camera: the picture is shown without the distortion of the lens; clicks are saved as the camera films them
let { matrix: K, lens: D, T_camera_floor: T, resolution_px: FILMED, shown: SHOWN } = Object.values(DATA.runs)[0].camera;

// What a function returns with the camera of a run, which may have moved since the run before.
function seenIn(name, found) {
  const own = ({ camera }) => ({ matrix: K, lens: D, T_camera_floor: T, resolution_px: FILMED, shown: SHOWN } = camera);
  own(DATA.runs[name]);
  try { return found(); } finally { if (run) own(DATA.runs[run]); }
}

const pinhole = (M, x, y) => [M[0][0] * x + M[0][2], M[1][1] * y + M[1][2]];

function ray(x, y, z) {
  const c = [0, 1, 2].map((i) => T[i][0] * x + T[i][1] * y + T[i][2] * z + T[i][3]);
  return [c[0] / c[2], c[1] / c[2]];
}

const project = (x, y, z) => pinhole(SHOWN.matrix, ...ray(x, y, z));

// OpenCV's rational model; that of a fisheye, which has a ninth coefficient, acts on the angle of the ray.
function filmed(x, y, z) {
  const [k1, k2, p1, p2, k3, k4, k5, k6, fisheye] = D, tangent = ray(x, y, z), far = Math.hypot(...tangent);
  const [a, b] = fisheye && far ? tangent.map((each) => (each * Math.atan(far)) / far) : tangent, r2 = a * a + b * b;
  const radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)));
  return pinhole(K, a * radial + 2 * p1 * a * b + p2 * (r2 + 2 * a * a), b * radial + p1 * (r2 + 2 * b * b) + 2 * p2 * a * b);
}

function toPlane(u, v, height) {
  const M = SHOWN.matrix, x = (u - M[0][2]) / M[0][0], y = (v - M[1][2]) / M[1][1];
  // The ray in floor axes, from the camera's place.
  const way = [0, 1, 2].map((i) => T[0][i] * x + T[1][i] * y + T[2][i]);
  const place = [0, 1, 2].map((i) => -(T[0][i] * T[0][3] + T[1][i] * T[1][3] + T[2][i] * T[2][3]));
  const s = (height - place[2]) / way[2];
  return [place[0] + s * way[0], place[1] + s * way[1]];
}

const placed = ([x, y, h], [a, b]) => [x + Math.cos(h) * a - Math.sin(h) * b, y + Math.sin(h) * a + Math.cos(h) * b];
const wrapped = (angle) => Math.atan2(Math.sin(angle), Math.cos(angle));
const picture = (body, pose, point) => project(...placed(pose, point), DATA.bodies[body].height);
const corners = (body, pose) => DATA.bodies[body].corners.map((corner) => picture(body, pose, corner));
const clicked = (body, pose) => DATA.bodies[body].corners.map((corner) => filmed(...placed(pose, corner), DATA.bodies[body].height));

// ---- state
const runs = Object.create(null); // a run may be named constructor
let run, selected = BODIES[0], past = [];
let scale = 1, offset = [0, 0]; // from pixels of the picture to those of the window

for (const [name, given] of Object.entries(DATA.runs)) {
  runs[name] = { poses: {}, unplaced: new Set(), image: new Image() };
  for (const body of BODIES) {
    const start = given.poses[body];
    if (!start) runs[name].unplaced.add(body);
    const [width, height] = given.camera.shown.size_px;
    const where = seenIn(name, () => toPlane(width * (body === "rover" ? 0.6 : 0.4), height / 2, DATA.bodies[body].height));
    runs[name].poses[body] = start || [...where, 0];
  }
  runs[name].image.onload = () => { runs[name].grey = greys(runs[name].image); if (name === run) { fit(); draw(); } };
  runs[name].image.src = given.frame;
}

function greys(image) {
  const canvas = document.createElement("canvas");
  canvas.width = image.naturalWidth; canvas.height = image.naturalHeight;
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  const pixels = context.getImageData(0, 0, canvas.width, canvas.height).data;
  const values = new Float32Array(canvas.width * canvas.height);
  for (let i = 0; i < values.length; i++) values[i] = pixels[4 * i];
  return { values, width: canvas.width, height: canvas.height };
}

function greyAt({ values, width, height }, u, v) {
  if (!(u >= 0 && v >= 0 && u < width - 1 && v < height - 1)) return NaN;
  const i = Math.floor(u), j = Math.floor(v), a = u - i, b = v - j, at = j * width + i;
  return (1 - b) * ((1 - a) * values[at] + a * values[at + 1]) + b * ((1 - a) * values[at + width] + a * values[at + width + 1]);
}

// How sharply grey levels change across the outline: the mean step, none counted above 40; NaN where it is outside the picture.
function score(body, pose) {
  const points = corners(body, pose), grey = runs[run].grey, steps = [];
  if (!grey) return NaN;
  points.forEach(([u, v], i) => {
    const [p, q] = points[(i + 1) % points.length], length = Math.hypot(p - u, q - v) || 1;
    const n = Math.max(8, Math.round(SAMPLES / points.length)), normal = [(q - v) / length, (u - p) / length];
    for (let k = 0; k < n; k++) {
      const t = (k + 0.5) / n, x = u + t * (p - u), y = v + t * (q - v);
      const step = Math.abs(greyAt(grey, x + 1.2 * normal[0], y + 1.2 * normal[1]) - greyAt(grey, x - 1.2 * normal[0], y - 1.2 * normal[1]));
      if (!Number.isNaN(step)) steps.push(Math.min(step, 40));
    }
  });
  return steps.length ? steps.reduce((a, b) => a + b, 0) / steps.length : NaN;
}

const pixel = (body, pose) => { // width of a pixel on the top [m]
  const [a, b] = [picture(body, pose, [0, 0]), picture(body, pose, [0.01, 0])];
  return 0.01 / (Math.hypot(b[0] - a[0], b[1] - a[1]) || 1);
};
const reach = (body) => Math.max(...DATA.bodies[body].corners.map(([x, y]) => Math.hypot(x, y)));

// The best pose within some pixels: over all headings nearby on a coarse grid, then finer and finer.
function snapped(body, start, capture) {
  let best = start, value = score(body, start);
  for (const [step, span] of [[2, capture], [0.7, 2.1], [0.25, 0.75], [0.1, 0.3]]) {
    const metre = step * pixel(body, start), turn = metre / reach(body), centre = best, count = Math.round(span / step);
    const turns = Math.min(count, 4);
    for (let i = -count; i <= count; i++) for (let j = -count; j <= count; j++) for (let k = -turns; k <= turns; k++) {
      const trial = [centre[0] + i * metre, centre[1] + j * metre, centre[2] + k * turn], found = score(body, trial);
      if (found > value) { best = trial; value = found; }
    }
  }
  return best;
}

const apart = (body, a, b) => Math.max(...corners(body, a).map(([u, v], i) => {
  const [p, q] = corners(body, b)[i];
  return Math.hypot(u - p, v - q);
}));

// ---- warnings
function warnings(name) {
  const told = [], { poses, unplaced } = runs[name], given = DATA.runs[name];
  for (const body of BODIES) {
    if (unplaced.has(body)) told.push(`The ${body} was not found. Drag its outline onto its top, then snap.`);
    if (given.poses[body] === poses[body]) for (const text of given.told[body] || []) told.push(`${body}: ${text}`);
    const start = given.poses[body];
    if (start && Math.abs(wrapped(poses[body][2] - start[2])) > 1.5) told.push(`The ${body} was found the other way round. Is its arrow right?`);
    const outside = seenIn(name, () => clicked(body, poses[body]).some(([u, v]) => u < 0 || v < 0 || u > FILMED[0] - 1 || v > FILMED[1] - 1));
    if (outside) told.push(`A corner of the ${body} is outside the picture.`);
    if (name !== run || !runs[name].grey || dragging) continue;
    const better = snapped(body, poses[body], 8), off = apart(body, poses[body], better);
    if (off > 1.8 && score(body, better) > 1.12 * score(body, poses[body])) told.push(`The outline of the ${body} is ${off.toFixed(0)} px beside edges that fit it. Snap it, or check its size and height.`);
    else if (score(body, better) < 5) told.push(`The outline of the ${body} lies on no edges.`);
  }
  const [span, longest] = [tether(name).span, DATA.tether.longest_m];
  if (span > longest) told.push(`The tether would be ${span.toFixed(2)} m long and is ${DATA.tether.rest_length_m} m: is a body the wrong way round, or not in its place?`);
  return told;
}

function tether(name) {
  const { rover, object } = runs[name].poses;
  const hinge = placed(rover, DATA.bodies.rover.hold), anchor = placed(object, DATA.bodies.object.hold);
  return { hinge, anchor, span: Math.hypot(hinge[0] - anchor[0], hinge[1] - anchor[1]) };
}

// ---- drawing
const onScreen = ([u, v]) => [(u + 0.5) * scale + offset[0], (v + 0.5) * scale + offset[1]];
const inPicture = (x, y) => [(x - offset[0]) / scale - 0.5, (y - offset[1]) / scale - 0.5];

function fit() {
  const { clientWidth: w, clientHeight: h } = view, [width, height] = SHOWN.size_px;
  scale = Math.min(w / width, h / height);
  offset = [(w - scale * width) / 2, (h - scale * height) / 2];
}

function zoom(factor, x = view.clientWidth / 2, y = view.clientHeight / 2) {
  factor = Math.min(Math.max(scale * factor, 0.05), 30) / scale;
  offset = [x - factor * (x - offset[0]), y - factor * (y - offset[1])];
  scale *= factor;
  draw();
}

function line(context, points, colour, width) {
  context.beginPath();
  points.forEach((point, i) => context[i ? "lineTo" : "moveTo"](...point));
  context.strokeStyle = colour; context.lineWidth = width; context.stroke();
}

const along = (from, to, n = 12) => Array.from({ length: n + 1 }, (_, i) => from.map((x, k) => x + (to[k] - x) * i / n));

function paint(context, place) {
  const ground = (from, to, colour, width) => line(context, along(from, to).map(([x, y]) => place(project(x, y, 0))), colour, width);
  if (byId("grid").checked) for (const [from, to] of DATA.runs[run].grid) ground(from, to, "#ffffff55", 1);
  ground([0, 0], [0.5, 0], "#e02020", 3);
  ground([0, 0], [0, 0.5], "#20b040", 3);
  for (const body of BODIES) {
    const pose = runs[run].poses[body], own = DATA.bodies[body], chosen = body === selected;
    const top = (from, to, colour, width) => line(context, along(from, to).map((point) => place(picture(body, pose, point))), colour, width);
    own.corners.forEach((corner, i) => top(corner, own.corners[(i + 1) % own.corners.length], COLOURS[body], chosen ? 2.5 : 1.5));
    const length = 0.6 * reach(body);
    top([0, 0], [length, 0], COLOURS[body], 2);
    top([length, 0], [0.8 * length, 0.1 * length], COLOURS[body], 2);
    top([length, 0], [0.8 * length, -0.1 * length], COLOURS[body], 2);
    if (chosen) for (const corner of corners(body, pose)) {
      const [x, y] = place(corner);
      context.beginPath(); context.arc(x, y, 6, 0, 7); context.strokeStyle = "#fff"; context.lineWidth = 1.5; context.stroke();
    }
  }
  const { hinge, anchor, span } = tether(run), [above, below] = DATA.tether.heights_m;
  line(context, along([...hinge, above], [...anchor, below]).map((point) => place(project(...point))), span > DATA.tether.longest_m ? "#ff00ff" : "#ffd650", 2);
}

function draw() {
  const ratio = window.devicePixelRatio || 1, context = view.getContext("2d");
  view.width = view.clientWidth * ratio; view.height = view.clientHeight * ratio;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  const { image } = runs[run];
  context.imageSmoothingEnabled = scale < 2;
  if (image.complete) context.drawImage(image, offset[0], offset[1], image.naturalWidth * scale, image.naturalHeight * scale);
  paint(context, onScreen);
}

function showLoupe(x, y) {
  const context = loupe.getContext("2d"), [u, v] = inPicture(x, y), zoomed = 5, half = loupe.width / 2;
  loupe.style.display = "block";
  loupe.style.left = `${x > 200 ? 8 : view.clientWidth - 178}px`; loupe.style.top = "8px";
  context.fillStyle = "#333"; context.fillRect(0, 0, loupe.width, loupe.height);
  context.imageSmoothingEnabled = false;
  context.drawImage(runs[run].image, u + 0.5 - half / zoomed, v + 0.5 - half / zoomed, 2 * half / zoomed, 2 * half / zoomed, 0, 0, loupe.width, loupe.height);
  paint(context, ([p, q]) => [half + zoomed * (p - u), half + zoomed * (q - v)]);
}

let waiting;
function changed() {
  draw();
  clearTimeout(waiting);
  waiting = setTimeout(tell, 150);
}

function tell() {
  const box = byId("warnings"), told = warnings(run);
  box.replaceChildren(...(told.length ? told : ["Both outlines lie on edges, and the tether reaches."]).map((text) => {
    const row = document.createElement("p");
    row.textContent = text;
    if (!told.length) row.className = "good";
    return row;
  }));
  for (const tab of byId("runs").children) tab.textContent = `run ${tab.dataset.run}${tab.dataset.run === run && told.length ? " ⚠" : ""}`;
}

// ---- editing
const remember = (body, pose) => past.push([run, body, pose, runs[run].unplaced.has(body)]);

function move(pose, body = selected) {
  remember(body, runs[run].poses[body]);
  runs[run].poses[body] = pose;
  runs[run].unplaced.delete(body);
  changed();
}

function turn(angle) {
  const [x, y, heading] = runs[run].poses[selected];
  move([x, y, wrapped(heading + angle)]);
}

function nudge(du, dv) {
  const pose = runs[run].poses[selected], height = DATA.bodies[selected].height, [u, v] = picture(selected, pose, [0, 0]);
  const [a, b] = [toPlane(u, v, height), toPlane(u + du, v + dv, height)];
  move([pose[0] + b[0] - a[0], pose[1] + b[1] - a[1], pose[2]]);
}

function undo() {
  const last = past.pop();
  if (!last) return;
  const [name, body, pose, unplaced] = last;
  runs[name].poses[body] = pose;
  if (unplaced) runs[name].unplaced.add(body);
  if (name !== run) show(name); else changed();
}

const snap = () => move(snapped(selected, runs[run].poses[selected], 14));

function select(body) {
  selected = body;
  for (const button of byId("bodies").children) button.setAttribute("aria-checked", button.dataset.body === body);
  draw();
}

function show(name) {
  run = name;
  seenIn(run, () => {});
  for (const tab of byId("runs").children) tab.setAttribute("aria-selected", tab.dataset.run === name);
  fit(); changed();
}

// ---- pointers: one drags, two pinch
const pointers = new Map();
let dragging = null, pinch = null;

function inside(point, polygon) {
  let hit = false;
  polygon.forEach(([x, y], i) => {
    const [p, q] = polygon[(i + 1) % polygon.length];
    if ((y > point[1]) !== (q > point[1]) && point[0] < x + (point[1] - y) / (q - y) * (p - x)) hit = !hit;
  });
  return hit;
}

function grabbed(x, y) {
  for (const body of [selected, ...BODIES.filter((other) => other !== selected)]) {
    const shown = corners(body, runs[run].poses[body]).map(onScreen);
    const corner = shown.findIndex(([a, b]) => Math.hypot(a - x, b - y) < 16);
    if (corner >= 0 && body === selected) return { kind: "corner", body, corner };
    if (inside([x, y], shown)) return { kind: "body", body };
  }
  return { kind: "view" };
}

view.addEventListener("pointerdown", (event) => {
  try { view.setPointerCapture(event.pointerId); } catch { /* made by a program */ }
  const at = [event.offsetX, event.offsetY];
  pointers.set(event.pointerId, at);
  if (pointers.size === 2) {
    if (dragging && dragging.before) runs[run].poses[dragging.body] = dragging.before;
    const [a, b] = [...pointers.values()];
    pinch = { distance: Math.hypot(a[0] - b[0], a[1] - b[1]) }; dragging = null; loupe.style.display = "none";
    return;
  }
  dragging = { ...grabbed(...at), from: at, shift: [...offset] };
  if (dragging.kind === "view") return;
  select(dragging.body);
  dragging.before = runs[run].poses[dragging.body];
  dragging.grip = toPlane(...inPicture(...at), DATA.bodies[dragging.body].height);
});

view.addEventListener("pointermove", (event) => {
  if (!pointers.has(event.pointerId)) return;
  const at = [event.offsetX, event.offsetY];
  pointers.set(event.pointerId, at);
  if (pinch && pointers.size === 2) {
    const [a, b] = [...pointers.values()], distance = Math.hypot(a[0] - b[0], a[1] - b[1]);
    zoom(distance / pinch.distance, (a[0] + b[0]) / 2, (a[1] + b[1]) / 2);
    pinch.distance = distance;
    return;
  }
  if (!dragging) return;
  if (dragging.kind === "view") {
    offset = [dragging.shift[0] + at[0] - dragging.from[0], dragging.shift[1] + at[1] - dragging.from[1]];
    draw();
    return;
  }
  const { body, before, grip } = dragging, own = DATA.bodies[body], now = toPlane(...inPicture(...at), own.height);
  if (dragging.kind === "body") {
    runs[run].poses[body] = [before[0] + now[0] - grip[0], before[1] + now[1] - grip[1], before[2]];
  } else {
    // Turned about the farthest corner, which stays; the outline keeps its size.
    const [cx, cy] = own.corners[dragging.corner];
    const pivot = own.corners.reduce((far, each) => Math.hypot(each[0] - cx, each[1] - cy) > Math.hypot(far[0] - cx, far[1] - cy) ? each : far);
    const fixed = placed(before, pivot), angle = Math.atan2(now[1] - fixed[1], now[0] - fixed[0]) - Math.atan2(cy - pivot[1], cx - pivot[0]);
    const arm = placed([0, 0, angle], pivot);
    runs[run].poses[body] = [fixed[0] - arm[0], fixed[1] - arm[1], wrapped(angle)];
  }
  draw();
  showLoupe(...at);
});

function released(event) {
  pointers.delete(event.pointerId);
  pinch = null;
  loupe.style.display = "none";
  if (dragging && dragging.before && String(dragging.before) !== String(runs[run].poses[dragging.body])) {
    remember(dragging.body, dragging.before);
    runs[run].unplaced.delete(dragging.body);
  }
  dragging = null;
  changed();
}
view.addEventListener("pointerup", released);
view.addEventListener("pointercancel", released);
view.addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.exp(-event.deltaY / 400), event.offsetX, event.offsetY); }, { passive: false });

// ---- what is saved: the text of campaign.yaml with the corners put in
const flow = (value) => Array.isArray(value) ? `[${value.map(flow).join(", ")}]` : typeof value === "number" ? String(Math.round(10 * value) / 10) : `{${Object.entries(value).map(([key, item]) => `${key}: ${flow(item)}`).join(", ")}}`;

const clicks = (name) => seenIn(name, () => Object.fromEntries(BODIES.map((body) => [body, clicked(body, runs[name].poses[body])])));
const runClicks = ({ run, stated, before }) => run in runs ? before + flow(clicks(run)) : stated;
const floorCorner = ({ floor, stated, before }) => frame && frame[floor] !== BOARD[floor] ? before + flow(BOARD.corners[frame[floor]]) : stated;

function campaign() {
  return DATA.text.map((part) => typeof part === "string" ? part : part.floor ? floorCorner(part) : runClicks(part)).join("");
}

function save() {
  const told = Object.keys(runs).flatMap((name) => warnings(name).map((text) => `run ${name}: ${text}`));
  if (told.length && !window.confirm(`${told.join("\n\n")}\n\nSave all the same?`)) return;
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([campaign()], { type: "text/yaml" }));
  link.download = "campaign.yaml";
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  byId("saved").textContent = `campaign.yaml is among the downloads of the browser. Put it in place of the one in ${DATA.name}, then call towval check again.`;
}

// ---- wiring
const next = () => { const names = Object.keys(runs); show(names[(names.indexOf(run) + 1) % names.length]); };
const ACTIONS = {
  left: () => turn(Math.PI / 360), right: () => turn(-Math.PI / 360), quarter: () => turn(Math.PI / 2), half: () => turn(Math.PI),
  snap, undo, in: () => zoom(1.5), out: () => zoom(1 / 1.5), whole: () => { fit(); draw(); }, save,
};
for (const [id, action] of Object.entries(ACTIONS)) byId(id).addEventListener("click", action);
byId("grid").addEventListener("change", draw);
const KEYS = { "[": "left", "]": "right", q: "quarter", h: "half", s: "snap", u: "undo", "+": "in", "=": "in", "-": "out", 0: "whole" };
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
window.addEventListener("keydown", (event) => {
  if ((event.ctrlKey || event.metaKey) && event.key === "s") { event.preventDefault(); save(); return; }
  // Many keyboards have brackets with AltGr, which some systems report as Ctrl and Alt, or with Option.
  if (event.metaKey || ((event.ctrlKey || event.altKey) && !"[]".includes(event.key))) return;
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if (ARROWS[key]) { event.preventDefault(); const by = event.shiftKey ? 10 : 1; nudge(by * ARROWS[key][0], by * ARROWS[key][1]); }
  else if (KEYS[key]) ACTIONS[KEYS[key]]();
  else if (BODIES[key - 1]) select(BODIES[key - 1]);
  else if (key === "n") next();
  else if (key === "g") { byId("grid").checked = !byId("grid").checked; draw(); }
});
byId("title").textContent = DATA.name;
for (const name of Object.keys(runs)) {
  const tab = document.createElement("button");
  tab.textContent = `run ${name}`; tab.dataset.run = name; tab.setAttribute("role", "tab");
  tab.addEventListener("click", () => show(name));
  byId("runs").append(tab);
}
for (const body of BODIES) {
  const button = document.createElement("button"), swatch = document.createElement("span");
  swatch.className = "swatch"; swatch.style.background = COLOURS[body];
  button.append(swatch, body); button.dataset.body = body; button.setAttribute("role", "radio");
  button.addEventListener("click", () => select(body));
  byId("bodies").append(button);
}
new ResizeObserver(() => { if (run) { fit(); draw(); } }).observe(view);
show(Object.keys(runs)[0]);
select(selected);
