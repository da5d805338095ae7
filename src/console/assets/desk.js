// Buttons and keys. They say the same; what moves the motor or cannot be taken back is asked for a second time.
const WORDS = [
  { key: "s", word: "start", label: "Arm and start", question: "The motor will be given power. Is everyone clear of it?", look: "go" },
  { key: "s", word: "rearm", label: "Arm again", question: "Is the cause mended? The motor will move to the start.", look: "go" },
  { key: " ", word: "resume", label: "Go on", look: "go" },
  { key: " ", word: "pause", label: "Pause now" },
  { key: "e", request: "pause_after_trial", label: "Pause after the trial", needs: "pause" },
  { key: "k", word: "skip", label: "Skip", question: "Leave this trial out?" },
  { key: "b", word: "repeat", label: "Repeat last", question: "Does the last trial not count?" },
  { key: "x", word: "abort", label: "End session", question: "End the session now?", look: "stop" },
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

/// A button that is there to be pressed; one of a question just answered may still have the focus.
const isButton = (target) => target instanceof HTMLButtonElement && !target.closest("dialog");

/// The local time with its place in the world, as a laboratory notes it.
function clock() {
  const now = new Date();
  const local = new Date(now.getTime() - now.getTimezoneOffset() * 60000).toISOString().slice(0, 19);
  const minutes = -now.getTimezoneOffset();
  const two = (number) => String(Math.floor(Math.abs(number))).padStart(2, "0");
  return `${local}${minutes < 0 ? "-" : "+"}${two(minutes / 60)}:${two(minutes % 60)}`;
}

export class Desk {
  constructor(send) {
    this.send = send;
    this.now = null;
    this.isConnected = false;
    this.foot = document.getElementById("desk");
    this.sure = document.getElementById("sure");
    this.help = document.getElementById("help");
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

  /// Once it is known whether a session runs or a recording is played.
  open(hello) {
    this.hello = hello;
    this.isTape = hello.tape !== null;
    document.getElementById("note-form").hidden = this.isTape;
    this.foot.replaceChildren(...(this.isTape ? this.tape() : this.words()), this.helper());
    const keys = this.isTape
      ? [["Space", "play, stop"], ["← →", "5 s back, on"], ["↑ ↓", "faster, slower"]]
      : [...WORDS.map(({ key, label }) => [named(key), label]), ["N", "write a note"]];
    const rows = [...keys, ["?", "this list"]].map(([key, what]) =>
      element("div", {}, element("dt", {}, element("kbd", {}, key)), element("dd", {}, what)));
    document.getElementById("keys").replaceChildren(...rows);
  }

  words() {
    this.buttons = WORDS.map((own) => {
      const button = element("button", { type: "button", class: own.look ?? "", onclick: () => this.choose(own) },
        own.label, element("kbd", { "aria-hidden": "true" }, named(own.key)));
      button.setAttribute("aria-keyshortcuts", named(own.key));
      button.dataset.word = own.word ?? own.request;
      return { own, button };
    });
    return this.buttons.map(({ button }) => button);
  }

  helper() {
    return element("button", { type: "button", "aria-label": "keys", onclick: () => this.help.showModal() }, "?");
  }

  tape() {
    this.play = element("button", { type: "button", class: "go", id: "play", onclick: () => this.toggle() }, "Play");
    this.speed = element("select", { id: "speed", onchange: () => this.setSpeed(Number(this.speed.value)) },
      ...SPEEDS.map((speed) => element("option", { value: speed }, `${speed} ×`)));
    const length = this.hello.tape.length_s;
    this.slider = element("input", { type: "range", id: "place", min: 0, max: length, step: 0.1, "aria-label": "place in the recording",
      oninput: () => this.seek(Number(this.slider.value)) });
    this.time = element("span", { class: "tape-time" });
    return [this.play, element("label", {}, "speed", this.speed), element("span", { class: "wide" }, this.slider), this.time];
  }

  /// Without a line nothing can be asked for: a word that is late is worse than one that has to be said again.
  connected(isConnected) {
    this.isConnected = isConnected;
    if (this.now) this.show(this.now);
  }

  show(now) {
    this.now = now;
    if (this.isTape) return this.showTape(now);
    for (const { own, button } of this.buttons ?? []) {
      button.disabled = !this.isPossible(own);
      // Start and arm again are one key; the one that makes no sense is not in the way.
      if (own.word === "rearm") button.hidden = now.phase !== "faulted";
      if (own.word === "start") button.hidden = now.phase === "faulted";
      if (own.word === "resume") button.hidden = now.phase !== "paused";
      if (own.word === "pause") button.hidden = now.phase === "paused";
    }
  }

  showTape({ t_s: t, tape }) {
    this.play.firstChild.textContent = tape.is_playing ? "Stop" : "Play";
    if (document.activeElement !== this.speed) this.speed.value = tape.speed;
    if (!this.sought) this.slider.value = t;
    this.time.textContent = `${t.toFixed(1)} of ${tape.length_s.toFixed(1)} s`;
  }

  isPossible({ word, needs }) {
    return this.isConnected && !this.now?.is_over && this.now?.possible.includes(word ?? needs);
  }

  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || this.sure.open || this.help.open) return;
    const { key, target } = event;
    if (target === this.note) {
      if (key === "Escape") this.note.blur();
      return;
    }
    if (key === "?") return this.help.showModal();
    const typed = key.length === 1 ? key.toLowerCase() : key;
    if (this.isTape ? this.pressTape(typed, target) : this.pressWord(typed, target)) event.preventDefault();
  }

  pressWord(key, target) {
    // The space bar presses the button that has the focus.
    if (key === " " && isButton(target)) return false;
    if (key === "n") {
      this.note.focus();
      return true;
    }
    const own = WORDS.find((candidate) => candidate.key === key && this.isPossible(candidate));
    if (own) this.choose(own);
    return own !== undefined;
  }

  pressTape(key, target) {
    if (target === this.slider || target === this.speed) return false;
    if (key === " " && !isButton(target)) this.toggle();
    else if (key === "ArrowLeft") this.seek(this.now.t_s - 5);
    else if (key === "ArrowRight") this.seek(this.now.t_s + 5);
    else if (key === "ArrowUp" || key === "ArrowDown") {
      const place = SPEEDS.indexOf(this.now.tape.speed) + (key === "ArrowUp" ? 1 : -1);
      if (SPEEDS[place]) this.setSpeed(SPEEDS[place]);
    } else return false;
    return true;
  }

  choose({ word, request, question }) {
    if (request) return this.send(request);
    if (!question) return this.send({ word: { word } });
    document.getElementById("question").textContent = question;
    const ways = this.hello.transitions.filter((way) => way.from === this.now.phase && way.event === word);
    document.getElementById("effect").textContent = [...new Set(ways.map((way) => way.does).filter(Boolean))].join(", or ");
    // Not when the dialog is closed: that is told later, and the next key's word would overtake this one.
    this.sure.querySelector("form").onsubmit = ({ submitter }) => {
      if (submitter.value === "yes") this.send({ word: { word, sure: true } });
    };
    this.sure.showModal();
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
    // Where the slider was let go counts, not every place that it went over.
    this.sought = setTimeout(() => {
      this.send({ seek: { t_s } });
      this.sought = setTimeout(() => {
        this.sought = null;
      }, 400);
    }, 60);
  }
}
