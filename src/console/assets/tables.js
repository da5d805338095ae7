// The tables of maximal efforts, trials and conditions. Values come as text, with the uncertainty and the marks of the report.
const by = (id) => document.getElementById(id);

/// Quantities of the table of trials and of that of conditions.
const OF_TRIALS = ["k_srs_nm_per_rad", "x_e_rad", "vaf"];
const OF_CONDITIONS = ["k_srs_nm_per_rad", "k_dec_nm_per_rad", "x_e_rad", "x_t_s", "vaf"];

/// A value with its uncertainty is broken before the uncertainty, if at all.
const unbroken = (text) => String(text).replace("± ", "±\u00a0");

const cells = (row, values) => {
  for (const value of values) row.insertCell().textContent = unbroken(value);
  return row;
};

/// Heads of quantities: symbol, with the unit below it.
function heads(names, quantities) {
  return names.map((name) => {
    const { sign, unit, meaning } = quantities.find((own) => own.name === name);
    const head = document.createElement("th");
    head.scope = "col";
    head.title = meaning;
    head.append(sign);
    if (unit) {
      const small = document.createElement("small");
      small.textContent = unit.replaceAll(" ", "\u00a0");
      head.append(document.createElement("br"), small);
    }
    return head;
  });
}

/// Writes the heads of quantities behind those that the page has.
export function writeHeads(quantities) {
  for (const [id, names] of [["trial-heads", OF_TRIALS], ["condition-heads", OF_CONDITIONS]]) {
    const row = by(id);
    row.querySelectorAll(".quantity").forEach((head) => head.remove());
    const made = heads(names, quantities);
    made.forEach((head) => head.classList.add("quantity"));
    row.append(...made);
  }
}

/// Latency of the reflex response of a trial in ms: of one without a response a dash, of one without EMG nothing.
export const latency = ({ response_s: response }) => (response === undefined ? "" : response === null ? "–" : (1e3 * response).toFixed(1));

const name = (trial) => `${trial.practice ? "p" : ""}${trial.number}`;

export function tellTrials({ trials, queue }, mark) {
  const rows = by("trial-rows");
  const made = document.createElement("tbody");
  // The column is there where EMG is measured.
  const hasEmg = trials.some((trial) => "response_s" in trial);
  by("latency-head").hidden = !hasEmg;
  for (const trial of trials) {
    const row = made.insertRow();
    const outcome = trial.status ?? "under way";
    row.className = trial.status ?? "now";
    const reason = trial.status && trial.status !== "ok" ? ` (${trial.reason.replaceAll("_", " ")})` : "";
    const values = OF_TRIALS.map((quantity) => trial.shown?.[quantity] ?? "");
    if (trial.no_fit) values[OF_TRIALS.length - 1] = "no fit";
    const reflex = hasEmg ? [latency(trial)] : [];
    cells(row, [name(trial), trial.velocity_rad_s, trial.torque_nm, outcome + reason, ...reflex, ...values]);
    row.title = trial.no_fit ?? "";
    row.cells[3].className = "words";
  }
  queue.forEach((trial, place) => {
    const row = made.insertRow();
    row.className = "next";
    const again = trial.rejections ? ", again" : "";
    const when = place ? `${place + 1} of ${queue.length}${again}` : `next${again}`;
    cells(row, [trial.practice ? "p" : "", trial.velocity_rad_s, trial.torque_nm, when, ...(hasEmg ? [""] : []), ...OF_TRIALS.map(() => "")]);
    row.cells[3].className = "words";
  });
  const place = rows.closest(".scroll");
  rows.replaceChildren(...made.rows);
  // Keeps the latest trial in view, unless the operator has scrolled away.
  const latest = rows.rows[Math.max(0, trials.length - 1)];
  if (latest && !place.matches(":hover,:focus")) place.scrollTop = latest.offsetTop - place.clientHeight / 2;
  const isMarked = trials.some((trial) => Object.values(trial.shown ?? {}).some((text) => text.includes("*")));
  by("trial-note").textContent = isMarked ? `± standard error; ${mark}` : "± standard error";
}

export function tellConditions({ conditions, fitted_together: together }) {
  const made = document.createElement("tbody");
  for (const { velocity_rad_s: velocity, torque_nm: torque, repetitions, shown } of conditions) {
    // A mean over fewer trials than the condition has says so, on a line of its own.
    const values = OF_CONDITIONS.map((quantity) => shown[quantity].replace(" (n", "\n(n"));
    cells(made.insertRow(), [torque, velocity, repetitions, ...values]);
  }
  by("condition-rows").replaceChildren(...made.rows);
  by("condition-note").textContent = `mean ± ${together ? "its standard error" : "SD"} of the trials so far`;
}

/// The maximal efforts stand in the place of the conditions until there are some.
export function tellEfforts({ efforts, efforts_left: left, conditions }) {
  const made = document.createElement("tbody");
  for (const effort of efforts) {
    const row = made.insertRow();
    row.className = effort.is_best ? "ok" : "";
    const result = effort.is_best ? "best" : "";
    cells(row, [effort.number, effort.direction, effort.peak_torque_nm.toFixed(2), effort.peak_emg.toFixed(3), result]);
    row.cells[1].className = "words";
  }
  const rows = by("effort-rows");
  const isMore = made.rows.length > rows.rows.length;
  rows.replaceChildren(...made.rows);
  if (isMore) rows.closest(".scroll").scrollTop = rows.scrollHeight;
  by("effort-note").textContent = left ? `${left} to come` : "all done";
  const isShown = conditions.length === 0 && efforts.length + left > 0;
  by("efforts").hidden = !isShown;
  by("conditions").hidden = isShown;
}

/// The best torque of each direction, in a few words.
export function bestEfforts(efforts) {
  const best = ["flexion", "extension"].map((direction) => {
    const own = efforts.filter((effort) => effort.direction === direction).map((effort) => effort.peak_torque_nm);
    return own.length ? `${direction} ${own.reduce((a, b) => (Math.abs(a) > Math.abs(b) ? a : b)).toFixed(1)}` : "";
  });
  return best.filter(Boolean).join(", ");
}
