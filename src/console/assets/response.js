// The torque in the ramp: measured and predicted in the last fit, or the last ramps of a condition over each other.
import { colour, frame, inside, timeAxis } from "./axes.js";
import { surface } from "./link.js";

const range = (values) => values.reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [0, 0]);

function line({ pen, y }, x, values, ink, wide, { dash = [], from = 0, period, alpha = 1 }) {
  pen.strokeStyle = ink;
  pen.lineWidth = wide;
  pen.globalAlpha = alpha;
  pen.setLineDash(dash);
  pen.beginPath();
  values.forEach((value, place) => pen.lineTo(x(1e3 * (from + place * period)), y(value)));
  pen.stroke();
  pen.setLineDash([]);
  pen.globalAlpha = 1;
}

/// Legend in the upper left corner; the names have the colours of their lines.
function legend({ pen }, names) {
  let at = 54;
  for (const [name, ink] of names) {
    pen.fillStyle = ink;
    pen.fillText(name, at, 22);
    at += pen.measureText(name).width + 12;
  }
}

/// Measured and predicted torque in the window of a trial.
export function drawFit(canvas, fit) {
  if (!fit?.measured_nm) return surface(canvas);
  const [low, high] = range([...fit.measured_nm, ...fit.predicted_nm]);
  const view = frame(canvas, [low * 1.05, high * 1.2], "torque, N m", true);
  const x = timeAxis(view, [0, 1e3 * fit.measured_nm.length * fit.period_s], "ms");
  const at = { from: fit.period_s, period: fit.period_s };
  inside(view, () => {
    line(view, x, fit.measured_nm, colour("ink"), 2.4, at);
    line(view, x, fit.predicted_nm, colour("c2"), 2, { ...at, dash: [5, 4] });
  });
  legend(view, [["measured", colour("ink")], ["model", colour("c2")]]);
}

/// The last ramps of a condition over each other, the latest in front.
export function drawRamps(canvas, { before_s: before, window_s: windowS }, condition) {
  const { ramps, period_s: period, latest } = condition;
  const [low, high] = range(ramps.flatMap((ramp) => ramp.change_nm));
  const view = frame(canvas, [low * 1.05, high * 1.2], "change of torque, N m", true);
  const longest = Math.max(...ramps.map((ramp) => ramp.change_nm.length));
  const x = timeAxis(view, [-1e3 * before, 1e3 * (longest * period - before)], "ms");
  view.pen.fillStyle = colour("c1");
  view.pen.globalAlpha = 0.1;
  view.pen.fillRect(x(0), 16, x(1e3 * windowS) - x(0), view.bottom - 16);
  view.pen.globalAlpha = 1;
  const inks = ["c1", "c2", "c3", "c4", "soft", "shade"];
  // A ramp keeps its colour while others come and go.
  const ink = (ramp) => (ramp.trial === latest ? colour("ink") : colour(inks[ramp.repetition % inks.length]));
  inside(view, () => {
    for (const ramp of ramps) line(view, x, ramp.change_nm, ink(ramp), ramp.trial === latest ? 2.4 : 1.4, { from: -before, period });
  });
  legend(view, ramps.toReversed().map((ramp) => [ramp.trial === latest ? `trial ${ramp.trial}` : String(ramp.trial), ink(ramp)]));
}
