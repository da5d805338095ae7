// The strip charts of the last seconds: torque against its band, angle, EMG. The operator chooses signals, time and zoom.
import { colour, frame, inside, MARGIN, timeAxis } from "./axes.js";

/// Longest time that is kept, s; the program keeps as much.
const KEPT_S = 60;
/// Without a gap two bins are this far apart at most, s.
const GAP_S = 0.05;

/// Range of the torque axis. Before the trials it follows the torque; in a trial the band must be readable, so the target is near
/// the top, whatever an effort or an earlier ramp reached before it.
export function torqueRange(zoom, seen, { band_fraction: band, phase }) {
  const target = seen.findLast((bin) => bin.target_nm !== null)?.target_nm ?? null;
  if (zoom === "band" && target !== null) {
    const edges = [target * (1 - 5 * band), target * (1 + 5 * band)];
    return [Math.min(...edges), Math.max(...edges)];
  }
  const isBefore = phase === "offset" || phase.startsWith("mvc");
  const follows = zoom === "all" || target === null || isBefore;
  const shown = follows ? seen : seen.slice(lastTrial(seen));
  const reached = [0, ...(follows || target === null ? [] : [1.3 * target]), ...shown.flatMap((bin) => bin.torque_nm)];
  const [low, high] = reached.reduce(([a, b], value) => [Math.min(a, value), Math.max(b, value)], [0, 0]);
  // Noise about zero fills no chart.
  return [1.05 * low - 0.02 * (high - low), Math.max(1.05 * high, low + 0.5)];
}

/// Place of the first bin of the latest trial.
function lastTrial(seen) {
  let place = seen.findLastIndex((bin) => bin.target_nm !== null);
  while (place > 0 && seen[place - 1].target_nm !== null) place -= 1;
  return place;
}

export class Strips {
  constructor(canvases, choices) {
    this.canvases = canvases;
    this.choices = choices;
    this.bins = [];
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
    const from = (this.bins.at(-1)?.t_s ?? 0) - KEPT_S - 1;
    const stale = this.bins.findIndex((bin) => bin.t_s >= from);
    if (stale > 500) this.bins.splice(0, stale);
  }

  draw(now, limits) {
    const { span, zoom, signals } = this.choices();
    const end = Math.max(now.t_s, span);
    const seen = this.bins.filter((bin) => bin.t_s > end - span);
    const last = ["emg", "angle", "torque"].find((name) => signals.has(name));
    const chart = (name, range, title) => {
      const view = frame(this.canvases[name], range, title, name === last);
      view.x = timeAxis(view, [end - span, end], "s");
      return view;
    };
    for (const [name, canvas] of Object.entries(this.canvases)) canvas.hidden = !signals.has(name);
    if (signals.has("torque")) {
      const target = now.target_nm === null ? "" : ` of ${now.target_nm} ± ${(Math.abs(now.target_nm) * now.band_fraction).toFixed(3)}`;
      const view = chart("torque", torqueRange(zoom, seen, now), `torque ${now.torque_nm.toFixed(2).replace(/^-(0\.00)$/, "$1").replace("-", "−")}${target} N m`);
      inside(view, () => this.torque(view, seen, now.band_fraction));
    }
    if (signals.has("angle")) {
      const view = chart("angle", limits.angle_rad, "angle, rad");
      inside(view, () => this.line(view, seen, (bin) => bin.angle_rad, colour("c1")));
    }
    if (signals.has("emg")) {
      // The EMG of a muscle that is not measured is null.
      const measured = [0, 1].map((muscle) => seen.filter((bin) => bin.emg_mvc[muscle] !== null));
      const most = seen.reduce((most, bin) => Math.max(most, ...bin.emg_mvc), 0.2) * 1.08;
      const view = chart("emg", [0, most], measured.some((bins) => bins.length) || !seen.length ? "EMG, MVC:" : "EMG: not measured");
      inside(view, () => {
        this.line(view, measured[1], (bin) => [bin.emg_mvc[1], bin.emg_mvc[1]], colour("c4"));
        this.line(view, measured[0], (bin) => [bin.emg_mvc[0], bin.emg_mvc[0]], colour("c2"));
      });
      for (const [at, name, ink, muscle] of [[70, "FCR", "c2", 0], [98, "ECR", "c4", 1]]) {
        if (!measured[muscle].length) continue;
        view.pen.fillStyle = colour(ink);
        view.pen.fillText(name, MARGIN + at, 7);
      }
    }
  }

  torque(view, seen, band) {
    const { pen, x, y } = view;
    const wide = Math.max(1, x(0.012) - x(0));
    for (const bin of seen) {
      if (bin.target_nm === null) continue;
      const [a, b] = [y(bin.target_nm * (1 - band)), y(bin.target_nm * (1 + band))];
      pen.globalAlpha = 0.25 + 0.6 * bin.gate;
      pen.fillStyle = colour("c3");
      pen.fillRect(x(bin.t_s), Math.min(a, b), wide, Math.max(2, Math.abs(a - b)));
    }
    pen.globalAlpha = 1;
    this.line(view, seen, (bin) => bin.torque_nm, colour("ink"));
  }

  /// Draws a line from the lowest to the highest value of each bin, and on to the next bin.
  line({ pen, x, y }, seen, extremes, ink) {
    pen.strokeStyle = ink;
    pen.lineWidth = 1.4;
    pen.lineJoin = "round";
    pen.beginPath();
    let before = null;
    for (const bin of seen) {
      const [low, high] = extremes(bin);
      if (before === null || bin.t_s - before > GAP_S) pen.moveTo(x(bin.t_s), y(low));
      else pen.lineTo(x(bin.t_s), y(low));
      if (high !== low) pen.lineTo(x(bin.t_s), y(high));
      before = bin.t_s;
    }
    pen.stroke();
  }
}
