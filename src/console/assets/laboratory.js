// The page between the sessions of a laboratory: what is chosen for the next one, its checks, and the sessions there are. It
// sends names of the lists only, and shows as chosen what the program says is chosen.
const by = (id) => document.getElementById(id);
const NAMES = { subject: "Subject", protocol: "Protocol", rig: "Rig", calibration: "Calibration" };
const SIGNS = { passed: "✓", failed: "✗", open: "○" };

function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

export class Laboratory {
  constructor(send) {
    this.send = send;
    this.isConnected = false;
    this.view = null;
    /// What each part of the page was made of, so that a list that is open is not made anew under the operator's hand.
    this.made = {};
    by("begin").addEventListener("click", () => {
      this.send({ begin: { number: this.view.number } });
    });
  }

  /// Disables what needs the program: what is chosen without it would not be checked.
  connected(isConnected) {
    this.isConnected = isConnected;
    if (this.view) this.able();
  }

  show(view) {
    this.view = view;
    this.make("choices", view.choices.map(({ part, entries, is_optional }) => [part, entries, is_optional]), () =>
      view.choices.map((choice) => this.list(choice)));
    for (const { part, chosen } of view.choices) by(`choose-${part}`).value = chosen ?? "";
    this.make("checks", view.checks, () => view.checks.map(check));
    const { notice } = view;
    by("notice").hidden = !notice;
    by("notice").textContent = notice?.text ?? "";
    by("notice").className = notice?.is_alarm ? "alarm" : "done";
    this.make("sessions", view.sessions, () => (view.sessions ?? []).map((own) => this.session(own)));
    by("session-note").textContent = view.sessions === null ? "being read" : String(view.sessions.length || "none yet");
    this.able();
  }

  able() {
    const { may_begin: mayBegin, is_beginning: isBeginning } = this.view;
    document.querySelectorAll("#choices select").forEach((select) => {
      select.disabled = !this.isConnected || isBeginning;
    });
    document.querySelectorAll("#sessions button").forEach((button) => {
      button.disabled = !this.isConnected || isBeginning;
    });
    by("begin").disabled = !this.isConnected || !mayBegin;
    by("begin-note").textContent = isBeginning
      ? "The session is being made."
      : mayBegin
        ? "Nothing moves yet: the session waits, disarmed, until you arm and start it."
        : "All checks must have passed.";
  }

  make(id, content, make) {
    const key = JSON.stringify(content);
    if (this.made[id] === key) return;
    this.made[id] = key;
    by(id).replaceChildren(...make());
  }

  list({ part, entries, is_optional: isOptional }) {
    const none = isOptional ? "none" : entries.length ? `choose a ${part}` : `there is no ${part}`;
    const lines = entries.map(({ name, about }) =>
      element("option", { value: name, textContent: about ? `${name} (${about})` : name }));
    const select = element("select", { id: `choose-${part}` }, element("option", { value: "", textContent: none }), ...lines);
    select.addEventListener("change", () => this.send({ choose: { part, name: select.value || null } }));
    return element("label", {}, element("span", { textContent: NAMES[part] }), select);
  }

  session({ session: name, started_utc: began, subject, trials, state, reasons }) {
    const row = document.createElement("tr");
    row.className = `state-${state}`;
    row.title = reasons.join("\n");
    const when = began?.replace("T", " ").replace(/:\d\dZ$/, "") ?? "–";
    for (const value of [name, when, subject ?? "–", trials.join("/"), state]) row.insertCell().textContent = value;
    for (const place of [0, 1, 2, 4]) row.cells[place].className = "words";
    if (state === "unfinished") {
      const resume = element("button", { type: "button", textContent: "Resume" });
      resume.setAttribute("aria-label", `resume ${name}`);
      resume.addEventListener("click", () => this.send({ resume: { session: name } }));
      row.cells[4].append(" ", resume);
    }
    return row;
  }
}

function check({ name, outcome, text }) {
  const sign = element("b", { textContent: SIGNS[outcome] });
  sign.setAttribute("role", "img");
  sign.setAttribute("aria-label", outcome);
  return element("li", { className: outcome }, sign, element("span", { className: "what", textContent: name }), element("span", { textContent: text }));
}
