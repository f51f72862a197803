// The sheet's four corners on its photo, set by pointer or arrow keys. The page is flattened again as they are moved.

import { button, draw, make } from "../elements.js";
import { showImage } from "../pictures.js";
import { emptyDrawing, inPicture, pointOf } from "./overlay.js";
import { problemText } from "./words.js";

const PHOTO_PX = 1600; // width of the photo that is shown
const STEP = 0.004; // of the photo's size: an arrow key; with Shift five times as far
const PAUSE_MS = 600; // after the last key; a pointer that lets go is the end at once
const LOUPE_PX = 120; // size of the loupe on the screen
const ZOOM = 3;

/** Four handles over a photo of `width` x `height` pixels, drawn by `svg` over `stage`; `onMoved` when all is done. */
class Handles {
  constructor(stage, photo, points, { width, height }, onMoved) {
    Object.assign(this, { stage, photo, width, height, onMoved });
    this.svg = emptyDrawing(width, height);
    this.loupe = make("canvas", { class: "loupe", width: LOUPE_PX, height: LOUPE_PX, hidden: true, "aria-hidden": "true" });
    this.handles = [0, 1, 2, 3].map((index) => this.handle(index));
    stage.append(this.svg, ...this.handles, this.loupe);
    this.set(points);
  }

  handle(index) {
    const end = () => {
      this.loupe.hidden = true;
      this.onMoved(0);
    };
    return make("button", {
      type: "button",
      class: "corner",
      "aria-label": `Corner ${index + 1}`,
      onkeydown: (event) => this.press(event, index),
      onblur: () => (this.loupe.hidden = true),
      onmousedown: (event) => event.preventDefault(), // a browser would drag the picture below
      onpointerdown: (event) => {
        event.target.focus();
        event.target.setPointerCapture(event.pointerId);
      },
      onpointermove: (event) => event.target.hasPointerCapture(event.pointerId) && this.move(index, pointOf(event, this.svg, this.width, this.height)),
      onlostpointercapture: end,
    });
  }

  set(points) {
    this.points = points.map((point) => inPicture(point, this.width, this.height));
    this.show();
  }

  move(index, to) {
    this.set(this.points.map((point, one) => (one === index ? to : point)));
    this.magnify(index);
  }

  press(event, index) {
    const step = STEP * Math.min(this.width, this.height) * (event.shiftKey ? 5 : 1);
    const way = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] }[event.key];
    if (!way) return;
    event.preventDefault();
    const [x, y] = this.points[index];
    this.move(index, [x + way[0], y + way[1]]);
    this.onMoved(PAUSE_MS);
  }

  show() {
    this.handles.forEach((handle, index) => {
      const [x, y] = this.points[index];
      handle.style.left = `${(100 * (x + 0.5)) / this.width}%`;
      handle.style.top = `${(100 * (y + 0.5)) / this.height}%`;
    });
    const points = this.points.map((point) => point.join(" ")).join(" ");
    this.svg.replaceChildren(draw("polygon", { class: "corner-lines", points }));
  }

  /** The photo round a corner, larger, on the far side of the picture: a finger hides what it moves. */
  magnify(index) {
    const [x, y] = this.points[index];
    const scale = this.photo.naturalWidth / this.width;
    const shown = this.photo.clientWidth / this.photo.naturalWidth || 1;
    const span = LOUPE_PX / ZOOM / shown; // pixels of the picture that the loupe shows
    const context = this.loupe.getContext("2d");
    context.clearRect(0, 0, LOUPE_PX, LOUPE_PX);
    context.drawImage(this.photo, x * scale - span / 2, y * scale - span / 2, span, span, 0, 0, LOUPE_PX, LOUPE_PX);
    context.strokeStyle = "#7048e8";
    context.lineWidth = 2;
    context.strokeRect(LOUPE_PX / 2 - 6, LOUPE_PX / 2 - 6, 12, 12);
    this.loupe.classList.toggle("at-right", x < this.width / 2);
    this.loupe.hidden = false;
  }

  /** The corners as the service takes them. */
  get value() {
    return this.points.map(([x, y]) => [+x.toFixed(1), +y.toFixed(1)]);
  }
}

/** Lets a person move the corners of a page. `kept` is a `Kept`. Resolves when the person is done. */
export async function editCorners(page, kept) {
  const photo = make("img", { alt: "Photo", draggable: "false" });
  await showImage(photo, await kept.photo(page, PHOTO_PX));
  const flat = make("img", { alt: "", class: "corners-flat" });
  const state = make("p", { role: "status" });
  const stage = make("div", { class: "stage" }, photo);
  const hint = "Corner 1 is the page's top left; then clockwise. Drag the corners, or move them with the arrow keys.";
  const automatic = button("Find them again", () => say("auto"));
  const done = make("button", { class: "primary", value: "done" }, "Done");
  const cancel = make("button", { class: "quiet", value: "cancel" }, "Cancel");
  const tools = make("form", { method: "dialog", class: "row" }, done, automatic, cancel);
  const views = make("div", { class: "corner-views" }, stage, flat);
  const dialog = make("dialog", { class: "wide corners", "aria-label": "Corners" }, make("p", { class: "hint" }, hint), views, state, tools);
  let handles = null;
  let timer = 0;
  let wish = null; // the last word, which is not sent yet
  let isSending = false;
  let isChanged = false;
  const before = page.given ?? "auto"; // what a person who gives up comes back to

  const later = (pause) => {
    clearTimeout(timer);
    timer = setTimeout(() => say(handles.value), pause);
  };

  /** Has the page flattened between other corners. While that is under way only the last word waits. */
  async function say(corners) {
    clearTimeout(timer);
    timer = 0;
    wish = corners;
    isChanged = true;
    if (isSending) return;
    isSending = true;
    while (wish) {
      state.textContent = "Flattening again ...";
      const sent = wish === "auto" ? { corners: wish } : { corners: wish, rotate: 0 };
      wish = null;
      kept.pages.update(page, { given: sent.corners });
      await kept.change(page, () => sent);
      if (sent.corners === "auto" && !wish) handles.set(page.facts.corners);
    }
    isSending = false;
    state.textContent = page.problem ? problemText(page.problem) : "The page is flat by these corners.";
    await showImage(flat, page.picture);
  }

  document.body.append(dialog);
  dialog.showModal();
  await showImage(flat, page.picture);
  handles = new Handles(stage, photo, page.facts.corners, page.facts.photo, later);
  handles.handles[0].focus();
  return new Promise((resolve) =>
    dialog.addEventListener("close", () => {
      clearTimeout(timer);
      if (dialog.returnValue !== "done" && isChanged) say(before);
      else if (dialog.returnValue === "done" && timer) say(handles.value);
      dialog.remove();
      resolve();
    }),
  );
}
