// The operator's charts: strip charts of the last seconds, and measured and predicted torque of a trial.
import { surface } from "./link.js";

/// Duration shown in a strip chart, s.
const SPAN_S = 20;
/// Room for the numbers on the left.
const MARGIN = 46;

const style = getComputedStyle(document.documentElement);
const colour = (name) => style.getPropertyValue(`--${name}`).trim();

/// A round step that divides a range into about `parts` parts.
function step(range, parts) {
  const rough = range / parts;
  const power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].find((factor) => factor * power >= rough) * power;
}

function frame(canvas, [low, high], unit) {
  const { pen, width, height } = surface(canvas);
  const y = (value) => height - 6 - ((value - low) / (high - low)) * (height - 22);
  pen.font = '11px system-ui, "DejaVu Sans", sans-serif';
  pen.textBaseline = "middle";
  pen.textAlign = "right";
  pen.lineWidth = 1;
  const tick = step(high - low, Math.max(2, height / 42));
  const places = Math.max(0, -Math.floor(Math.log10(tick) + 1e-9));
  for (let value = Math.ceil(low / tick) * tick; value <= high + 1e-9; value += tick) {
    pen.strokeStyle = colour("grid");
    pen.beginPath();
    pen.moveTo(MARGIN, y(value));
    pen.lineTo(width, y(value));
    pen.stroke();
    pen.fillStyle = colour("soft");
    pen.fillText(value.toFixed(places).replace("-0", "0").replace("-", "−"), MARGIN - 6, y(value));
  }
  pen.textAlign = "left";
  pen.fillStyle = colour("ink");
  pen.fillText(unit, MARGIN + 4, 7);
  return { pen, width, height, y };
}

/// The bins of the last seconds.
export class Strips {
  constructor(band) {
    this.bins = [];
    this.band = band;
  }

  clear() {
    this.bins = [];
  }

  add(bins) {
    for (const bin of bins) {
      // The recording went back in time.
      if (this.bins.length && bin.t_s < this.bins.at(-1).t_s) this.bins = [];
      this.bins.push(bin);
    }
    const from = (this.bins.at(-1)?.t_s ?? 0) - SPAN_S - 1;
    const stale = this.bins.findIndex((bin) => bin.t_s >= from);
    if (stale > 500) this.bins.splice(0, stale);
  }

  draw(canvases, now, limits) {
    const end = Math.max(now.t_s, SPAN_S);
    const seen = this.bins.filter((bin) => bin.t_s > end - SPAN_S);
    const most = (values, least) => values.reduce((a, b) => Math.max(a, b), least);
    const targets = seen.map((bin) => bin.target_nm ?? 0);
    const torque = most(seen.map((bin) => bin.torque_nm[1]).concat(targets), 1) * 1.08;
    const least = Math.min(0, ...seen.map((bin) => bin.torque_nm[0]));
    this.torque(frame(canvases.torque, [least * 1.08, torque], "torque, N m"), seen, end, now.band_fraction);
    const angle = frame(canvases.angle, limits.angle_rad, "angle, rad");
    this.line(angle, seen, end, (bin) => bin.angle_rad, colour("c1"));
    const emg = most(seen.flatMap((bin) => bin.emg_mvc), 0.2) * 1.08;
    const muscles = frame(canvases.emg, [0, emg], "EMG, MVC:");
    this.line(muscles, seen, end, (bin) => [bin.emg_mvc[1], bin.emg_mvc[1]], colour("c4"));
    this.line(muscles, seen, end, (bin) => [bin.emg_mvc[0], bin.emg_mvc[0]], colour("c2"));
    const { pen } = muscles;
    for (const [at, name, ink] of [[70, "FCR", "c2"], [98, "ECR", "c4"]]) {
      pen.fillStyle = colour(ink);
      pen.fillText(name, MARGIN + at, 7);
    }
  }

  x({ width }, end, t) {
    return MARGIN + ((t - end + SPAN_S) / SPAN_S) * (width - MARGIN);
  }

  torque(view, seen, end, band) {
    const { pen, y } = view;
    const wide = Math.max(1, this.x(view, end, 0.012) - this.x(view, end, 0));
    for (const bin of seen) {
      if (bin.target_nm === null) continue;
      const [low, high] = [y(bin.target_nm * (1 - band)), y(bin.target_nm * (1 + band))];
      const at = this.x(view, end, bin.t_s);
      pen.globalAlpha = 0.25 + 0.6 * bin.gate;
      pen.fillStyle = colour("c3");
      pen.fillRect(at, Math.min(low, high), wide, Math.max(2, Math.abs(low - high)));
    }
    pen.globalAlpha = 1;
    this.line(view, seen, end, (bin) => bin.torque_nm, colour("ink"));
  }

  /// Draws a line from the lowest to the highest value of each bin, and on to the next bin.
  line(view, seen, end, extremes, ink) {
    const { pen, y } = view;
    pen.strokeStyle = ink;
    pen.lineWidth = 1.4;
    pen.lineJoin = "round";
    pen.beginPath();
    let before = null;
    for (const bin of seen) {
      const at = this.x(view, end, bin.t_s);
      const [low, high] = extremes(bin);
      if (before === null || bin.t_s - before > 0.05) pen.moveTo(at, y(low));
      else pen.lineTo(at, y(low));
      if (high !== low) pen.lineTo(at, y(high));
      before = bin.t_s;
    }
    pen.stroke();
  }
}

/// Measured and predicted torque in the window of a trial.
export function drawCurve(canvas, fit) {
  if (!fit?.measured_nm) return surface(canvas);
  const all = [...fit.measured_nm, ...fit.predicted_nm];
  const [low, high] = [Math.min(0, ...all), Math.max(...all)];
  const view = frame(canvas, [low * 1.05, high * 1.05], `N m, ${Math.round(fit.measured_nm.length * fit.period_s * 1e3)} ms from the onset`);
  const { pen, width, y } = view;
  const last = fit.measured_nm.length;
  const x = (sample) => MARGIN + (sample / last) * (width - MARGIN - 4);
  const draw = (values, ink, wide, dash) => {
    pen.strokeStyle = ink;
    pen.lineWidth = wide;
    pen.setLineDash(dash);
    pen.beginPath();
    values.forEach((value, place) => pen.lineTo(x(place + 1), y(value)));
    pen.stroke();
    pen.setLineDash([]);
  };
  draw(fit.measured_nm, colour("ink"), 2.4, []);
  draw(fit.predicted_nm, colour("c2"), 2, [5, 4]);
  pen.textAlign = "right";
  pen.fillStyle = colour("c2");
  pen.fillText("model", width - 4, 7 + 14);
}

// The colours follow the light or dark mode of the screen.
export const onColours = (redraw) => matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
