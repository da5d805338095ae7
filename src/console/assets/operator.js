// The operator's page: state of the session, history, controls.
import { onColours } from "./axes.js";
import { Controls } from "./controls.js";
import { Laboratory } from "./laboratory.js";
import { connect } from "./link.js";
import { Machine } from "./machine.js";
import { drawFit, drawRamps } from "./response.js";
import { Strips } from "./strips.js";
import { bestEfforts, latency, tellConditions, tellEfforts, tellTrials, writeHeads } from "./tables.js";

const by = (id) => document.getElementById(id);
const strips = new Strips({ torque: by("torque"), angle: by("angle"), emg: by("emg") }, () => ({
  span: Number(by("span").value),
  zoom: by("zoom").value,
  signals: new Set([...by("signals").querySelectorAll("input:checked")].map((input) => input.value)),
}));
let hello = null;
let machine = null;
let now = null;
let sessionHistory = null;
let ramps = null;
let isOver = false;
let phases = [null, null];

const controls = new Controls((message) => send(message));
const laboratory = new Laboratory((message) => send(message));
let link = "lost";
const send = connect(take, (state) => {
  link = state;
  isOver ||= state === "over";
  controls.connected(state === "open");
  laboratory.connected(state === "open");
  tellLink();
});

function tellLink() {
  const words = { open: "connected", lost: "no connection", over: hello ? "session over" : "the program has ended" };
  by("line").textContent = words[isOver ? "over" : link];
  by("line").className = `badge ${isOver ? "" : link === "open" ? "good" : "bad"}`;
}

function take(message) {
  if (message.kind === "laboratory") {
    takeLaboratory(message.laboratory);
  } else if (message.kind === "hello") {
    hello = message;
    isOver = false;
    [now, sessionHistory, ramps] = [null, null, null];
    by("shown").replaceChildren(new Option("last fit", ""));
    strips.clear();
    show("session");
    tellLink();
    by("title").textContent = `${hello.subject} · ${hello.protocol}`;
    document.title = `${hello.subject}: ${hello.tape ? "recording" : "console"}`;
    by("facts").textContent = `${hello.rig}, ${hello.wrist} wrist, seed ${hello.seed}, ${hello.folder}`;
    machine = new Machine(by("states"), hello.phases, hello.transitions);
    phases = [null, null];
    writeHeads(hello.quantities);
    controls.open(hello);
  } else if (message.kind === "story") {
    sessionHistory = message;
    tell();
  } else if (message.kind === "ramps") {
    ramps = message;
    tellRamps();
  } else {
    now = message;
    strips.add(now.bins);
    redraw();
  }
}

/// The view of a laboratory. A session that was watched stays in sight until the operator goes on.
function takeLaboratory(view) {
  laboratory.show(view);
  if (hello && isOver) return;
  if (!hello) return showLaboratory();
  isOver = true;
  tellLink();
  controls.end(view.notice ?? { text: "The session is over.", is_alarm: false }, () => {
    hello = null;
    isOver = false;
    showLaboratory();
  });
}

function showLaboratory() {
  by("title").textContent = "Laboratory";
  document.title = "Ramphold: laboratory";
  by("facts").textContent = laboratory.view.folder;
  show("laboratory");
  tellLink();
}

/// Shows the session or the laboratory.
function show(main) {
  const isSession = main === "session";
  by("session").hidden = !isSession;
  by("laboratory").hidden = isSession;
  for (const id of ["controls", "phase", "trial", "progress", "clock"]) by(id).hidden = !isSession;
}

let asked = false;
function redraw() {
  if (asked || !now || !hello) return;
  asked = true;
  requestAnimationFrame(() => {
    asked = false;
    // A session may have begun since.
    if (now) draw();
  });
}

const text = (id, value) => {
  const place = by(id);
  if (place.textContent !== value) place.textContent = value;
};

/// A time that is not known better than to minutes.
const about = (time) => (time < 60 ? `${Math.ceil(time / 10) * 10} s` : `${Math.round(time / 60)} min`);

function draw() {
  if (now.phase !== phases[1]) {
    phases = [phases[1], now.phase];
    machine.show(now.phase, phases[0]);
    text("next", machine.next(now.phase));
    if (sessionHistory) tellGauges();
  }
  text("phase", now.phase.replaceAll("_", " "));
  by("phase").className = `badge strong ${now.phase === "faulted" ? "bad" : ""}`;
  const rest = now.rest_left_s === null ? "" : `, ${Math.ceil(now.rest_left_s)} s left`;
  const { trial } = now;
  const under = trial && !trial.status ? `${trial.practice ? "practice" : "trial"} ${trial.number}` : "";
  text("trial", `${under}${rest}${now.pause_asked ? " · pause requested" : ""}`.replace(/^, /, ""));
  const left = now.time_left_s === null || now.is_over ? "" : `, about ${about(now.time_left_s)} to go`;
  const rig = now.rig_trials;
  const rigDone = rig ? `rig trials ${rig.done} of ${rig.total}${rig.current ? ` (${rig.current})` : ""}, ` : "";
  text("progress", `${rigDone}${now.done} of ${now.total} done${left}`);
  by("mount").hidden = !rig?.instruction;
  text("mount", rig?.instruction ?? "");
  text("clock", `${now.t_s.toFixed(1)} s`);
  by("gate").value = now.gate;
  strips.draw(now, hello);
  controls.show(now);
}

function tell() {
  tellTrials(sessionHistory, hello?.mark ?? "");
  tellEfforts(sessionHistory);
  tellConditions(sessionHistory);
  tellResponse();
  tellLog();
  tellGauges();
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

const conditionName = (condition) => `${condition.torque_nm} N m, ${condition.velocity_rad_s} rad/s`;

/// Offers each condition that has ramps; the choice stays.
function tellRamps() {
  const select = by("shown");
  const chosen = select.value;
  const option = (value, label) => Object.assign(document.createElement("option"), { value, textContent: label });
  const conditions = ramps.conditions.map(conditionName);
  select.replaceChildren(option("", "last fit"), ...conditions.map((name) => option(name, `ramps at ${name}`)));
  select.value = conditions.includes(chosen) ? chosen : "";
  tellResponse();
}

function tellResponse() {
  const condition = ramps?.conditions.find((own) => conditionName(own) === by("shown").value);
  const fit = condition ? null : sessionHistory?.last_fit;
  const values = fit?.values && hello ? hello.quantities.map(({ name, sign, unit }) => [sign, `${fit.shown[name]} ${unit}`]) : [];
  const trial = values.length ? sessionHistory.trials.find((own) => own.number === fit.trial && !own.practice) : null;
  if (trial && "response_s" in trial) values.push(["reflex", `${latency(trial)} ms`]);
  list("values", values);
  if (condition) {
    const trials = condition.ramps.map((ramp) => ramp.trial).join(", ");
    text("fit-of", `last ${condition.ramps.length}`);
    text("remarks", `Torque from its mean before the onset; the analysed window is shaded.`);
    by("curve").setAttribute("aria-label", `torque of the ramps of trials ${trials}, over each other`);
    return drawRamps(by("curve"), ramps, condition);
  }
  text("fit-of", fit ? `trial ${fit.trial}${fit.values ? `: ${conditionName(fit)}` : ""}` : "no trial yet");
  text("remarks", fit ? fit.reason ?? fit.remarks.join("; ") : "");
  by("curve").setAttribute("aria-label", fit?.values ? `measured torque of trial ${fit.trial} and the torque predicted by the model, VAF ${fit.shown.vaf}` : "no fit yet");
  // After the layout of the elements beside it.
  drawFit(by("curve"), fit);
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
  const { gauges, efforts, log } = sessionHistory;
  const rows = [["alarms", String(gauges.alarms), gauges.alarms > 0]];
  if (gauges.periods) {
    rows.push(["lateness, 99 %", `${gauges.late_p99_us} µs`], ["at most", `${gauges.latest_us} µs`], ["missed cycles", String(gauges.missed), gauges.missed > 0]);
  }
  if (gauges.bus_load !== null) {
    rows.push(["bus load", `${(100 * gauges.bus_load).toFixed(0)} %`], ["bus errors", String(gauges.bus_errors), gauges.bus_errors > 0]);
  }
  if (gauges.disk_free_bytes !== null) {
    const free = gauges.disk_free_bytes / 1e9;
    rows.push(["free disk", `${free.toFixed(free < 10 ? 1 : 0)} GB`, free < 1]);
  }
  if (gauges.screen) rows.push(["torque to screen, 99 %", `${gauges.screen.p99_ms.toFixed(0)} ms`]);
  if (now?.left_out) rows.push(["samples not shown", String(now.left_out)]);
  if (efforts.length) rows.push(["maximal torque", `${bestEfforts(efforts)} N m`]);
  list("gauges", rows);
  // The fault that stopped the session stays in sight until it is mended.
  const alarm = now?.phase === "faulted" ? log.findLast((line) => line.kind === "alarm") : null;
  by("alarm").hidden = !alarm;
  text("alarm", alarm?.text ?? "");
}

const drawAll = () => {
  redraw();
  tellResponse();
};
for (const id of ["signals", "span", "zoom"]) by(id).addEventListener("change", redraw);
by("shown").addEventListener("change", tellResponse);
addEventListener("resize", drawAll);
onColours(drawAll);
