// Buttons and keys of the operator. The program says which commands ask a question first, and what it is.
const COMMANDS = [
  { key: "s", command: "start", label: "Arm and start", style: "go" },
  { key: "s", command: "rearm", label: "Arm again", style: "go" },
  { key: " ", command: "resume", label: "Resume", style: "go" },
  { key: " ", command: "pause", label: "Pause now" },
  { key: "e", request: "pause_after_trial", label: "Pause after the trial", needs: "pause" },
  { key: "k", command: "skip", label: "Skip" },
  { key: "b", command: "repeat_effort", label: "One more effort" },
  { key: "b", command: "repeat", label: "Repeat last" },
  { key: "x", command: "abort", label: "End session", style: "stop" },
];
const SPEEDS = [0.25, 0.5, 1, 2, 5, 10, 50];
const named = (key) => (key === " " ? "Space" : key.toUpperCase());

function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

/// Whether the target is a button outside a dialog; a dialog that was just closed may still have the focus.
const isButton = (target) => target instanceof HTMLButtonElement && !target.closest("dialog");

/// Local time of day with its offset from UTC, in ISO 8601.
function clock() {
  const now = new Date();
  const local = new Date(now.getTime() - now.getTimezoneOffset() * 60000).toISOString().slice(0, 19);
  const minutes = -now.getTimezoneOffset();
  const two = (number) => String(Math.floor(Math.abs(number))).padStart(2, "0");
  return `${local}${minutes < 0 ? "-" : "+"}${two(minutes / 60)}:${two(minutes % 60)}`;
}

export class Controls {
  constructor(send) {
    this.send = send;
    this.now = null;
    this.isConnected = false;
    this.foot = document.getElementById("controls");
    this.confirmDialog = document.getElementById("confirm");
    this.help = document.getElementById("help");
    this.machine = document.getElementById("machine");
    this.note = document.getElementById("note");
    document.getElementById("note-form").addEventListener("submit", (event) => {
      event.preventDefault();
      const text = this.note.value.trim();
      if (text) send({ note: { text, clock: clock() } });
      this.note.value = "";
      this.note.blur();
    });
    addEventListener("keydown", (event) => this.press(event));
  }

  /// Builds the controls of a running session or of a recording.
  open(hello) {
    this.hello = hello;
    this.isRecording = hello.tape !== null;
    document.getElementById("note-form").hidden = this.isRecording;
    this.foot.replaceChildren(...(this.isRecording ? this.playbackControls() : this.commandButtons()), this.machineButton(), this.helpButton());
    const keys = this.isRecording
      ? [["Space", "play, stop"], ["← →", "5 s back, forward"], ["↑ ↓", "faster, slower"]]
      : [...COMMANDS.map(({ key, label }) => [named(key), label]), ["N", "write a note"]];
    const rows = [...keys, ["G", "state graph"], ["?", "this list"]].map(([key, what]) =>
      element("div", {}, element("dt", {}, element("kbd", {}, key)), element("dd", {}, what)));
    document.getElementById("keys").replaceChildren(...rows);
  }

  /// The session of a laboratory is over: what came of it, and the way back.
  end({ text, is_alarm: isAlarm }, back) {
    this.now = null;
    document.getElementById("note-form").hidden = true;
    for (const dialog of [this.confirmDialog, this.help, this.machine]) dialog.close();
    const button = element("button", { type: "button", class: "go", id: "back", onclick: back }, "To the next session");
    this.foot.replaceChildren(element("span", { id: "over", role: "status", class: isAlarm ? "alarm" : "" }, text), button);
    button.focus();
  }

  commandButtons() {
    this.buttons = COMMANDS.map((own) => {
      const button = element("button", { type: "button", class: own.style ?? "", onclick: () => this.choose(own) },
        own.label, element("kbd", { "aria-hidden": "true" }, named(own.key)));
      button.setAttribute("aria-keyshortcuts", named(own.key));
      button.dataset.command = own.command ?? own.request;
      return { own, button };
    });
    return this.buttons.map(({ button }) => button);
  }

  machineButton() {
    return element("button", { type: "button", id: "graph", onclick: () => this.toggleMachine() }, "State graph", element("kbd", { "aria-hidden": "true" }, "G"));
  }

  /// The graph lies beside the charts; all keys go on working, so that a pause needs no other key first.
  toggleMachine() {
    if (this.machine.open) this.machine.close();
    else this.machine.show();
    document.activeElement?.blur();
  }

  helpButton() {
    return element("button", { type: "button", "aria-label": "keys", onclick: () => this.help.showModal() }, "?");
  }

  playbackControls() {
    this.play = element("button", { type: "button", class: "go", id: "play", onclick: () => this.toggle() }, "Play");
    this.speed = element("select", { id: "speed", onchange: () => this.setSpeed(Number(this.speed.value)) },
      ...SPEEDS.map((speed) => element("option", { value: speed }, `${speed} ×`)));
    const length = this.hello.tape.length_s;
    this.slider = element("input", { type: "range", id: "place", min: 0, max: length, step: 0.1, "aria-label": "time in the recording",
      oninput: () => this.seek(Number(this.slider.value)) });
    this.time = element("span", { class: "tape-time" });
    return [this.play, element("label", {}, "speed", this.speed), element("span", { class: "wide" }, this.slider), this.time];
  }

  /// Disables the buttons while there is no connection: a late command is worse than one that must be repeated.
  connected(isConnected) {
    this.isConnected = isConnected;
    if (this.now) this.show(this.now);
  }

  show(now) {
    this.now = now;
    if (this.isRecording) return this.showPlayback(now);
    for (const { own, button } of this.buttons ?? []) {
      button.disabled = !this.isPossible(own);
      // Start and arm again share a key, as do resume and pause, and what is repeated; only the one that applies is shown.
      if (own.command === "rearm") button.hidden = now.phase !== "faulted";
      if (own.command === "start") button.hidden = now.phase === "faulted";
      // The session also waits for the operator while a load is mounted.
      const waits = now.phase === "paused" || Boolean(now.rig_trials?.instruction);
      if (own.command === "resume") button.hidden = !waits;
      if (own.command === "pause") button.hidden = waits;
      const repeatsEffort = now.possible.includes("repeat_effort");
      if (own.command === "repeat_effort") button.hidden = !repeatsEffort;
      if (own.command === "repeat") button.hidden = repeatsEffort;
    }
  }

  showPlayback({ tape }) {
    this.play.firstChild.textContent = tape.is_playing ? "Stop" : "Play";
    if (document.activeElement !== this.speed) this.speed.value = tape.speed;
    if (!this.sought) this.slider.value = tape.position_s;
    this.time.textContent = `${tape.position_s.toFixed(1)} of ${tape.length_s.toFixed(1)} s`;
  }

  isPossible({ command, needs }) {
    return this.isConnected && !this.now?.is_over && this.now?.possible.includes(command ?? needs);
  }

  press(event) {
    // Between two sessions there is nothing to command.
    if (!this.now) return;
    if (event.ctrlKey || event.metaKey || event.altKey || this.confirmDialog.open || this.help.open) return;
    const { key, target } = event;
    if (target === this.note) {
      if (key === "Escape") this.note.blur();
      return;
    }
    if (key === "?") return this.help.showModal();
    if (key === "g" || key === "G") return this.toggleMachine();
    const typed = key.length === 1 ? key.toLowerCase() : key;
    if (this.isRecording ? this.pressPlaybackKey(typed, target) : this.pressCommandKey(typed, target)) event.preventDefault();
  }

  pressCommandKey(key, target) {
    // The space bar presses the button that has the focus.
    if (key === " " && isButton(target)) return false;
    if (key === "n") {
      this.note.focus();
      return true;
    }
    const own = COMMANDS.find((candidate) => candidate.key === key && this.isPossible(candidate));
    if (own) this.choose(own);
    return own !== undefined;
  }

  pressPlaybackKey(key, target) {
    if (target === this.slider || target === this.speed) return false;
    if (key === " " && !isButton(target)) this.toggle();
    else if (key === "ArrowLeft") this.seek(this.now.tape.position_s - 5);
    else if (key === "ArrowRight") this.seek(this.now.tape.position_s + 5);
    else if (key === "ArrowUp" || key === "ArrowDown") {
      const place = SPEEDS.indexOf(this.now.tape.speed) + (key === "ArrowUp" ? 1 : -1);
      if (SPEEDS[place]) this.setSpeed(SPEEDS[place]);
    } else return false;
    return true;
  }

  choose({ command, request }) {
    if (request) return this.send(request);
    const question = this.now.questions[command];
    // What asks nothing needs no answer.
    if (!question) return this.send({ word: { word: command, sure: true } });
    document.getElementById("question").textContent = question;
    // On submit rather than on close: the close event comes later, and the next key's command could overtake this one.
    this.confirmDialog.querySelector("form").onsubmit = ({ submitter }) => {
      if (submitter.value === "yes") this.send({ word: { word: command, sure: true } });
    };
    this.confirmDialog.showModal();
  }

  toggle() {
    this.setSpeed(Number(this.speed.value), !this.now.tape.is_playing);
  }

  setSpeed(speed, plays = this.now.tape.is_playing) {
    this.speed.value = speed;
    this.send({ play: { speed, plays } });
  }

  seek(t) {
    const t_s = Math.max(0, Math.min(t, this.hello.tape.length_s));
    this.slider.value = t_s;
    clearTimeout(this.sought);
    // Seeks where the slider stops, not at every value in between.
    this.sought = setTimeout(() => {
      this.send({ seek: { t_s } });
      this.sought = setTimeout(() => {
        this.sought = null;
      }, 400);
    }, 60);
  }
}
