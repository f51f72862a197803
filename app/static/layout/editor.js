// A recognized page, its zones, and what a person says about them: class, labels, boxes, text.

import { button, labelled, make, notify, percent, problemNote, select, setOptions } from "../elements.js";
import { get, post, Problem, request } from "../service.js";
import { LabelKeys } from "./label_keys.js";
import { learnedNote } from "./learned.js";
import { PageViewer } from "./page_viewer.js";
import { Zones } from "./zones.js";

const NONE = ""; // value of an option that means null
const OTHER = "\u0000other";
const ASK = "\u0000ask"; // no class was found, and the person has not said which it is
const MOVE = 4; // pixels of the page by an arrow key with Alt
const HELP =
  "On a zone: Tab or arrow keys go to another one; a digit or first letters give it a label, 0 none; Delete removes it; " +
  "Alt and arrow keys move its box, with Shift they change its size. Ctrl Z takes the last change back, Ctrl Enter confirms.";

export class PageEditor {
  /**
   * `actions` are further buttons beside Confirm; `onConfirmed` is called with the answer to the feedback, `onResult` with
   * the result as feedback has left it. `submit(name, zones)` takes the place of the feedback, for pages that have no result; it resolves to what is shown then.
   */
  constructor({ actions = [], onConfirmed, onResult, submit } = {}) {
    Object.assign(this, { onConfirmed, onResult, submit });
    this.viewer = new PageViewer();
    this.keys = new LabelKeys();
    this.label = select([], null, () => this.chooseLabel());
    this.otherLabel = labelled("Another name", make("input", { type: "text", maxlength: 100, onkeydown: (event) => this.nameLabel(event) }));
    this.text = make("textarea", { onchange: () => this.zones.setText(this.selected, this.text.value) });
    this.class_ = select([], null, () => this.chooseClass());
    this.otherClass = labelled("Name of the new kind", make("input", { type: "text", maxlength: 60, pattern: "[A-Za-z0-9_\\-][A-Za-z0-9._\\-]{0,59}" }), "Letters, digits, dots, hyphens and underscores.");
    this.sides = ["Left", "Top", "Right", "Bottom"].map((side, index) =>
      labelled(side, make("input", { type: "number", step: "any", onchange: (event) => this.setSide(index, Number(event.target.value)) })),
    );
    this.zoneFacts = make("p", { class: "zone-facts" });
    this.confirm = button("Confirm", () => this.send(), "primary");
    this.undoButton = button("Undo", () => this.zones.undo());
    this.redoButton = button("Redo", () => this.zones.redo());
    this.drawing = button("Draw zone", () => this.drawZone());
    this.drawing.setAttribute("aria-pressed", "false");
    this.takeBack = button("Take the feedback back", () => this.undoFeedback());
    this.answer = make("div", { class: "answer" });
    this.empty = make("p", { class: "empty" }, "Select a zone.");
    this.zonePanel = make("fieldset", {}, make("legend", {}, "Zone"), this.empty, this.zoneControls());
    const bar = make("div", { class: "row tools" }, this.drawing, button("Add zone", () => this.zones.add(this.viewer.middle())), this.undoButton, this.redoButton,
      button("Enlarge", () => this.viewer.zoom(1.4)), button("Reduce", () => this.viewer.zoom(1 / 1.4)), button("Whole view", () => this.viewer.fit()));
    const side = make("div", { class: "side" }, labelled("Class", this.class_), this.otherClass, this.zonePanel,
      make("p", { class: "row" }, this.confirm, actions), this.answer, make("details", {}, make("summary", {}, "Keys"), make("p", {}, HELP)));
    this.element = make("section", { class: "editor", "aria-label": "Zones", onkeydown: (event) => this.press(event) }, make("div", { class: "main-side" }, bar, this.viewer.element), side);
    this.viewer.addEventListener("select", (event) => this.show(event.detail));
    this.viewer.addEventListener("zonekey", (event) => this.pressOnZone(event.detail));
    this.viewer.addEventListener("drawn", () => this.drawZone(false));
  }

  zoneControls() {
    const edit = (act) => () => this.selected && act(this.selected);
    this.controls = make("div", { hidden: true },
      labelled("Label", this.label), this.otherLabel, this.zoneFacts, labelled("Text", this.text),
      make("div", { class: "sides" }, this.sides),
      make("p", { class: "row" },
        button("Split", edit((id) => this.zones.split(id))),
        button("Split across", edit((id) => this.zones.split(id, true))),
        button("Merge with next", edit((id) => this.zones.merge(id))),
        button("Delete", edit((id) => this.zones.remove(id))),
        button("Earlier", edit((id) => this.zones.reorder(id, -1))),
        button("Later", edit((id) => this.zones.reorder(id, 1)))));
    this.otherLabel.hidden = true;
    this.otherClass.hidden = true;
    return this.controls;
  }

  /** Shows a LayoutResult; `picture` is its address, null for a white page. */
  async open(result, picture) {
    Object.assign(this, { result, picture });
    this.zones = new Zones(result);
    this.selected = null;
    this.viewer.selected = null;
    this.answer.replaceChildren();
    this.models = (await get("layout/models")).models;
    this.listClasses();
    this.listLabels();
    await this.viewer.open(picture, this.zones);
    this.zones.addEventListener("change", (event) => this.changed(event.detail));
    this.changed({});
    this.show(null);
  }

  get foundClass() {
    return this.result.class?.name ?? null;
  }

  listClasses() {
    const likely = new Map(this.result.classes.map(({ name, probability }) => [name, probability]));
    const names = [...likely.keys(), ...this.models.map(({ name }) => name).filter((name) => !likely.has(name))];
    const options = names.map((name) => [name, likely.has(name) ? `${name} (${percent(likely.get(name))})` : name]);
    const none = this.result.classes.length ? ` (${percent(this.result.unknown_probability)})` : "";
    const isKnown = this.foundClass !== null || this.result.found; // a person may have said that it is none of these
    const ask = isKnown ? [] : [[ASK, "choose its class…"]];
    setOptions(this.class_, [...ask, ...options, [NONE, `none of these${none}`], [OTHER, "another name…"]], isKnown ? (this.foundClass ?? NONE) : ASK);
    this.otherClass.hidden = true;
  }

  /** Labels of the chosen class and of the page, in the model's order. */
  listLabels() {
    const model = this.models.find(({ name }) => name === this.class_.value);
    const onPage = this.zones.list.map(({ label }) => label).filter((label) => label !== null);
    this.labels = [...new Set([...(model?.labels ?? []), ...onPage])];
    const value = this.selected ? (this.zones.find(this.selected)?.label ?? NONE) : NONE;
    setOptions(this.label, [...this.labels.map((label, index) => [label, index < 9 ? `${index + 1} ${label}` : label]), [NONE, "0 no label"], [OTHER, "another name…"]], value);
  }

  chooseClass() {
    this.otherClass.hidden = this.class_.value !== OTHER;
    if (this.class_.value === OTHER) this.otherClass.querySelector("input").focus();
    this.listLabels();
  }

  chooseLabel() {
    this.otherLabel.hidden = this.label.value !== OTHER;
    if (this.label.value === OTHER) this.otherLabel.querySelector("input").focus();
    else if (this.selected) this.zones.setLabel(this.selected, this.label.value === NONE ? null : this.label.value);
  }

  nameLabel(event) {
    const name = event.target.value.trim();
    if (event.key !== "Enter" || !name || !this.selected) return;
    event.preventDefault();
    event.stopPropagation();
    event.target.value = "";
    this.zones.setLabel(this.selected, name);
    this.viewer.focus(this.selected);
  }

  setSide(index, value) {
    const box = [...this.zones.find(this.selected).box];
    box[index] = value;
    this.zones.setBox(this.selected, box);
  }

  drawZone(isOn = this.drawing.getAttribute("aria-pressed") !== "true") {
    this.drawing.setAttribute("aria-pressed", String(isOn));
    this.viewer.draw(isOn);
    if (isOn) notify("Drag over the picture. Without a pointer, use Add zone and the arrow keys with Alt.");
  }

  changed({ selected, what }) {
    this.viewer.update();
    this.undoButton.disabled = !this.zones.past.length;
    this.redoButton.disabled = !this.zones.future.length;
    this.listLabels();
    if (selected !== undefined) {
      this.viewer.select(selected);
      if (this.element.contains(document.activeElement) && !document.activeElement.closest(".side")) this.viewer.focus(selected);
    }
    this.show(this.zones.find(selected ?? this.selected) ? (selected ?? this.selected) : null);
    if (what) notify(what);
  }

  show(id) {
    this.selected = id;
    const zone = id && this.zones.find(id);
    this.controls.hidden = !zone;
    this.empty.hidden = Boolean(zone);
    if (!zone) return;
    this.label.value = zone.label ?? NONE;
    this.otherLabel.hidden = true;
    this.text.value = zone.text ?? "";
    this.sides.forEach((side, index) => (side.querySelector("input").value = zone.box[index]));
    const order = this.zones.list.indexOf(zone) + 1;
    const found = this.zones.found.find((other) => other.id === id);
    const sure = found && found.label === zone.label ? `, ${percent(found.confidence)} sure` : "";
    this.zoneFacts.textContent = `${order} of ${this.zones.list.length} in reading order${sure}`;
  }

  pressOnZone({ id, event }) {
    const arrows = { ArrowLeft: [-1, 0], ArrowUp: [0, -1], ArrowRight: [1, 0], ArrowDown: [0, 1] };
    const arrow = arrows[event.key];
    if (event.ctrlKey || event.metaKey) return;
    event.stopPropagation();
    if (arrow && event.altKey) this.moveBox(id, arrow, event.shiftKey);
    else if (arrow) this.step(id, arrow[0] + arrow[1]);
    else if (event.key === "Delete" || event.key === "Backspace") this.zones.remove(id);
    else {
      const label = this.keys.read(event.key, this.labels);
      if (label === undefined) return;
      this.zones.setLabel(id, label);
    }
    event.preventDefault();
  }

  moveBox(id, [dx, dy], isSize) {
    const [x0, y0, x1, y1] = this.zones.find(id).box;
    const box = isSize ? [x0, y0, x1 + dx * MOVE, y1 + dy * MOVE] : [x0 + dx * MOVE, y0 + dy * MOVE, x1 + dx * MOVE, y1 + dy * MOVE];
    this.zones.setBox(id, box);
  }

  step(id, by) {
    const { list } = this.zones;
    const next = list[list.findIndex((zone) => zone.id === id) + by];
    if (next) this.viewer.focus(next.id);
  }

  press(event) {
    if (!(event.ctrlKey || event.metaKey)) return;
    const isText = event.target.matches("textarea, input");
    if (event.key === "Enter") this.send();
    else if (event.key === "z" && !isText) event.shiftKey ? this.zones.redo() : this.zones.undo();
    else if (event.key === "y" && !isText) this.zones.redo();
    else return;
    event.preventDefault();
  }

  /** The chosen class, null for none of these; undefined after the person was asked for what is missing. */
  chosenClass() {
    const ask = (field, what) => {
      this.answer.replaceChildren(make("p", { class: "bad", role: "alert" }, what));
      field.focus();
    };
    if (this.class_.value === ASK) return ask(this.class_, "Which class is this page of? Choose one, or “none of these”, or give a new kind its name. Labels are learned by a class.");
    if (this.class_.value !== OTHER) return this.class_.value === NONE ? null : this.class_.value;
    const input = this.otherClass.querySelector("input");
    const name = input.value.trim();
    if (!name || !new RegExp(`^(?:${input.pattern})$`).test(name)) return ask(input, "The new kind needs a name of letters, digits, dots, hyphens and underscores, which does not begin with a dot. Nothing was sent.");
    return name;
  }

  /** Sends the feedback: the class and the zones as they are now. */
  async send() {
    if (this.isSending) return;
    const chosen = this.chosenClass();
    if (chosen === undefined) return;
    this.isSending = true;
    this.confirm.setAttribute("aria-disabled", "true");
    this.answer.replaceChildren(make("p", {}, "The models learn…"));
    try {
      if (this.submit) await this.hand(chosen);
      else await this.teach(chosen, this.class_.value === OTHER);
    } catch (error) {
      this.answer.replaceChildren(problemNote(error));
    } finally {
      this.isSending = false;
      this.confirm.removeAttribute("aria-disabled");
    }
  }

  /** Sends the feedback; a new class begins with the page. */
  async teach(name, isNew) {
    const path = `layout/results/${this.result.id}/feedback`;
    const feedback = await post(path, { class: name, ...(isNew ? { new_class: true } : {}), ...this.zones.feedback() });
    const isFirst = feedback.models.some((model) => model.name === name && model.old_version === null);
    const news = isNew && isFirst ? [make("p", {}, `The class ${name} is new.`)] : [];
    const note = await learnedNote(feedback);
    await this.reload();
    this.answer.replaceChildren(...news, note, make("p", {}, this.takeBack));
    notify("Confirmed.");
    this.onConfirmed?.(feedback);
  }

  /** Shows the result as it is now. */
  async reload() {
    const result = await get(`layout/results/${encodeURIComponent(this.result.id)}`);
    await this.open(result, this.picture);
    this.onResult?.(result);
  }

  async hand(name) {
    if (!name) throw new Problem({ code: "no-class", detail: "Choose a class, or give a new one its name." });
    this.answer.replaceChildren(await this.submit(name, this.labelledZones()));
  }

  /** The zones as a sample has them. */
  labelledZones() {
    return this.zones.list.map(({ id, box, label, text, kind, font_size, lines }) => ({ id, box, label, text, kind, font_size, lines }));
  }

  /** Removes the influence of this page from all models. */
  async undoFeedback() {
    try {
      const undone = await (await request("DELETE", `layout/results/${this.result.id}/feedback`)).json();
      const names = undone.models.map(({ name, new_version: version }) => `${name} (version ${version ?? "none"})`);
      await this.reload();
      this.answer.replaceChildren(make("p", {}, `Taken back. Changed: ${names.join(", ") || "no model"}.`));
      notify("The feedback is taken back.");
    } catch (error) {
      this.answer.append(problemNote(error));
    }
  }
}
