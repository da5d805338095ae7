// The state machine, drawn from the program's own table: phases in the order of a session, forward transitions on the
// right, backward transitions on the left.
const SVG = "http://www.w3.org/2000/svg";
const [WIDE, TALL, GAP, MIDDLE, VIEW] = [98, 19, 5, 150, 320];

function part(name, attributes, parent) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  parent.append(element);
  return element;
}

export class Machine {
  constructor(svg, phases, transitions) {
    svg.replaceChildren();
    svg.setAttribute("viewBox", `0 0 ${VIEW} ${phases.length * (TALL + GAP) + GAP}`);
    this.transitions = transitions;
    this.ways = new Map();
    this.phases = new Map();
    const y = (phase) => GAP + phases.indexOf(phase) * (TALL + GAP) + TALL / 2;
    const lines = part("g", {}, svg);
    for (const { from, to, event } of transitions) {
      const key = `${from} ${to}`;
      if (from === to || this.ways.has(key)) continue;
      const forward = y(to) > y(from);
      const steps = Math.abs(phases.indexOf(to) - phases.indexOf(from));
      const edge = MIDDLE + (forward ? WIDE / 2 : -WIDE / 2);
      const reach = edge + (forward ? 1 : -1) * (10 + 10.5 * steps);
      const d = `M${edge} ${y(from) + 3} C${reach} ${y(from)} ${reach} ${y(to)} ${edge} ${y(to) - 3}`;
      const kind = ["fault", "abort"].includes(event) ? "" : "way";
      this.ways.set(key, { kind, path: part("path", { d, class: kind }, lines) });
    }
    for (const phase of phases) {
      const group = part("g", {}, svg);
      part("rect", { x: MIDDLE - WIDE / 2, y: y(phase) - TALL / 2, width: WIDE, height: TALL, rx: 6 }, group);
      part("text", { x: MIDDLE, y: y(phase) }, group).textContent = phase;
      this.phases.set(phase, group);
    }
    this.svg = svg;
  }

  show(phase, before) {
    for (const [key, { kind, path }] of this.ways) {
      const [from] = key.split(" ");
      const taken = key === `${before} ${phase}` ? "taken" : "";
      path.setAttribute("class", from === phase ? "from" : taken || kind);
    }
    const reach = new Set(this.transitions.filter((way) => way.from === phase).map((way) => way.to));
    for (const [name, group] of this.phases) {
      group.setAttribute("class", name === phase ? "here" : reach.has(name) ? "reach" : "");
    }
    this.svg.setAttribute("aria-label", `phase ${phase}; from here: ${this.next(phase)}`);
  }

  /// Transitions from a phase that need no operator and no fault.
  next(phase) {
    const own = this.transitions.filter((way) => way.from === phase && !["operator", "rig"].includes(way.by));
    return [...new Set(own.map((way) => `${way.event} → ${way.to}`))].join(", ");
  }
}
