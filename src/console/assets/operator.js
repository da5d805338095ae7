// The operator's page: state of the session, history, controls.
import { Strips, drawCurve, onColours } from "./charts.js";
import { Controls } from "./controls.js";
import { connect } from "./link.js";
import { Machine } from "./machine.js";

const by = (id) => document.getElementById(id);
const strips = new Strips();
const canvases = { torque: by("torque"), angle: by("angle"), emg: by("emg") };
let hello = null;
let machine = null;
let now = null;
let sessionHistory = null;
let isOver = false;
let phases = [null, null];

const controls = new Controls((message) => send(message));
const send = connect(take, (state) => {
  isOver ||= state === "over";
  const words = { open: "connected", lost: "no connection", over: "session over" };
  controls.connected(state === "open");
  by("line").textContent = words[isOver ? "over" : state];
  by("line").className = `badge ${isOver ? "" : state === "open" ? "good" : "bad"}`;
});

function take(message) {
  if (message.kind === "hello") {
    hello = message;
    strips.clear();
    by("title").textContent = `${hello.subject} · ${hello.protocol}`;
    document.title = `${hello.subject}: ${hello.tape ? "recording" : "console"}`;
    by("facts").textContent = `${hello.rig}, ${hello.wrist} wrist, seed ${hello.seed}, ${hello.folder}`;
    machine = new Machine(by("states"), hello.phases, hello.transitions);
    phases = [null, null];
    controls.open(hello);
  } else if (message.kind === "story") {
    sessionHistory = message;
    tell();
  } else {
    now = message;
    strips.add(now.bins);
    redraw();
  }
}

let asked = false;
function redraw() {
  if (asked || !now || !hello) return;
  asked = true;
  requestAnimationFrame(() => {
    asked = false;
    draw();
  });
}

const text = (id, value) => {
  const place = by(id);
  if (place.textContent !== value) place.textContent = value;
};

function draw() {
  if (now.phase !== phases[1]) {
    phases = [phases[1], now.phase];
    machine.show(now.phase, phases[0]);
    text("next", machine.next(now.phase));
  }
  text("phase", now.phase);
  const rest = now.rest_left_s === null ? "" : `, ${Math.ceil(now.rest_left_s)} s left`;
  const { trial } = now;
  const under = trial && !trial.status ? `${trial.practice ? "practice" : "trial"} ${trial.number}` : "";
  text("trial", `${under}${rest}${now.pause_asked ? " · pause requested" : ""}`);
  text("progress", `${now.done} of ${now.total} done`);
  text("clock", `${now.t_s.toFixed(1)} s`);
  by("gate").value = now.gate;
  strips.draw(canvases, now, hello);
  controls.show(now);
}

const cells = (row, values) => {
  for (const value of values) row.insertCell().textContent = value;
  return row;
};
const fixed = (value, places, factor = 1) => (Number.isFinite(value) ? (value * factor).toFixed(places) : "");

function tell() {
  tellTrials();
  tellConditions();
  tellFit();
  tellLog();
  tellGauges();
}

function tellTrials() {
  const rows = by("trial-rows");
  const made = document.createElement("tbody");
  for (const trial of sessionHistory.trials) {
    const row = made.insertRow();
    const outcome = trial.status ?? "under way";
    row.className = trial.status ?? "now";
    const reason = trial.status && trial.status !== "ok" ? ` (${trial.reason})` : "";
    const fit = trial.fit ?? {};
    cells(row, [name(trial), trial.velocity_rad_s, trial.torque_nm, outcome + reason,
      fixed(fit.k_srs_nm_per_rad, 1), fixed(fit.x_e_rad, 1, 1e3), trial.no_fit ? "no fit" : fixed(fit.vaf, 4)]);
    row.title = trial.no_fit ?? "";
    row.cells[3].className = "words";
  }
  const left = sessionHistory.queue.length;
  sessionHistory.queue.forEach((trial, place) => {
    const row = made.insertRow();
    row.className = "next";
    const again = trial.rejections ? ", again" : "";
    cells(row, [trial.practice ? "p" : "", trial.velocity_rad_s, trial.torque_nm, place ? `${place + 1} of ${left}${again}` : `next${again}`, "", "", ""]);
    row.cells[3].className = "words";
  });
  const place = rows.parentElement.parentElement;
  rows.replaceChildren(...made.rows);
  // Keeps the latest trial in view, unless the operator has scrolled away.
  const latest = rows.rows[Math.max(0, sessionHistory.trials.length - 1)];
  if (latest && !place.matches(":hover,:focus")) place.scrollTop = latest.offsetTop - place.clientHeight / 2;
}

const name = (trial) => `${trial.practice ? "p" : ""}${trial.number}`;

function tellConditions() {
  const made = document.createElement("tbody");
  for (const { velocity_rad_s: velocity, torque_nm: torque, repetitions, mean, sd } of sessionHistory.conditions) {
    const spread = (key, places, factor) => {
      const value = fixed(mean[key], places, factor);
      return value && fixed(sd[key], places, factor) ? `${value} ± ${fixed(sd[key], places, factor)}` : value;
    };
    cells(made.insertRow(), [torque, velocity, repetitions, spread("k_srs_nm_per_rad", 1), spread("k_dec_nm_per_rad", 1),
      spread("x_e_rad", 1, 1e3), spread("x_t_s", 1, 1e3), fixed(mean.vaf, 4)]);
  }
  by("condition-rows").replaceChildren(...made.rows);
}

const VALUES = [
  ["VAF", "vaf", 4, 1, ""],
  ["k_srs", "k_srs_nm_per_rad", 1, 1, "N m/rad"],
  ["k_dec", "k_dec_nm_per_rad", 1, 1, "N m/rad"],
  ["x_e", "x_e_rad", 1, 1e3, "mrad"],
  ["x_t", "x_t_s", 1, 1e3, "ms"],
  ["I_j", "i_j_kg_m2", 2, 1e3, "g m²"],
  ["b_h", "b_h_nm_s_per_rad", 2, 1, "N m s/rad"],
  ["k_h", "k_h_nm_per_rad", 0, 1, "N m/rad"],
];

/// A value with its standard error, if there is one.
function estimated(fit, [term, key, places, factor, unit]) {
  const [value, se] = [fit.values[key], fit.se[key]];
  // A standard error as large as the value: the trial alone does not determine it.
  const error = !Number.isFinite(se) ? "" : se < 1 ? ` ± ${fixed(se * value, places, factor)}` : " ± ?";
  return [term, `${fixed(value, places, factor)}${error} ${unit}`];
}

function list(id, rows) {
  by(id).replaceChildren(...rows.map(([term, value, isBad]) => {
    const row = document.createElement("div");
    const [dt, dd] = [document.createElement("dt"), document.createElement("dd")];
    dt.textContent = term;
    dd.textContent = value;
    if (isBad) dd.className = "bad";
    row.append(dt, dd);
    return row;
  }));
}

function tellFit() {
  const fit = sessionHistory.last_fit;
  const condition = fit?.values ? `: ${fit.velocity_rad_s} rad/s, ${fit.torque_nm} N m` : "";
  text("fit-of", fit ? `trial ${fit.trial}${condition}` : "no trial yet");
  by("curve").setAttribute("aria-label", fit?.values ? `measured torque of trial ${fit.trial} and the torque predicted by the model, VAF ${fixed(fit.values.vaf, 4)}` : "no fit yet");
  list("values", fit?.values ? VALUES.map((own) => estimated(fit, own)) : []);
  text("remarks", fit ? fit.reason ?? fit.remarks.join("; ") : "");
  // After the layout of the elements beside it.
  drawCurve(by("curve"), fit);
}

function tellLog() {
  const place = by("lines").parentElement;
  const atEnd = place.scrollTop + place.clientHeight > place.scrollHeight - 30;
  by("lines").replaceChildren(...sessionHistory.log.map((line) => {
    const row = document.createElement("li");
    const [time, what] = [document.createElement("time"), document.createElement("span")];
    row.className = line.kind;
    time.textContent = `${line.t_s.toFixed(1)} s`;
    what.textContent = line.clock ? `${line.text} (${line.clock.slice(11, 16)})` : line.text;
    row.append(time, what);
    return row;
  }));
  if (atEnd) place.scrollTop = place.scrollHeight;
}

function tellGauges() {
  const gauges = sessionHistory.gauges;
  const rows = [];
  if (gauges.periods) {
    rows.push(["lateness, 99th percentile", `${gauges.late_p99_us} µs`], ["lateness, maximum", `${gauges.latest_us} µs`], ["missed periods", String(gauges.missed)]);
  }
  if (gauges.bus_load !== null) {
    rows.push(["bus load", `${(100 * gauges.bus_load).toFixed(0)} %`], ["bus errors", String(gauges.bus_errors), gauges.bus_errors > 0]);
  }
  if (gauges.disk_free_bytes !== null) {
    const free = gauges.disk_free_bytes / 1e9;
    rows.push(["free disk space", `${free.toFixed(free < 10 ? 1 : 0)} GB`, free < 1]);
  }
  if (gauges.screen) rows.push(["torque to screen, 99th percentile", `${gauges.screen.p99_ms.toFixed(0)} ms`]);
  if (now?.left_out) rows.push(["samples not shown", String(now.left_out)]);
  const alarms = sessionHistory.log.filter((line) => line.kind === "alarm");
  rows.push(["alarms", String(alarms.length), alarms.length > 0]);
  list("gauges", rows);
}

addEventListener("resize", () => {
  redraw();
  if (sessionHistory) drawCurve(by("curve"), sessionHistory.last_fit);
});
onColours(() => {
  redraw();
  if (sessionHistory) drawCurve(by("curve"), sessionHistory.last_fit);
});
