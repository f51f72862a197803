// A page that can be moved and enlarged (OpenSeadragon), with its zones as buttons over it.

import { make } from "../elements.js";

const { OpenSeadragon } = window;
// OpenSeadragon adds a style element unless there is one with this mark. The page's policy forbids style elements, and an
// element of another namespace is none.
const mark = document.createElementNS("urn:mark", "style");
mark.setAttribute("data-openseadragon-mobile-css", "true");
document.head.append(mark);

const HUES = 8; // colours of labels
const UNSURE = 0.9; // zones below this confidence have a dashed border
const HANDLES = ["nw", "ne", "se", "sw"];

/** Colour of a label: the same on every page. */
function hueOf(label) {
  let sum = 0;
  for (const character of label) sum = (sum * 31 + character.codePointAt(0)) % 9973;
  return sum % HUES;
}

/** A white page, for results whose picture is not kept. */
function blank(width, height) {
  const canvas = make("canvas", {});
  const scale = Math.min(1, 1200 / width);
  canvas.width = width * scale;
  canvas.height = height * scale;
  const context = canvas.getContext("2d");
  context.fillStyle = "#fff";
  context.fillRect(0, 0, canvas.width, canvas.height);
  return canvas.toDataURL();
}

export class PageViewer extends EventTarget {
  constructor() {
    super();
    this.stage = make("div", { class: "viewer-stage" });
    this.surface = make("div", { class: "drawing-surface", hidden: true });
    this.element = make("div", { class: "viewer", role: "group", "aria-label": "Picture with its zones" }, this.stage, this.surface);
    this.overlays = new Map();
    this.surface.addEventListener("pointerdown", (event) => this.startDrawing(event));
  }

  /** Shows a picture (its address, or null for a white page) of a page of this size. */
  async open(address, zones) {
    this.zones = zones;
    this.viewer?.destroy();
    this.overlays.clear();
    this.viewer = OpenSeadragon({
      element: this.stage,
      drawer: "canvas",
      showNavigationControl: false,
      animationTime: 0.3,
      visibilityRatio: 0.3,
      maxZoomPixelRatio: 4,
      gestureSettingsMouse: { clickToZoom: false },
      gestureSettingsTouch: { clickToZoom: false },
      gestureSettingsPen: { clickToZoom: false },
    });
    // Keys belong to the zones.
    this.viewer.innerTracker.keyHandler = null;
    this.viewer.innerTracker.keyDownHandler = null;
    this.viewer.canvas.removeAttribute("tabindex");
    const isOpen = await this.shows(address ?? blank(zones.width, zones.height));
    if (!isOpen) await this.shows(blank(zones.width, zones.height));
    this.update();
  }

  shows(url) {
    return new Promise((resolve) => {
      this.viewer.addOnceHandler("open", () => resolve(true));
      this.viewer.addOnceHandler("open-failed", () => resolve(false));
      this.viewer.open({ type: "image", url: String(url) });
    });
  }

  zoom(factor) {
    this.viewer.viewport.zoomBy(factor).applyConstraints();
  }

  fit() {
    this.viewer.viewport.goHome();
  }

  place([x0, y0, x1, y1]) {
    const { width } = this.zones;
    return new OpenSeadragon.Rect(x0 / width, y0 / width, (x1 - x0) / width, (y1 - y0) / width);
  }

  /** Draws all zones anew; buttons of zones that stay keep the focus. */
  update() {
    const wanted = new Set(this.zones.list.map((zone) => zone.id));
    for (const [id, element] of this.overlays) {
      if (wanted.has(id)) continue;
      this.viewer.removeOverlay(element);
      this.overlays.delete(id);
    }
    this.zones.list.forEach((zone, index) => {
      let element = this.overlays.get(zone.id);
      if (!element) {
        element = this.zoneButton(zone.id);
        this.overlays.set(zone.id, element);
        this.viewer.addOverlay({ element, location: this.place(zone.box) });
      } else this.viewer.updateOverlay(element, this.place(zone.box));
      this.describe(element, zone, index);
    });
    this.orderTabs();
  }

  /** The Tab key follows the reading order, which is the order of the elements. */
  orderTabs() {
    const nodes = this.zones.list.map(({ id }) => this.overlays.get(id)).map((element) => element.closest(".openseadragon-overlay-wrapper") ?? element.parentElement);
    const parent = nodes[0]?.parentElement;
    if (!parent || nodes.every((node, index) => parent.children[index] === node)) return;
    const focused = document.activeElement;
    parent.append(...nodes);
    if (focused !== document.activeElement) focused?.focus({ preventScroll: true });
  }

  describe(element, zone, index) {
    const name = zone.label ?? "no label";
    const tag = element.querySelector(".tag");
    tag.textContent = name;
    tag.dataset.order = index + 1;
    element.setAttribute("aria-label", name);
    const text = zone.text ? `: ${zone.text.slice(0, 80)}` : "";
    element.setAttribute("aria-description", `zone ${index + 1}, ${Math.round(zone.confidence * 100)} % sure${text}`);
    const hue = zone.label === null ? "none" : hueOf(zone.label);
    element.className = `zone hue-${hue} ${zone.confidence < UNSURE ? "unsure" : ""}`;
    element.classList.toggle("selected", zone.id === this.selected);
    element.setAttribute("aria-pressed", String(zone.id === this.selected));
  }

  zoneButton(id) {
    const handles = HANDLES.map((corner) => make("span", { class: `handle ${corner}`, "data-corner": corner }));
    return make(
      "button",
      {
        type: "button",
        onfocus: () => this.select(id),
        onclick: () => this.select(id),
        onkeydown: (event) => this.dispatchEvent(new CustomEvent("zonekey", { detail: { id, event } })),
        onpointerdown: (event) => this.startDragging(event, id),
      },
      make("span", { class: "tag" }),
      handles,
    );
  }

  select(id) {
    if (this.selected === id) return;
    this.selected = id;
    for (const [other, element] of this.overlays) {
      element.classList.toggle("selected", other === id);
      element.setAttribute("aria-pressed", String(other === id));
    }
    const zone = this.zones.find(id);
    if (zone) this.reveal(zone);
    this.dispatchEvent(new CustomEvent("select", { detail: id }));
  }

  focus(id) {
    this.overlays.get(id)?.focus({ preventScroll: true });
  }

  reveal(zone) {
    const rect = this.place(zone.box);
    const seen = this.viewer.viewport.getBounds(true);
    const isInside = rect.x >= seen.x && rect.y >= seen.y && rect.x + rect.width <= seen.x + seen.width && rect.y + rect.height <= seen.y + seen.height;
    if (!isInside) this.viewer.viewport.panTo(rect.getCenter());
  }

  /** Difference of two pointer places in pixels of the page. */
  delta(dx, dy) {
    const { x, y } = this.viewer.viewport.deltaPointsFromPixels(new OpenSeadragon.Point(dx, dy), true);
    return [x * this.zones.width, y * this.zones.width];
  }

  startDragging(event, id) {
    event.stopPropagation(); // OpenSeadragon would move the page
    const element = this.overlays.get(id);
    const corner = event.target.dataset.corner;
    const [x0, y0, x1, y1] = this.zones.find(id).box;
    if (!corner && this.selected !== id) return; // the first press selects
    let hasMoved = false;
    const move = ({ clientX, clientY }) => {
      const [dx, dy] = this.delta(clientX - event.clientX, clientY - event.clientY);
      if (!hasMoved && Math.hypot(clientX - event.clientX, clientY - event.clientY) < 4) return;
      const box = corner
        ? [corner.includes("w") ? x0 + dx : x0, corner.includes("n") ? y0 + dy : y0, corner.includes("e") ? x1 + dx : x1, corner.includes("s") ? y1 + dy : y1]
        : [x0 + dx, y0 + dy, x1 + dx, y1 + dy];
      this.zones.setBox(id, box, hasMoved);
      hasMoved = true;
    };
    element.setPointerCapture(event.pointerId);
    element.addEventListener("pointermove", move);
    const end = () => element.removeEventListener("pointermove", move);
    element.addEventListener("pointerup", end, { once: true });
    element.addEventListener("pointercancel", end, { once: true });
  }

  /** The next drag on the page draws a new zone. */
  draw(isOn) {
    this.surface.hidden = !isOn;
  }

  startDrawing(event) {
    const from = this.pagePoint(event);
    const frame = make("div", { class: "rubber" });
    const { left, top } = this.surface.getBoundingClientRect();
    this.surface.append(frame);
    this.surface.setPointerCapture(event.pointerId);
    const move = ({ clientX, clientY }) => {
      frame.style.left = `${Math.min(clientX, event.clientX) - left}px`;
      frame.style.top = `${Math.min(clientY, event.clientY) - top}px`;
      frame.style.width = `${Math.abs(clientX - event.clientX)}px`;
      frame.style.height = `${Math.abs(clientY - event.clientY)}px`;
    };
    const end = (last) => {
      this.surface.removeEventListener("pointermove", move);
      frame.remove();
      const to = this.pagePoint(last);
      if (last.type === "pointerup" && Math.hypot(to[0] - from[0], to[1] - from[1]) > 8) this.zones.add([...from, ...to]);
      this.dispatchEvent(new Event("drawn"));
    };
    this.surface.addEventListener("pointermove", move);
    this.surface.addEventListener("pointerup", end, { once: true });
  }

  pagePoint({ clientX, clientY }) {
    const { left, top } = this.stage.getBoundingClientRect();
    const { x, y } = this.viewer.viewport.pointFromPixel(new OpenSeadragon.Point(clientX - left, clientY - top), true);
    return [x * this.zones.width, y * this.zones.width];
  }

  /** A box in the middle of what is shown, for a zone that is made without a pointer. */
  middle() {
    const { x, y, width, height } = this.viewer.viewport.getBounds(true);
    const scale = this.zones.width;
    return [(x + width / 3) * scale, (y + height * 0.45) * scale, (x + (2 * width) / 3) * scale, (y + height * 0.55) * scale];
  }
}
