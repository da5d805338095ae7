// What all charts have in common: a frame with numbers on its left, and a time axis below.
import { surface } from "./link.js";

/// Room for the numbers on the left, and for those of a time axis below.
export const MARGIN = 46;
const BELOW = 16;

const style = getComputedStyle(document.documentElement);
export const colour = (name) => style.getPropertyValue(`--${name}`).trim();

// The colours follow the light or dark mode of the screen.
export const onColours = (redraw) => matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);

/// A round step that divides a range into about `parts` parts.
export function step(range, parts) {
  const rough = range / parts;
  const power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].find((factor) => factor * power >= rough) * power;
}

/// A number with as many places as a step needs.
const number = (value, tick) => value.toFixed(Math.max(0, -Math.floor(Math.log10(tick) + 1e-9))).replace(/^-(0\.?0*)$/, "$1").replace("-", "−");

const multiples = (low, high, tick) => {
  const first = Math.ceil(low / tick - 1e-9);
  return Array.from({ length: Math.max(0, Math.floor(high / tick + 1e-9) - first + 1) }, (_, place) => (first + place) * tick);
};

/// Clears a canvas and draws a frame for values from `low` to `high`; `below` leaves room for a time axis.
export function frame(canvas, [low, high], title, below = false) {
  const { pen, width, height } = surface(canvas);
  const bottom = height - 6 - (below ? BELOW : 0);
  const y = (value) => bottom - ((value - low) / (high - low)) * (bottom - 16);
  pen.font = '11px system-ui, "DejaVu Sans", sans-serif';
  pen.textBaseline = "middle";
  pen.textAlign = "right";
  pen.lineWidth = 1;
  const tick = step(high - low, Math.max(2, bottom / 42));
  for (const value of multiples(low, high, tick)) {
    pen.strokeStyle = colour("grid");
    pen.beginPath();
    pen.moveTo(MARGIN, y(value));
    pen.lineTo(width, y(value));
    pen.stroke();
    pen.fillStyle = colour("soft");
    pen.fillText(number(value, tick), MARGIN - 6, y(value));
  }
  pen.textAlign = "left";
  pen.fillStyle = colour("ink");
  pen.fillText(title, MARGIN + 4, 7);
  return { pen, width, height, bottom, y };
}

/// Draws a time axis from `low` to `high`, its numbers only where there is room for them; returns the place of a time.
export function timeAxis({ pen, width, height, bottom }, [low, high], unit) {
  const x = (time) => MARGIN + ((time - low) / (high - low)) * (width - MARGIN - 4);
  const tick = step(high - low, Math.max(2, width / 90));
  pen.textAlign = "center";
  for (const time of multiples(low, high, tick)) {
    pen.strokeStyle = colour("grid");
    pen.beginPath();
    pen.moveTo(x(time), 16);
    pen.lineTo(x(time), bottom);
    pen.stroke();
    if (height - bottom < BELOW || x(time) < MARGIN + 8 || x(time) > width - 40) continue;
    pen.fillStyle = colour("soft");
    pen.fillText(number(time, tick), x(time), height - 8);
  }
  if (height - bottom >= BELOW) {
    pen.textAlign = "right";
    pen.fillStyle = colour("soft");
    pen.fillText(unit, width - 4, height - 8);
  }
  pen.textAlign = "left";
  return x;
}

/// Keeps what `draw` draws inside the frame.
export function inside({ pen, width, bottom }, draw) {
  pen.save();
  pen.beginPath();
  pen.rect(MARGIN, 12, width - MARGIN, bottom - 10);
  pen.clip();
  draw();
  pen.restore();
}
