// View "Flatten": photos in, flat pages out.

import { button, labelled, make, notify, problemNote, select } from "../elements.js";
import { MosaicCard } from "./mosaic_card.js";
import { optionControls } from "./options.js";
import { PhotoCard } from "./photo_card.js";

const PHOTO_OPTIONS = ["kind", "illumination", "crop", "paper", "language"];
const MOSAIC_OPTIONS = ["illumination", "composition"];
const ACCEPTED = "image/*,.heic,.heif,.tif,.tiff,.webp";

export function createView() {
  const photos = make("input", { type: "file", multiple: true, accept: ACCEPTED, onchange: () => add(photos.files) });
  const camera = make("input", { type: "file", accept: "image/*", capture: "environment", onchange: () => add(camera.files) });
  const drop = make(
    "div",
    { class: "drop", ondragover: over, ondragleave: over, ondrop: dropped },
    labelled("Photos", photos, "Drop photos here, choose files, or paste them."),
    make("div", { class: "only-touch" }, labelled("Camera", camera)),
  );
  const result = select([["each", "one for each photo"], ["one", "one of all photos (mosaic)"]], "each", changeResult);
  const optionBox = make("div", {});
  const start = make("button", { type: "submit", class: "primary" }, "Flatten");
  const stop = button("Cancel", () => running?.abort());
  stop.hidden = true;
  const bar = make("progress", { max: 1, value: 0, "aria-label": "Progress" });
  const stage = make("span", { class: "stage-name" });
  const progress = make("p", { class: "progress", hidden: true }, bar, stage);
  const list = make("div", { class: "cards" });
  const empty = make("p", { class: "empty" }, "No photo yet.");
  const form = make(
    "form",
    { class: "panel", onsubmit: flatten },
    drop,
    make("div", { class: "row" }, labelled("Results", result)),
    make("details", {}, make("summary", {}, "Options"), optionBox),
    make("p", { class: "row" }, start, stop, button("Remove all", clear, "quiet")),
    progress,
  );
  const element = make("div", { class: "view" }, make("h1", {}, "Flatten"), form, empty, list);

  let files = [];
  let cards = [];
  let options = {};
  let running = null;

  function over(event) {
    event.preventDefault();
    drop.classList.toggle("is-over", event.type === "dragover");
  }

  function dropped(event) {
    over(event);
    event.stopPropagation();
    drop.classList.remove("is-over");
    add(event.dataTransfer.files);
  }

  document.addEventListener("paste", (event) => {
    if (element.isConnected && event.clipboardData.files.length) add(event.clipboardData.files);
  });

  function add(chosen) {
    if (!chosen.length) return;
    files = [...files, ...chosen];
    photos.value = camera.value = "";
    notify(`${files.length} ${files.length === 1 ? "photo" : "photos"} chosen.`);
    arrange();
  }

  function clear() {
    running?.abort();
    files = [];
    arrange();
  }

  /** Cards for the chosen photos; those that exist stay. */
  async function arrange() {
    empty.hidden = files.length > 0;
    if (result.value === "one" && files.length) cards = [new MosaicCard(files, options.one, report)];
    else cards = files.map((file) => cards.find((card) => card.file === file) ?? new PhotoCard(file, options.each, report));
    const before = new Set(list.children);
    list.replaceChildren(...cards.map((card) => card.element));
    for (const card of cards) if (!before.has(card.element)) await card.show();
  }

  async function changeResult() {
    optionBox.replaceChildren(options[result.value]?.element ?? "");
    await arrange();
  }

  function report({ stage: name, progress: share, state }) {
    bar.value = share;
    stage.textContent = name ? name.replaceAll("_", " ") : state;
  }

  async function flatten(event) {
    event.preventDefault();
    if (running) return;
    if (!files.length) {
      notify("Choose a photo first.");
      photos.focus();
      return;
    }
    running = new AbortController();
    stop.hidden = progress.hidden = false;
    start.setAttribute("aria-disabled", "true");
    try {
      for (const card of cards) {
        bar.value = 0;
        await card.flatten(running.signal);
      }
    } catch (error) {
      if (error.name !== "AbortError") list.prepend(problemNote(error));
      else notify("Cancelled.");
    } finally {
      running = null;
      stop.hidden = progress.hidden = true;
      start.removeAttribute("aria-disabled");
    }
  }

  async function open() {
    if (options.each) return;
    const [each, one] = await Promise.all([optionControls("/rectify", PHOTO_OPTIONS), optionControls("/mosaic", MOSAIC_OPTIONS)]);
    options = { each, one };
    for (const card of cards) card.options = options[result.value];
    optionBox.replaceChildren(options[result.value].element);
  }

  return { element, open };
}
