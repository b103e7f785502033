"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const byId = (id) => document.getElementById(id);
  const { words, numbers, findings, made_of: madeOf, count } = data;
  const word = (name, i) => words[name].texts[words[name].codes[i]];
  const ratio = Array.from({ length: count }, (_, i) => {
    const [error, uncertainty] = [numbers.path_rms_m[i], numbers.u_val_m[i]];
    return error === null || !uncertainty ? null : error / uncertainty;
  });
  const verdictColour = { agrees: "#24663b", unfinished: "#9a9a94", "not judged": "#5c5c58" };
  const warnings = ["cannot tell"];
  const colourOf = (verdict) => verdictColour[verdict] || (warnings.includes(verdict) ? "#b07400" : "#b3261e");
  const shown = (value, digits) => (value === null ? "" : value.toFixed(digits));
  const moment = (seconds, length) => new Date(1e3 * seconds).toISOString().slice(0, length).replace("T", " ");
  const day = (seconds) => (seconds === null ? "" : moment(seconds, 16));
  const minus = (text) => text.replace("-", "−");

  const columns = [
    { title: "Campaign", text: (i) => word("campaign", i) },
    { title: "Run", text: (i) => word("run", i) },
    { title: "Verdict", text: (i) => word("verdict", i) + (word("verdict", i) === "unfinished" && word("state", i) ? `, up to ${word("state", i)}` : "") },
    { title: "RMS [mm]", value: (i) => numbers.path_rms_m[i], digits: 2 },
    { title: "Max. [mm]", value: (i) => numbers.path_max_m[i], digits: 2 },
    { title: "u_val [mm]", value: (i) => numbers.u_val_m[i], digits: 2 },
    { title: "|E| / u_val", value: (i) => ratio[i], digits: 2 },
    { title: "Heading [°]", value: (i) => numbers.heading_rms_rad[i], digits: 3 },
    { title: "Lost frames", value: (i) => numbers.lost_frames[i], digits: 0 },
    { title: "Main input", text: (i) => (word("main_input", i) ? `${word("main_input", i)} ${shown(numbers.main_share[i], 0)} %` : "") },
    { title: "Warnings", text: (i) => findings.codes[i].map((k) => findings.texts[k]).join(", ") },
    { title: "CPU [s]", value: (i) => numbers.cpu_s[i], digits: 0 },
    { title: "Made (UTC)", text: (i) => day(numbers.made_s[i]) },
    { title: "Version", text: (i) => word("version", i) },
    { title: "Results", text: (i) => word("source", i) },
  ];

  // Filters.
  const fill = (select, texts) => texts.forEach((text, k) => select.add(new Option(text, k)));
  fill(byId("finding"), findings.texts);
  fill(byId("version"), words.version.texts);
  fill(byId("source"), words.source.texts);
  const names = Array.from({ length: count }, (_, i) => `${word("campaign", i)}/${word("run", i)}`);

  for (const box of document.querySelectorAll("[name=verdict]")) box.parentElement.style.setProperty("--colour", colourOf(box.value));

  let selected = [];
  let order = { column: columns[0], ascending: true };

  function filter() {
    const text = byId("search").value.trim().toLowerCase();
    const verdicts = new Set([...document.querySelectorAll("[name=verdict]:checked")].map((box) => box.value));
    const ticked = words.verdict.texts.map((verdict) => verdicts.has(verdict));
    const code = (id) => (byId(id).value === "" ? null : Number(byId(id).value));
    const [finding, version, source] = [code("finding"), code("version"), code("source")];
    const least = parseFloat(byId("least").value);
    selected = [];
    for (let i = 0; i < count; i++) {
      if (!ticked[words.verdict.codes[i]]) continue;
      if (version !== null && words.version.codes[i] !== version) continue;
      if (source !== null && words.source.codes[i] !== source) continue;
      if (finding !== null && !findings.codes[i].includes(finding)) continue;
      if (least > 0 && !(numbers.path_rms_m[i] >= least)) continue;
      if (text && !names[i].toLowerCase().includes(text)) continue;
      selected.push(i);
    }
    sort();
    draw();
  }

  function sort() {
    const { column, ascending } = order;
    const sign = ascending ? 1 : -1;
    if (column.value) {
      const missing = sign * Infinity;
      const key = (i) => column.value(i) ?? missing;
      selected.sort((a, b) => sign * (key(a) - key(b)) || a - b);
    } else {
      const keys = new Map(selected.map((i) => [i, column.text(i)]));
      selected.sort((a, b) => sign * (keys.get(a) < keys.get(b) ? -1 : keys.get(a) > keys.get(b) ? 1 : 0) || a - b);
    }
  }

  // Table: only rows in view are in the document.
  const rowHeight = 26;
  const head = byId("runs").tHead.rows[0];
  const body = byId("runs").tBodies[0];
  for (const column of columns) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = column.title;
    button.addEventListener("click", () => {
      order = { column, ascending: order.column === column ? !order.ascending : true };
      sort();
      rows();
    });
    const cell = document.createElement("th");
    cell.className = column.value ? "number" : "";
    cell.append(button);
    head.append(cell);
  }

  const cellOf = (text, isNumber) => {
    const cell = document.createElement("td");
    cell.textContent = text;
    cell.title = text;
    if (isNumber) cell.className = "number";
    return cell;
  };

  const space = (height) => {
    const row = document.createElement("tr");
    row.className = "space";
    const cell = document.createElement("td");
    cell.colSpan = columns.length;
    cell.style.height = `${height}px`;
    row.append(cell);
    return row;
  };

  function rows() {
    const scroller = byId("scroller");
    const first = Math.max(0, Math.floor(scroller.scrollTop / rowHeight) - 10);
    const last = Math.min(selected.length, first + Math.ceil(innerHeight / rowHeight) + 20);
    const made = selected.slice(first, last).map((i) => {
      const row = document.createElement("tr");
      for (const column of columns) row.append(cellOf(column.value ? shown(column.value(i), column.digits) : column.text(i), column.value));
      row.cells[2].style.color = colourOf(word("verdict", i));
      return row;
    });
    body.replaceChildren(space(first * rowHeight), ...made, space((selected.length - last) * rowHeight));
    [...head.cells].forEach((cell, k) => {
      cell.ariaSort = columns[k] === order.column ? (order.ascending ? "ascending" : "descending") : "none";
    });
  }

  // Charts.
  function sheet(canvas) {
    const scale = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    canvas.width = width * scale;
    canvas.height = height * scale;
    const pen = canvas.getContext("2d");
    pen.scale(scale, scale);
    pen.font = "12px system-ui, sans-serif";
    pen.fillStyle = "#5c5c58";
    pen.strokeStyle = "#d9d8d2";
    return { pen, width, height, left: 48, bottom: height - 22, top: 8, right: width - 8 };
  }

  const niceStep = (range) => {
    const rough = range / 4;
    const power = 10 ** Math.floor(Math.log10(rough));
    return [1, 2, 5, 10].find((k) => k * power >= rough) * power;
  };

  function vertical(s, most, whole = false) {
    const step = whole ? Math.max(1, niceStep(most)) : niceStep(most);
    const digits = Math.max(0, -Math.floor(Math.log10(step)));
    const y = (value) => s.bottom - ((s.bottom - s.top) * value) / most;
    for (let value = 0; value <= most * 1.0001; value += step) {
      s.pen.beginPath();
      s.pen.moveTo(s.left, y(value));
      s.pen.lineTo(s.right, y(value));
      s.pen.stroke();
      s.pen.textAlign = "right";
      s.pen.fillText(value.toFixed(digits), s.left - 6, y(value) + 4);
    }
    return y;
  }

  function trend() {
    const s = sheet(byId("trend"));
    const values = numbers[byId("quantity").value];
    const points = selected.filter((i) => values[i] !== null && numbers.made_s[i] !== null);
    if (!points.length) return s.pen.fillText("no runs", s.left, s.top + 20);
    let [first, last, most] = [Infinity, -Infinity, 0];
    for (const i of points) {
      first = Math.min(first, numbers.made_s[i]);
      last = Math.max(last, numbers.made_s[i]);
      most = Math.max(most, values[i]);
    }
    const y = vertical(s, most > 0 ? 1.05 * most : 1);
    const inset = 8; // keeps the first and the last run off the edges
    const width = s.right - s.left - 2 * inset;
    const x = (t) => (last > first ? s.left + inset + (width * (t - first)) / (last - first) : (s.left + s.right) / 2);
    const length = last > first && day(first) === day(last) ? 19 : 16; // with seconds, where minutes read alike
    s.pen.textAlign = "left";
    s.pen.fillText(moment(first, length), s.left, s.height - 6);
    if (last > first) {
      s.pen.textAlign = "right";
      s.pen.fillText(moment(last, length), s.right, s.height - 6);
    }
    s.pen.globalAlpha = points.length > 1000 ? 0.5 : 0.9;
    for (const i of points) {
      s.pen.fillStyle = colourOf(word("verdict", i));
      s.pen.fillRect(x(numbers.made_s[i]) - 2, y(values[i]) - 2, 4, 4);
    }
  }

  function histogram() {
    const s = sheet(byId("histogram"));
    const [bins, most] = [25, 5];
    const counts = new Array(bins + 1).fill(0);
    for (const i of selected) if (ratio[i] !== null) counts[Math.min(bins, Math.floor((ratio[i] / most) * bins))] += 1;
    const y = vertical(s, Math.max(1, ...counts), true);
    const wide = (s.right - s.left) / (bins + 1);
    counts.forEach((value, k) => {
      s.pen.fillStyle = k < (2 / most) * bins ? "#1f63b4" : "#b3261e";
      s.pen.fillRect(s.left + k * wide + 1, y(value), wide - 2, s.bottom - y(value));
    });
    s.pen.fillStyle = "#5c5c58";
    s.pen.textAlign = "center";
    for (let mark = 0; mark <= most; mark++) {
      s.pen.fillText(mark === most ? "> 5" : String(mark), s.left + (mark / most) * bins * wide + (mark === most ? wide / 2 : 0), s.height - 6);
    }
  }

  function show() {
    rows();
    trend();
    histogram();
  }

  function draw() {
    const tally = new Map();
    for (const i of selected) tally.set(word("verdict", i), (tally.get(word("verdict", i)) || 0) + 1);
    const parts = [...tally].map(([verdict, n]) => `${verdict} ${n}`).join(", ");
    byId("counts").textContent = `${selected.length} of ${count} runs shown${parts ? `: ${parts}` : ""}`;
    byId("scroller").scrollTop = 0;
    show();
  }

  // What changed.
  const sources = words.source.texts;
  fill(byId("before"), sources);
  fill(byId("after"), sources);
  // At first the two folders whose runs were made last, the later one as the second.
  const lastMade = sources.map(() => 0);
  for (let i = 0; i < count; i++) lastMade[words.source.codes[i]] = Math.max(lastMade[words.source.codes[i]], numbers.made_s[i] || 0);
  const byTime = sources.map((_, k) => k).sort((a, b) => lastMade[a] - lastMade[b]);
  [byId("before").value, byId("after").value] = [byTime.at(-2) ?? 0, byTime.at(-1)];
  const compared = [
    ["RMS [mm]", numbers.path_rms_m, 3],
    ["Max. [mm]", numbers.path_max_m, 3],
    ["u_val [mm]", numbers.u_val_m, 3],
    ["Heading [°]", numbers.heading_rms_rad, 4],
    ["Lost frames", numbers.lost_frames, 0],
  ];
  ["Campaign", "Run", "Verdict", ...compared.map(([title]) => title), "What differs"].forEach((title) => {
    const cell = document.createElement("th");
    cell.textContent = title;
    byId("pairs").tHead.rows[0].append(cell);
  });

  // Stages of one run may have been made of different ones.
  function ingredients(i) {
    const found = new Map();
    for (const k of madeOf.codes[i]) {
      const [name, mark] = madeOf.texts[k].split("\t");
      found.set(name, found.has(name) ? `${found.get(name)}\t${mark}` : mark);
    }
    return found;
  }

  function difference(a, b) {
    const [before, after] = [ingredients(a), ingredients(b)];
    const all = [...new Set([...before.keys(), ...after.keys()])];
    return all.filter((name) => before.get(name) !== after.get(name));
  }

  const arrow = (a, b, digits) =>
    a === b ? shown(a, digits) : minus(`${shown(a, digits) || "none"} → ${shown(b, digits) || "none"}`);

  function changes() {
    const section = byId("changes");
    section.hidden = sources.length < 2;
    if (section.hidden) return;
    const [before, after] = [Number(byId("before").value), Number(byId("after").value)];
    const first = new Map();
    for (let i = 0; i < count; i++) if (words.source.codes[i] === before) first.set(names[i], i);
    const pairs = [];
    for (let i = 0; i < count; i++) if (words.source.codes[i] === after && first.has(names[i])) pairs.push([first.get(names[i]), i]);
    const verdicts = pairs.filter(([a, b]) => word("verdict", a) !== word("verdict", b));
    const moved = pairs.filter(([a, b]) => compared.some(([, values]) => values[a] !== values[b]));
    byId("changed").textContent =
      `${pairs.length} runs are in both; the verdict changed in ${verdicts.length}, a number in ${moved.length}.`;
    const interesting = [...new Set([...verdicts, ...moved])];
    byId("pairs").tBodies[0].replaceChildren(
      ...interesting.slice(0, 500).map(([a, b]) => {
        const row = document.createElement("tr");
        const [was, is] = [word("verdict", a), word("verdict", b)];
        row.append(
          cellOf(word("campaign", b)),
          cellOf(word("run", b)),
          cellOf(was === is ? is : `${was} → ${is}`),
          ...compared.map(([, values, digits]) => cellOf(arrow(values[a], values[b], digits), true)),
          cellOf(difference(a, b).join(", ") || "no input, setting or version of towval: libraries, or code between versions"),
        );
        return row;
      }),
    );
    if (interesting.length > 500) byId("changed").textContent += " The first 500 are listed.";
  }

  byId("filters").addEventListener("input", filter);
  byId("filters").addEventListener("submit", (event) => event.preventDefault());
  byId("filters").addEventListener("reset", () => setTimeout(filter));
  byId("quantity").addEventListener("change", trend);
  byId("scroller").addEventListener("scroll", rows, { passive: true });
  byId("before").addEventListener("change", changes);
  byId("after").addEventListener("change", changes);
  window.addEventListener("resize", show); // a phone does so when its bar of addresses goes: the place in the table stays
  filter();
  changes();
})();
