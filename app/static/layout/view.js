// View "Layout": a page in, its class and the labels of its zones out, to be corrected.

import { button, checkbox, labelled, make, notify, problemNote, select, setOptions } from "../elements.js";
import { sizeOf } from "../pictures.js";
import { formFields, get, work } from "../service.js";
import { PageEditor } from "./editor.js";
import { keptPicture } from "./picture.js";

const FORMATS = "image/*,.heic,.heif,.tif,.tiff,.pdf";

export function createView() {
  const file = make("input", { type: "file", multiple: true, accept: FORMATS });
  const photo = checkbox("It is a photo: flatten it first", false);
  const start = make("button", { type: "submit", class: "primary" }, "Recognize");
  const bar = make("progress", { max: 1, value: 0, "aria-label": "Progress" });
  const stage = make("span", {});
  const progress = make("p", { class: "progress", hidden: true }, bar, stage);
  const sheet = select([], null, () => showSheet(Number(sheet.value)));
  const sheetRow = labelled("Sheet of the document", sheet);
  const facts = make("p", {});
  const fields = make("div", {});
  const notes = make("div", {});
  const next = button("Recognize another", () => file.click(), "quiet");
  const editor = new PageEditor({ actions: [next], onResult: (result) => tell(result) });
  const form = make(
    "form",
    { class: "panel", onsubmit: recognize, ondragover: (event) => event.preventDefault(), ondrop: dropped },
    make("div", { class: "row" }, labelled("Page", file, "An image, a PDF, or several images of one document."), photo, start),
    progress,
  );
  const element = make("div", { class: "view" }, make("h1", {}, "Layout"), form, notes, sheetRow, facts, editor.element, fields);
  editor.element.hidden = sheetRow.hidden = true;
  let sheets = [];
  let files = [];
  let isBusy = false;

  function dropped(event) {
    event.stopPropagation();
    event.preventDefault();
    if (event.dataTransfer.files.length) file.files = event.dataTransfer.files;
  }

  async function recognize(event) {
    event.preventDefault();
    if (isBusy) return;
    if (!file.files.length) {
      notify("Choose a page first.");
      return file.focus();
    }
    isBusy = true;
    files = [...file.files];
    notes.replaceChildren();
    progress.hidden = false;
    try {
      const sent = new FormData();
      for (const one of files) sent.append("image", one, one.name);
      if (photo.firstElementChild.checked) sent.append("rectify", "true");
      if ("keep_image" in (await formFields("/layout"))) sent.append("keep_image", "true");
      const response = await work("layout", sent, ({ stage: name, progress: share }) => {
        bar.value = share;
        stage.textContent = (name ?? "").replaceAll("_", " ");
      });
      await showResult(await response.json());
    } catch (error) {
      notes.replaceChildren(problemNote(error));
    } finally {
      isBusy = false;
      progress.hidden = true;
    }
  }

  async function showResult(result) {
    sheets = result.pages ?? [result];
    sheetRow.hidden = sheets.length < 2;
    setOptions(sheet, sheets.map((_, index) => [String(index), String(index + 1)]), "0");
    await showSheet(0);
  }

  async function showSheet(index) {
    const result = sheets[index];
    // A flattened photo, or an image that was turned to be read, is not the file as it was sent.
    const asSent = !photo.firstElementChild.checked && !result.orientation?.rotation_deg && !result.orientation?.mirrored;
    const single = sheets.length === 1 && files.length === 1 && asSent && (await sizeOf(files[0])) ? files[0] : null;
    const picture = single ? URL.createObjectURL(single) : await keptPicture(result);
    editor.element.hidden = false;
    await editor.open(result, picture);
    notify(`${tell(result)}. ${result.zones.length} zones.`);
  }

  /** Shows what a result says beside its zones; returns its class in words. */
  function tell(result) {
    const shown = sheets.findIndex(({ id }) => id === result.id);
    if (shown >= 0) sheets[shown] = result;
    const kind = result.class ? `${result.class.name}, ${Math.round(result.class.probability * 100)} %` : "no class";
    const found = result.found ? ` (found: ${result.found.class ?? "no class"}, ${Math.round(result.found.probability * 100)} %)` : "";
    facts.textContent = `${kind}${found}; ${result.zones.length} zones.`;
    fields.replaceChildren(fieldTable(result.fields ?? []));
    return kind;
  }

  /** A stored result: `#layout/01M7...`. */
  async function open([id]) {
    if (!id) return;
    files = [];
    await showResult(await get(`layout/results/${encodeURIComponent(id)}`));
  }

  return { element, open };
}

/** What the labels say: the texts, with values where the service reads them. */
function fieldTable(fields) {
  if (!fields.length) return "";
  const rows = fields.map((field) =>
    make("tr", {}, make("th", { scope: "row" }, field.label), make("td", {}, field.text), make("td", {}, valueOf(field)), make("td", { class: "number" }, `${Math.round(field.confidence * 100)} %`)),
  );
  const head = make("tr", {}, ["Field", "Text", "Value", "Sure"].map((text) => make("th", { scope: "col" }, text)));
  return make("section", { class: "panel scroll", tabindex: 0, "aria-label": "Fields" }, make("h2", {}, "Fields"), make("table", {}, make("thead", {}, head), make("tbody", {}, rows)));
}

function valueOf({ value }) {
  if (value === null || value === undefined) return "";
  return typeof value === "object" ? Object.values(value).filter((part) => part !== null).join(" ") : String(value);
}
