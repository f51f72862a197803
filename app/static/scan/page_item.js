// A page in the strip: its picture, its state, and what a person may say about it.

import { button, checkbox, make, select } from "../elements.js";
import { showImage, thumbnailOf } from "../pictures.js";
import { drawPlaces, emptyDrawing } from "./overlay.js";
import { filesKeyOf } from "./pages.js";
import { filesOf } from "./storage.js";
import { LOOKS, problemText, stateText, warningsOf } from "./words.js";

const PHOTO_PX = 512; // height of the photo's small picture: twice as many as it is shown with

/** A small button with a sign; its name is `text`. */
function sign(mark, text, action) {
  return make("button", { type: "button", class: "sign", "aria-label": text, title: text, onclick: action }, mark);
}

export class PageItem {
  /** `act` has what the buttons do: corners, rotate, both, join, look, lookForAll, move, remove, view, again, addTo. */
  constructor(page, act) {
    Object.assign(this, { page, shownPicture: null });
    this.title = make("h2", { tabindex: "-1" });
    this.names = make("p", { class: "file-name" });
    this.flat = make("img", { alt: "Flat page", onclick: () => act.view(page) });
    this.stage = make("div", { class: "stage sheet" }, this.flat);
    this.photos = make("ul", { class: "photos" });
    this.state = make("p", { class: "state" });
    this.notes = make("div", {});
    this.look = select(LOOKS, page.look, () => act.look(page, this.look.value));
    this.look.id = `look-${page.key}`;
    this.forAll = button("For all", () => act.lookForAll(page));
    this.corners = button("Corners", () => act.corners(page));
    this.rotate = button("Rotate", () => act.rotate(page));
    this.both = button("Both pages", () => act.both(page));
    this.join = button("Join with next", () => act.join(page));
    this.join.title = "This photo and the next one show parts of one large page";
    this.open = button("View", () => act.view(page));
    this.again = button("Try again", () => act.again(page));
    this.more = make("label", { class: "more" }, "Add parts ", this.chooser(page, act));
    this.earlier = sign("\u2190", "Move earlier", () => act.move(page, -1));
    this.later = sign("\u2192", "Move later", () => act.move(page, 1));
    this.tools = make("div", { class: "row page-tools" }, this.corners, this.rotate, this.open, this.both, this.join, this.again, this.more);
    this.lookRow = make("div", { class: "look" }, make("label", { for: this.look.id }, "Look"), this.look, this.forAll);
    const order = make("div", { class: "row page-tools order" }, this.earlier, this.later, button("Remove", () => act.remove(page), "quiet"));
    const head = make("div", { class: "page-head" }, this.title, this.state);
    const body = [head, this.names, this.stage, this.photos, this.notes, this.lookRow, this.tools, order];
    this.element = make("li", { class: "page" }, body);
    this.showPhotos();
  }

  chooser(page, act) {
    const field = make("input", { type: "file", multiple: true, accept: "image/*,.heic,.heif", onchange: () => act.addTo(page, [...field.files]) });
    return field;
  }

  /** Shows what the page is now; it is number `number` of `count`. */
  async show(number, count) {
    const { page } = this;
    const focused = this.element.contains(document.activeElement) && document.activeElement;
    const isReady = page.state === "ready";
    const isJoined = page.kind === "joined";
    this.title.textContent = `Page ${number}`;
    this.element.setAttribute("aria-label", this.title.textContent);
    this.element.dataset.state = page.state;
    this.element.setAttribute("aria-busy", String(Boolean(page.isChanging) || page.state === "working"));
    this.names.textContent = isJoined ? `One page of ${page.names.length} photos` : [page.names[0], page.part].filter(Boolean).join(", ");
    this.state.textContent = isJoined && page.state === "waiting" && page.names.length < 2 ? "Add the other photos" : stateText(page);
    this.corners.hidden = !isReady || isJoined;
    this.rotate.hidden = this.lookRow.hidden = this.open.hidden = !isReady;
    this.both.hidden = !isReady || page.kind !== "page" || Boolean(page.part);
    this.join.hidden = !isReady || number === count || Boolean(page.part);
    this.again.hidden = page.state !== "failed";
    this.more.hidden = !isJoined || page.state === "working";
    this.look.value = page.look;
    this.earlier.disabled = number === 1;
    this.later.disabled = number === count;
    this.forAll.hidden = count < 2;
    this.showNotes();
    if (focused && (focused.disabled || focused.closest("[hidden]"))) this.title.focus();
    await Promise.all([this.showPicture(), this.photoNames === String(page.names) ? null : this.showPhotos()]);
  }

  showNotes() {
    const { page } = this;
    const problem = page.problem && make("p", { class: "problem", role: "alert" }, problemText(page.problem));
    const said = page.state === "ready" && page.facts ? [...warningsOf(page.facts), ...this.unplaced()] : [];
    const list = said.length ? make("ul", { class: "warnings", "aria-label": "Notes" }, said.map((text) => make("li", {}, text))) : null;
    const text = JSON.stringify([page.problem, said]);
    if (text !== this.said) this.notes.replaceChildren(...[problem, list].filter(Boolean));
    this.said = text;
  }

  /** Photos that are not part of a joined page, by number and file name. */
  unplaced() {
    const { facts, names } = this.page;
    const missing = (facts.places ?? []).flatMap((place, index) => (place ? [] : [`Photo ${index + 1} (${names[index]}) could not be placed.`]));
    return missing;
  }

  async showPicture() {
    const { picture, facts } = this.page;
    this.stage.hidden = !picture;
    this.photos.hidden = Boolean(picture);
    if (!picture) return;
    if (picture === this.shownPicture) return this.showTurns();
    this.shownPicture = picture;
    await showImage(this.flat, picture);
    this.showTurns();
    this.stage.querySelector("svg")?.remove();
    this.map?.remove();
    if (facts.places) this.showPlaces(facts);
  }

  /** The picture as it will be after turns that are under way, within its place. */
  showTurns() {
    const { turns, facts } = this.page;
    const fit = turns % 2 ? Math.min(facts.width, facts.height) / Math.max(facts.width, facts.height) : 1;
    this.stage.style.transform = turns ? `rotate(${90 * turns}deg) scale(${fit})` : "";
  }

  /** Where each photo of a joined page lies. */
  showPlaces({ width, height, places }) {
    const svg = emptyDrawing(width, height);
    drawPlaces(svg, places);
    this.stage.append(svg);
    this.map = checkbox("Where each photo lies", true, (event) => this.stage.classList.toggle("no-drawing", !event.target.checked));
    this.stage.after(this.map);
  }

  /** Small pictures of the photos, until the page is flat; a browser does not show those of some kinds. */
  async showPhotos() {
    const { page } = this;
    this.photoNames = String(page.names);
    const files = page.picture ? [] : await filesOf(filesKeyOf(page));
    const shown = files.map(async (file, index) => {
      const picture = await thumbnailOf(file, PHOTO_PX, () => !page.picture);
      picture?.setAttribute("role", "img");
      picture?.setAttribute("aria-label", files.length > 1 ? `Photo ${index + 1}` : "Photo");
      return make("li", {}, picture ?? make("span", { class: "blank" }, `Photo ${index + 1}`));
    });
    this.photos.replaceChildren(...(await Promise.all(shown)));
  }
}
