// A whole page from several photos, and where each photo lies on it.

import { checkbox, make, notify, problemNote } from "../elements.js";
import { work } from "../service.js";
import { downloadLink, saveLink } from "./downloads.js";
import { drawPatches, emptyDrawing } from "./overlay.js";
import { warningList } from "./photo_card.js";
import { imageOf, showImage } from "./pictures.js";

export class MosaicCard {
  constructor(files, options, onProgress) {
    Object.assign(this, { files, options, onProgress });
    this.body = make("div", {});
    this.element = make("article", { class: "card" }, make("h2", {}, `One page of ${files.length} photos`), this.body);
  }

  async show() {}

  form() {
    const form = new FormData();
    for (const file of this.files) form.append("images", file, file.name);
    this.options?.apply(form);
    return form;
  }

  async flatten(signal) {
    this.body.replaceChildren();
    try {
      const form = this.form();
      form.set("format", "json");
      form.set("embed", "true");
      const result = await (await work("mosaic", form, this.onProgress, signal)).json();
      await this.display(result);
    } catch (error) {
      if (error.name === "AbortError") throw error;
      this.body.replaceChildren(problemNote(error));
    }
  }

  async display(result) {
    const page = make("img", { alt: "Flat page" });
    const svg = emptyDrawing(result.width, result.height);
    drawPatches(svg, result.patches);
    const stage = make("div", { class: "stage whole" }, page, svg);
    let blob = imageOf(result.image ?? "");
    if (!blob) {
      const form = this.form();
      form.set("format", "png");
      blob = await (await work("mosaic", form, this.onProgress)).blob();
    }
    await showImage(page, blob);
    const places = checkbox("Where each photo lies", true, (event) => stage.classList.toggle("no-drawing", !event.target.checked));
    const onProblem = (problem) => this.body.append(problemNote(problem));
    const again = { path: "mosaic", formOf: () => this.form(), name: "mosaic", onProgress: this.onProgress, onProblem };
    const links = [
      saveLink("Download image", blob, `mosaic.${blob.type.split("/")[1].replace("jpeg", "jpg")}`),
      downloadLink("Download PDF", { ...again, format: "pdf" }),
    ];
    const described = this.files.map((file, index) => {
      const patch = result.patches[index];
      const warning = result.warnings.find(({ detail }) => detail.includes(`images[${index}]`));
      const hidden = patch.covered_fraction >= 0.005 ? `, ${Math.round(100 * patch.covered_fraction)} % hidden` : "";
      const text = patch.placed ? `placed, sharpness ${patch.sharpness.toFixed(2)}${hidden}` : (warning?.detail ?? "could not be placed");
      return make("li", { class: patch.placed ? "" : "unplaced" }, make("strong", {}, file.name), `: ${text}`);
    });
    this.body.replaceChildren(
      make("div", { class: "row tools" }, places),
      stage,
      make("p", { class: "row downloads" }, links),
      make("ol", { "aria-label": "Places of the photos" }, described),
      warningList(result.warnings.filter(({ code }) => !["unplaced", "duplicate-photo"].includes(code))) ?? "",
    );
    notify(`The page is complete. ${result.unplaced.length} photos could not be placed.`);
  }
}
