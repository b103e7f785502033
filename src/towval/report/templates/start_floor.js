// The floor board: which of its outer corners is the origin, and along which side the x axis runs.
const BOARD = DATA.floor, ground = byId("ground");
let frame = BOARD && { origin: BOARD.origin, end: BOARD.end }; // indices into BOARD.corners, which go round the board
let held = null;

if (BOARD) {
  const image = new Image(), [left, top] = BOARD.offset, near = (at) => {
    const apart = BOARD.corners.map(([u, v]) => Math.hypot(u - at[0], v - at[1]));
    return apart.indexOf(Math.min(...apart));
  };
  const ratio = () => ground.width / BOARD.width;
  const shown = ([u, v]) => [(u - left + 0.5) * ratio(), (v - top + 0.5) * ratio()];
  const pointed = (event) => [
    event.offsetX * ground.width / ground.clientWidth / ratio() + left - 0.5,
    event.offsetY * ground.height / ground.clientHeight / ratio() + top - 0.5,
  ];
  const beside = (corner) => [(corner + 1) % 4, (corner + 3) % 4];

  function drawBoard() {
    const context = ground.getContext("2d"), [from, to] = [BOARD.corners[frame.origin], BOARD.corners[frame.end]].map(shown);
    context.drawImage(image, 0, 0, ground.width, ground.height);
    for (const corner of BOARD.corners) ring(context, shown(corner), 7, "#fff", 2);
    line(context, [from, to], "#e02020", 4);
    const side = beside(frame.origin).find((corner) => corner !== frame.end);
    line(context, [from, shown(BOARD.corners[side])], "#20b040", 4);
    ring(context, from, 9, "#e02020", 4);
    const angle = Math.atan2(to[1] - from[1], to[0] - from[0]), tip = (turn) => [to[0] - 16 * Math.cos(angle + turn), to[1] - 16 * Math.sin(angle + turn)];
    line(context, [tip(0.5), to, tip(-0.5)], "#e02020", 4);
    byId("framed").textContent = frame.origin === BOARD.origin && frame.end === BOARD.end ? "" : `Changed. ${BOARD.depends.length ? `These are given in its axes, change them too: ${BOARD.depends.join(", ")}.` : ""}`;
  }

  function setFrame(origin, end) {
    frame = { origin, end: beside(origin).includes(end) ? end : beside(origin)[0] };
    drawBoard();
  }

  image.onload = () => {
    ground.width = 2 * 274; ground.height = Math.round(ground.width * image.naturalHeight / BOARD.width);
    drawBoard();
  };
  image.src = BOARD.picture;
  // The origin is dragged by its ring, the x axis by its arrow: whichever is nearer.
  ground.addEventListener("pointerdown", (event) => {
    try { ground.setPointerCapture(event.pointerId); } catch { /* made by a program */ }
    const nearest = near(pointed(event));
    held = nearest === frame.origin ? "origin" : nearest === frame.end ? "end" : null;
  });
  ground.addEventListener("pointermove", (event) => {
    const nearest = near(pointed(event));
    if (held === "origin" && nearest !== frame.origin) setFrame(nearest, frame.end === nearest ? frame.origin : frame.end);
    if (held === "end" && beside(frame.origin).includes(nearest)) setFrame(frame.origin, nearest);
  });
  for (const name of ["pointerup", "pointercancel"]) ground.addEventListener(name, () => { held = null; });
  byId("origin").addEventListener("click", () => setFrame((frame.origin + 1) % 4, (frame.end + 1) % 4));
  byId("side").addEventListener("click", () => setFrame(frame.origin, beside(frame.origin).find((corner) => corner !== frame.end)));
} else byId("floor").remove();

function ring(context, [x, y], radius, colour, width) {
  context.beginPath(); context.arc(x, y, radius, 0, 7);
  context.strokeStyle = colour; context.lineWidth = width; context.stroke();
}
