// A polygon round the text, drawn on the photo by pointer or keyboard. It guides the search for text.

import { button, draw, make, notify } from "../elements.js";
import { inPicture, pointOf } from "./overlay.js";

const FEWEST = 3;
const MOST = 200;
const STEP = 0.02; // of the photo's size: an arrow key; with Shift a quarter of it

/** Draws a polygon over `stage`, which holds a photo of `width` x `height` pixels. */
export class Region {
  constructor(stage, svg, width, height) {
    Object.assign(this, { stage, svg, width, height, points: [], cursor: [width / 2, height / 2], isOn: false });
    this.group = draw("g", { class: "region" });
    this.surface = make("div", {
      class: "region-surface",
      role: "application",
      "aria-label": "Region: arrow keys move the mark, Enter sets a corner, Backspace removes one",
      tabindex: "0",
      hidden: true,
      onclick: (event) => this.add(pointOf(event, this.surface, this.width, this.height)),
      onkeydown: (event) => this.press(event),
    });
    this.start = button("Draw region", () => this.toggle());
    this.clear = button("Clear region", () => this.set([]));
    this.clear.hidden = true;
    this.tools = make("span", { class: "row" }, this.start, this.clear);
    stage.append(this.surface);
  }

  toggle() {
    this.isOn = !this.isOn;
    this.surface.hidden = !this.isOn;
    this.start.textContent = this.isOn ? "Region is complete" : "Draw region";
    if (this.isOn) {
      this.surface.focus();
      notify("Click the corners of the region, or use the arrow keys and Enter.");
    } else if (this.points.length && this.points.length < FEWEST) {
      this.set([]);
      notify("A region needs at least three corners.");
    }
    this.show();
  }

  add(point) {
    if (this.points.length >= MOST) return;
    this.cursor = point;
    this.set([...this.points, point]);
  }

  press(event) {
    const step = STEP * Math.min(this.width, this.height) * (event.shiftKey ? 0.25 : 1);
    const [x, y] = this.cursor;
    const moves = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] };
    if (event.key in moves) {
      this.cursor = inPicture([x + moves[event.key][0], y + moves[event.key][1]], this.width, this.height);
    } else if (event.key === "Enter" || event.key === " ") this.add(this.cursor);
    else if (event.key === "Backspace" || event.key === "Delete") this.set(this.points.slice(0, -1));
    else if (event.key === "Escape") return this.toggle();
    else return;
    event.preventDefault();
    this.show();
  }

  set(points) {
    this.points = points;
    this.clear.hidden = !points.length;
    this.show();
  }

  show() {
    const r = this.width / 110;
    const [cx, cy] = this.cursor;
    const points = this.points.map((point) => point.join(" ")).join(" ");
    this.group.replaceChildren(
      draw("polygon", { points }),
      ...this.points.map(([x, y]) => draw("circle", { cx: x, cy: y, r })),
      ...(this.isOn ? [draw("path", { d: `M${cx - 2 * r} ${cy}h${4 * r}M${cx} ${cy - 2 * r}v${4 * r}` })] : []),
    );
    this.svg.append(this.group);
  }

  /** The form's field `region`, or null. */
  get value() {
    if (this.points.length < FEWEST) return null;
    return JSON.stringify(this.points.map(([x, y]) => [+x.toFixed(1), +y.toFixed(1)]));
  }
}
