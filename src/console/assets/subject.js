// The subject's display: the torque as a bar against its target, the EMG of the two muscles beside it, no text.
import { connect, surface } from "./link.js";

const COLOURS = {
  bar: "#e8edf2",
  held: "#2fce9f",
  band: "#2fce9f",
  trough: "#1c252e",
  edge: "#45525e",
  soft: "#8894a0",
  fcr: "#ff9d57",
  ecr: "#6cc3ff",
};
/// Place of the target on the bar, as a fraction of its length.
const TARGET_AT = 0.78;

const canvas = document.getElementById("display");
let wrist = "right";
let now = null;
let state = "lost";
let drawn = null;

const send = connect(
  (message) => {
    if (message.kind === "hello") [wrist, now] = [message.wrist, null];
    // Between two sessions: that all trials are done stays in sight until the next session.
    else if (message.kind === "laboratory") now = now?.cue === "done" ? now : null;
    else now = message;
    redraw();
  },
  (next) => {
    state = next;
    redraw();
  },
);

let asked = false;
function redraw() {
  if (asked) return;
  asked = true;
  requestAnimationFrame(() => {
    asked = false;
    draw();
    if (now && now.n !== drawn) {
      drawn = now.n;
      send({ drawn });
    }
  });
}

function draw() {
  const { pen, width, height } = surface(canvas);
  const unit = Math.min(width, height);
  const view = { pen, width, height, unit };
  const cue = state === "lost" || !now ? "wait" : now.cue;
  document.body.classList.toggle("quiet", ["target", "stay", "moving", "effort"].includes(cue));
  canvas.setAttribute("aria-label", words(cue));
  if (["target", "stay", "moving", "effort"].includes(cue)) return drawTask(view, cue);
  const draws = { relax: drawRelax, rest: drawRest, pause: drawPause, done: drawDone, wait: drawWait };
  draws[cue](view);
  if (now) drawProgress(view);
}

function words(cue) {
  const said = {
    wait: "waiting",
    relax: "relax the hand",
    effort: "push as hard as possible",
    target: "bring the bar into the band and keep it there",
    stay: "hold the torque",
    moving: "the motor is moving",
    pause: "the session is paused",
    done: "all trials are done",
  };
  return cue === "rest" ? `rest; ${now.done} of ${now.total} trials done` : said[cue];
}

/// Draws the task. The drawing is mirrored for the left wrist. The bar grows in the direction of flexion, and in the other
/// direction for extension.
function drawTask({ pen, width, height, unit }, cue) {
  const side = 0.055 * width;
  const inner = 0.035 * width;
  const edge = 0.03 * width;
  const from = edge + side + inner;
  const length = width - 2 * from;
  const flexesLeft = wrist === "right";
  const growsLeft = flexesLeft === (now.direction !== "extension");
  const x = (part) => (growsLeft ? width - from - part * length : from + part * length);
  const thick = 0.2 * height;
  const top = 0.5 * height - thick / 2;

  box(pen, x(0), top, x(1), top + thick, COLOURS.trough);
  const asksTarget = cue !== "effort";
  const level = Math.max(0, Math.min(now.level * TARGET_AT, 1));
  const isHeld = asksTarget && Math.abs(now.level - 1) < now.band_fraction;
  box(pen, x(0), top, x(asksTarget ? level : Math.min(now.level, 1)), top + thick, isHeld ? COLOURS.held : COLOURS.bar);

  if (asksTarget) {
    const [low, high] = [1 - now.band_fraction, 1 + now.band_fraction].map((part) => x(part * TARGET_AT));
    const [above, below] = [top - 0.16 * height, top + thick + 0.16 * height];
    // The fraction of the gate's time fills the band from below.
    pen.globalAlpha = 0.35;
    box(pen, low, above, high, top, COLOURS.trough);
    box(pen, low, top + thick, high, below, COLOURS.trough);
    pen.globalAlpha = 1;
    const filled = below - now.gate * (below - above);
    box(pen, low, Math.max(filled, top + thick), high, below, COLOURS.held);
    if (filled < top) box(pen, low, filled, high, top, COLOURS.held);
    pen.strokeStyle = COLOURS.band;
    pen.lineWidth = Math.max(3, 0.006 * unit);
    pen.strokeRect(Math.min(low, high), above, Math.abs(high - low), below - above);
    if (cue !== "target" || now.gate >= 1) tick(pen, (low + high) / 2, above - 0.08 * height, 0.06 * unit, COLOURS.held);
  }
  // Zero torque.
  pen.fillStyle = COLOURS.soft;
  pen.fillRect(x(0) - 2, top - 0.03 * height, 4, thick + 0.06 * height);
  if (cue === "target" && now.gate < 1) arrow(pen, x(0.28), x(0.5), 0.2 * height, 0.07 * unit);
  if (cue === "effort") arrow(pen, x(0.2), x(0.8), 0.22 * height, 0.13 * unit);

  // The flexor is on the side of flexion.
  const [left, right] = flexesLeft ? ["fcr", "ecr"] : ["ecr", "fcr"];
  const emg = { fcr: now.emg_mvc[0], ecr: now.emg_mvc[1] };
  muscle(pen, edge, side, height, emg[left], COLOURS[left]);
  muscle(pen, width - edge - side, side, height, emg[right], COLOURS[right]);
}

function box(pen, x0, y0, x1, y1, colour) {
  pen.fillStyle = colour;
  pen.fillRect(Math.min(x0, x1), Math.min(y0, y1), Math.abs(x1 - x0), Math.abs(y1 - y0));
}

/// EMG of a muscle as a fraction of its maximum, which is the top. Of a muscle that is not measured, nothing is drawn.
function muscle(pen, left, wide, height, part, colour) {
  if (part === null) return;
  const [top, tall] = [0.14 * height, 0.72 * height];
  box(pen, left, top, left + wide, top + tall, COLOURS.trough);
  const filled = Math.max(0, Math.min(part, 1)) * tall;
  box(pen, left, top + tall - filled, left + wide, top + tall, colour);
  pen.strokeStyle = COLOURS.edge;
  pen.lineWidth = 2;
  pen.strokeRect(left, top, wide, tall);
  pen.fillStyle = COLOURS.edge;
  for (const mark of [0.25, 0.5, 0.75]) pen.fillRect(left, top + tall * mark - 1, wide, 2);
}

function arrow(pen, from, to, y, size) {
  const way = Math.sign(to - from);
  pen.strokeStyle = COLOURS.bar;
  pen.lineWidth = 0.34 * size;
  pen.lineJoin = pen.lineCap = "round";
  pen.beginPath();
  pen.moveTo(from, y);
  pen.lineTo(to, y);
  pen.moveTo(to - way * size, y - 0.8 * size);
  pen.lineTo(to, y);
  pen.lineTo(to - way * size, y + 0.8 * size);
  pen.stroke();
}

function tick(pen, x, y, size, colour) {
  pen.strokeStyle = colour;
  pen.lineWidth = 0.28 * size;
  pen.lineJoin = pen.lineCap = "round";
  pen.beginPath();
  pen.moveTo(x - 0.7 * size, y);
  pen.lineTo(x - 0.15 * size, y + 0.55 * size);
  pen.lineTo(x + 0.8 * size, y - 0.6 * size);
  pen.stroke();
}

function ring({ pen, width, height, unit }, part, colour) {
  const [x, y, radius] = [width / 2, 0.46 * height, 0.27 * unit];
  pen.lineWidth = 0.045 * unit;
  pen.lineCap = "butt";
  pen.strokeStyle = COLOURS.trough;
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.stroke();
  pen.strokeStyle = colour;
  pen.beginPath();
  pen.arc(x, y, radius, -Math.PI / 2, -Math.PI / 2 + 2 * Math.PI * part);
  pen.stroke();
  return [x, y, radius];
}

function drawRest(view) {
  const left = now.rest_left_s ?? 0;
  const [x, y] = ring(view, now.rest_s ? left / now.rest_s : 0, COLOURS.ecr);
  const { pen, unit } = view;
  pen.fillStyle = COLOURS.bar;
  pen.font = `600 ${0.2 * unit}px system-ui, "DejaVu Sans", sans-serif`;
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  if (now.rest_left_s !== null) pen.fillText(String(Math.ceil(left)), x, y + 0.012 * unit);
}

/// Symbol of relaxing: a flat line.
function drawRelax(view) {
  const [x, y, radius] = ring(view, 1, COLOURS.edge);
  const { pen, unit } = view;
  pen.strokeStyle = COLOURS.bar;
  pen.lineWidth = 0.03 * unit;
  pen.lineCap = "round";
  pen.beginPath();
  for (const at of [-0.2, 0, 0.2]) {
    pen.moveTo(x - 0.45 * radius, y + at * 2 * radius);
    pen.lineTo(x + 0.45 * radius, y + at * 2 * radius);
  }
  pen.stroke();
}

function drawPause({ pen, width, height, unit }) {
  pen.fillStyle = COLOURS.soft;
  const [x, y, tall] = [width / 2, 0.46 * height, 0.34 * unit];
  for (const at of [-0.1, 0.1]) pen.fillRect(x + at * unit - 0.045 * unit, y - tall / 2, 0.09 * unit, tall);
}

function drawDone({ pen, width, height, unit }) {
  tick(pen, width / 2, 0.46 * height, 0.26 * unit, COLOURS.held);
}

function drawWait({ pen, width, height, unit }) {
  pen.fillStyle = COLOURS.edge;
  for (const at of [-1, 0, 1]) {
    pen.beginPath();
    pen.arc(width / 2 + 0.11 * at * unit, 0.46 * height, 0.028 * unit, 0, 2 * Math.PI);
    pen.fill();
  }
}

/// One mark for each trial; those of status ok are filled.
function drawProgress({ pen, width, height, unit }) {
  if (!now.total) return;
  const long = 0.7 * width;
  const [left, y, tall] = [(width - long) / 2, 0.88 * height, 0.03 * unit];
  const step = long / now.total;
  const gap = Math.min(0.25 * step, 6);
  for (let trial = 0; trial < now.total; trial += 1) {
    pen.fillStyle = trial < now.done ? COLOURS.held : COLOURS.trough;
    pen.fillRect(left + trial * step + gap / 2, y, step - gap, tall);
  }
  if (now.last_counts && now.cue === "rest") tick(pen, width / 2, 0.79 * height, 0.035 * unit, COLOURS.held);
}

const full = document.getElementById("full");
const fill = () => document.documentElement.requestFullscreen?.().catch(() => {});
full.addEventListener("click", fill);
addEventListener("keydown", ({ key }) => {
  if (key === "f" || key === "F") fill();
});
addEventListener("resize", redraw);
