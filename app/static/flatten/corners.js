// The sheet's four corners, set on the photo by pointer or arrow keys. Where they are set, they are the view's corners.

import { button, draw, make, notify } from "../elements.js";
import { inPicture, pointOf } from "./overlay.js";

const INSET = 0.08; // of the photo's size: where corners begin that nobody has seen
const STEP = 0.004; // of the photo's size: an arrow key; with Shift five times as far

/** Four handles over `stage`, which holds a photo of `width` x `height` pixels. */
export class Corners {
  constructor(stage, svg, width, height) {
    Object.assign(this, { stage, svg, width, height, points: null, seen: null });
    this.group = draw("g", { class: "corners" });
    this.handles = [0, 1, 2, 3].map((index) => this.handle(index));
    this.start = button("Corners", () => this.begin());
    this.clear = button("Automatic corners", () => this.set(null));
    this.tools = make("span", { class: "row" }, this.start, this.clear);
    stage.append(...this.handles);
    this.show();
  }

  handle(index) {
    return make("button", {
      type: "button",
      class: "corner",
      "aria-label": `Corner ${index + 1}`,
      onkeydown: (event) => this.press(event, index),
      onpointerdown: (event) => event.target.setPointerCapture(event.pointerId),
      onpointermove: (event) => event.target.hasPointerCapture(event.pointerId) && this.move(index, pointOf(event, this.svg, this.width, this.height)),
    });
  }

  /** Corners that the service has seen: where handles begin. */
  found(corners) {
    this.seen = corners.every(Boolean) ? corners : null;
    this.show();
  }

  begin() {
    const [x, y] = [INSET * this.width, INSET * this.height];
    const inset = [[x, y], [this.width - 1 - x, y], [this.width - 1 - x, this.height - 1 - y], [x, this.height - 1 - y]];
    this.set(this.points ?? this.seen ?? inset);
    this.handles[0].focus();
    notify("Drag the corners, or use the arrow keys. Corner 1 is the page's top left; then clockwise. Flatten again to use them.");
  }

  move(index, to) {
    this.set(this.points.map((point, one) => (one === index ? inPicture(to, this.width, this.height) : point)));
  }

  press(event, index) {
    const step = STEP * Math.min(this.width, this.height) * (event.shiftKey ? 5 : 1);
    const way = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] }[event.key];
    if (!way) return;
    event.preventDefault();
    const [x, y] = this.points[index];
    this.move(index, [x + way[0], y + way[1]]);
  }

  set(points) {
    this.points = points;
    this.show();
  }

  show() {
    this.clear.hidden = !this.points;
    this.handles.forEach((handle, index) => {
      handle.hidden = !this.points;
      if (!this.points) return;
      const [x, y] = this.points[index];
      handle.style.left = `${(100 * (x + 0.5)) / this.width}%`;
      handle.style.top = `${(100 * (y + 0.5)) / this.height}%`;
    });
    const points = (this.points ?? []).map((point) => point.join(" ")).join(" ");
    this.group.replaceChildren(...(points ? [draw("polygon", { points })] : []));
    this.svg.append(this.group);
  }

  /** The form's field `corners`, or null. */
  get value() {
    return this.points && JSON.stringify(this.points.map(([x, y]) => [+x.toFixed(1), +y.toFixed(1)]));
  }
}
