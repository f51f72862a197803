// The zones of a page while a person corrects them, with undo. A zone: id, box, label, confidence, text, kind.

const LEAST_SIZE = 4; // pixels of a box
const copy = (zones) => zones.map((zone) => ({ ...zone, box: [...zone.box] }));

export class Zones extends EventTarget {
  constructor(result) {
    super();
    this.width = result.width;
    this.height = result.height;
    this.found = copy([...result.zones].sort((a, b) => a.order - b.order));
    this.list = copy(this.found);
    this.past = [];
    this.future = [];
    this.made = 0;
  }

  find(id) {
    return this.list.find((zone) => zone.id === id);
  }

  /** Does something to the zones that can be undone; `what` says it. */
  change(what, act, isSameStep = false) {
    if (!isSameStep) this.past.push({ what, zones: copy(this.list) });
    this.future = [];
    const selected = act();
    this.dispatchEvent(new CustomEvent("change", { detail: { what, selected } }));
  }

  setLabel(id, label) {
    if (this.find(id).label === label) return;
    this.change(`label ${label ?? "none"}`, () => Object.assign(this.find(id), { label, confidence: 1 }).id);
  }

  setText(id, text) {
    if ((this.find(id).text ?? "") === text) return;
    this.change("text", () => Object.assign(this.find(id), { text }).id);
  }

  /** A box inside the page, at least a few pixels wide. */
  inside([x0, y0, x1, y1]) {
    const clamp = (value, size) => Math.min(Math.max(value, 0), size);
    const [left, right] = [clamp(Math.min(x0, x1), this.width - LEAST_SIZE), clamp(Math.max(x0, x1), this.width)];
    const [top, bottom] = [clamp(Math.min(y0, y1), this.height - LEAST_SIZE), clamp(Math.max(y0, y1), this.height)];
    const box = [left, top, Math.max(right, left + LEAST_SIZE), Math.max(bottom, top + LEAST_SIZE)];
    return box.map((value) => Math.round(value * 10) / 10);
  }

  setBox(id, box, isSameStep) {
    this.change("box", () => Object.assign(this.find(id), { box: this.inside(box), isChanged: true }).id, isSameStep);
  }

  add(box) {
    const zone = { id: `new-${++this.made}`, box: this.inside(box), label: null, confidence: 1, text: null, kind: "text", isNew: true };
    const after = this.list.findIndex((other) => other.box[1] > zone.box[1]);
    this.change("new zone", () => {
      this.list.splice(after < 0 ? this.list.length : after, 0, zone);
      return zone.id;
    });
  }

  remove(id) {
    const index = this.list.indexOf(this.find(id));
    this.change("zone deleted", () => {
      this.list.splice(index, 1);
      return this.list[Math.min(index, this.list.length - 1)]?.id;
    });
  }

  /** Cuts a zone in two, one above the other or side by side. */
  split(id, isAcross = false) {
    const zone = this.find(id);
    const [x0, y0, x1, y1] = zone.box;
    const [first, second] = isAcross
      ? [[x0, y0, (x0 + x1) / 2, y1], [(x0 + x1) / 2, y0, x1, y1]]
      : [[x0, y0, x1, (y0 + y1) / 2], [x0, (y0 + y1) / 2, x1, y1]];
    const part = { ...zone, id: `new-${++this.made}`, box: this.inside(second), text: null, isNew: true };
    this.change("zone split", () => {
      Object.assign(zone, { box: this.inside(first), text: null, isChanged: true });
      this.list.splice(this.list.indexOf(zone) + 1, 0, part);
      return part.id;
    });
  }

  /** Puts a zone together with the next one in reading order. */
  merge(id) {
    const index = this.list.indexOf(this.find(id));
    const [zone, next] = [this.list[index], this.list[index + 1]];
    if (!next) return;
    const [a, b] = [zone.box, next.box];
    this.change("zones merged", () => {
      const box = [Math.min(a[0], b[0]), Math.min(a[1], b[1]), Math.max(a[2], b[2]), Math.max(a[3], b[3])];
      const text = [zone.text, next.text].filter(Boolean).join("\n") || null;
      Object.assign(zone, { box, text, isChanged: true });
      this.list.splice(index + 1, 1);
      return zone.id;
    });
  }

  /** Moves a zone in the reading order, by -1 or 1. */
  reorder(id, by) {
    const index = this.list.indexOf(this.find(id));
    const place = index + by;
    if (place < 0 || place >= this.list.length) return;
    this.change("reading order", () => {
      const [zone] = this.list.splice(index, 1);
      this.list.splice(place, 0, zone);
      return Object.assign(zone, { isChanged: true }).id;
    });
  }

  undo() {
    this.travel(this.past, this.future);
  }

  redo() {
    this.travel(this.future, this.past);
  }

  travel(from, to) {
    const step = from.pop();
    if (!step) return;
    to.push({ what: step.what, zones: copy(this.list) });
    this.list = copy(step.zones);
    this.dispatchEvent(new CustomEvent("change", { detail: { what: `undone: ${step.what}` } }));
  }

  /** What a feedback says of the zones: their labels alone, where the person left boxes and texts as they were. */
  feedback() {
    const known = new Map(this.found.map((zone) => [zone.id, zone]));
    const isSame = this.list.length === this.found.length && this.list.every((zone) => !zone.isNew && !zone.isChanged);
    const hasTexts = this.list.some((zone) => (zone.text ?? "") !== (known.get(zone.id)?.text ?? ""));
    if (isSame && !hasTexts) return { labels: Object.fromEntries(this.list.map((zone) => [zone.id, zone.label])) };
    const zones = this.list.map(({ id, box, label, text, kind, isNew }) => ({
      ...(isNew ? {} : { id }),
      box,
      label,
      ...(text ? { text } : {}),
      ...(kind ? { kind } : {}),
    }));
    return { zones };
  }
}
