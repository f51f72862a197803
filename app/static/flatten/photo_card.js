// One photo and the flat page that was made from it, side by side or under a slider.

import { button, checkbox, labelled, make, notify, problemNote, select } from "../elements.js";
import { work } from "../service.js";
import { Corners } from "./corners.js";
import { downloadLink, saveLink } from "./downloads.js";
import { drawResult, emptyDrawing } from "./overlay.js";
import { imageOf, showImage, sizeOf, stemOf } from "./pictures.js";
import { Region } from "./region.js";

const PARTS = [["outline", "Outline", true], ["mesh", "Mesh", false], ["rulings", "Rulings", true], ["region", "Region", true]];

export class PhotoCard {
  /** `options` are the controls of the form; `onProgress` shows how far the work is. */
  constructor(file, options, onProgress) {
    Object.assign(this, { file, options, onProgress, region: null, corners: null, rotate: null, turned: 0 });
    this.photo = make("img", { alt: "Photo" });
    this.stage = make("div", { class: "stage" }, this.photo);
    this.before = make("figure", { class: "before" }, this.stage, make("figcaption", {}, "Before"));
    this.compare = make("div", { class: "compare" }, this.before);
    this.tools = make("div", { class: "row tools" });
    this.results = make("div", { class: "results" });
    this.element = make("article", { class: "card photo-card" }, make("h2", {}, file.name), this.tools, this.compare, this.results);
  }

  async show() {
    const size = await sizeOf(this.file);
    if (!size) {
      this.stage.replaceChildren(make("p", { class: "blank" }, "This browser cannot show the photo; the service can read it."));
      return;
    }
    await showImage(this.photo, this.file);
    this.svg = emptyDrawing(size.width, size.height);
    this.stage.append(this.svg);
    this.region = new Region(this.stage, this.svg, size.width, size.height);
    this.corners = new Corners(this.stage, this.svg, size.width, size.height);
    this.tools.append(this.corners.tools, button("Rotate", () => this.turn()), this.region.tools);
  }

  /** Turns the flat page by a quarter, clockwise, against what it is now. */
  async turn() {
    this.rotate = (this.turned + 90) % 360;
    this.turned = this.rotate;
    notify(`${this.file.name} is turned by ${this.rotate} degrees.`);
    if (this.element.querySelector(".after")) await this.flatten();
  }

  form() {
    const form = new FormData();
    form.append("image", this.file, this.file.name);
    this.options?.apply(form);
    if (this.corners?.value) form.set("corners", this.corners.value);
    else if (this.region?.value) form.set("region", this.region.value);
    if (this.rotate !== null) form.set("rotate", String(this.rotate));
    return form;
  }

  async flatten(signal) {
    this.results.replaceChildren();
    try {
      const form = this.form();
      form.set("format", "json");
      form.set("embed", "true");
      const response = await work("rectify", form, this.onProgress, signal);
      await this.display(await response.json());
    } catch (error) {
      if (error.name === "AbortError") throw error;
      this.results.replaceChildren(problemNote(error));
    }
  }

  async display(result) {
    this.turned = result.orientation.rotation_deg;
    const blob = imageOf(result.image ?? "") ?? (await this.asPng());
    const flat = make("img", { alt: "Flat page" });
    this.compare.querySelector(".after")?.remove();
    this.compare.append(make("figure", { class: "after" }, make("div", { class: "stage" }, flat), make("figcaption", {}, "After")));
    await showImage(flat, blob);
    if (this.svg) {
      drawResult(this.svg, result);
      this.region.show();
      this.corners.found(result.corners);
      this.drawWarnings(result.warnings);
    }
    this.slide();
    this.results.replaceChildren(this.downloads(blob, result), this.facts(result), warningList(result.warnings) ?? "");
    notify(`${this.file.name} is flat.`);
  }

  /** For uploads in a format that browsers do not show. */
  async asPng() {
    const form = this.form();
    form.set("format", "png");
    return (await work("rectify", form, this.onProgress)).blob();
  }

  drawWarnings(warnings) {
    this.stage.querySelector(".badges")?.remove();
    const badges = warnings.map(({ code, detail }) => make("li", { title: detail }, code));
    if (badges.length) this.stage.append(make("ul", { class: "badges", "aria-label": "Warnings on the photo" }, badges));
  }

  /** Controls of the comparison: which parts are drawn, and the slider. */
  slide() {
    this.sliderRow?.remove();
    const range = make("input", { type: "range", min: "0", max: "100", value: "50" });
    const row = labelled("Before and after", range);
    row.hidden = true;
    const cut = () => this.compare.style.setProperty("--cut", `${range.value}%`);
    range.addEventListener("input", cut);
    const modes = select([["side", "side by side"], ["slider", "under a slider"]], "side", () => {
      row.hidden = modes.value === "side";
      this.compare.classList.toggle("sliding", modes.value === "slider");
      cut();
    });
    const boxes = PARTS.map(([name, text, isOn]) =>
      checkbox(text, isOn, (event) => this.stage.classList.toggle(`no-${name}`, !event.target.checked)),
    );
    this.stage.classList.add("no-mesh");
    this.sliderRow = make("div", { class: "row tools" }, labelled("Show", modes), row, make("span", { class: "row" }, boxes));
    this.compare.before(this.sliderRow);
  }

  downloads(blob, result) {
    const name = `${stemOf(this.file.name)}-flat`;
    const again = {
      path: "rectify",
      formOf: () => this.form(),
      name,
      onProgress: this.onProgress,
      onProblem: (problem) => this.results.append(problemNote(problem)),
    };
    const facts = new Blob([JSON.stringify({ ...result, image: null }, null, 1)], { type: "application/json" });
    const links = [
      saveLink("Download image", blob, `${name}.${blob.type.split("/")[1].replace("jpeg", "jpg")}`),
      downloadLink("Download PDF", { ...again, format: "pdf" }),
    ];
    if (this.options?.has("text")) {
      links.push(downloadLink("Download searchable PDF", { ...again, format: "pdf", more: { text: "true" }, name: `${name}-text` }));
      links.push(downloadLink("Download text", { ...again, format: "txt" }));
    }
    links.push(saveLink("Download JSON", facts, `${name}.json`));
    return make("p", { class: "row downloads" }, links);
  }

  facts(result) {
    const { kind, orientation, camera, width, height, evidence } = result;
    const focal = camera.focal_length_px ? `${Math.round(camera.focal_length_px)} px (${camera.source})` : "unknown";
    const rows = [
      ["Shape", kind === "planar" ? "flat page" : "bent page"],
      ["Size", `${width} x ${height} px`],
      ["Turned", `${orientation.rotation_deg}°${orientation.mirrored ? ", mirrored" : ""}`],
      ["Focal length", focal],
      ["Shape seen in", evidence.source.join(", ") || "nothing"],
    ];
    return make("dl", { class: "facts" }, rows.map(([term, value]) => [make("dt", {}, term), make("dd", {}, value)]));
  }
}

export function warningList(warnings) {
  if (!warnings.length) return null;
  return make(
    "ul",
    { class: "warnings", "aria-label": "Warnings" },
    warnings.map(({ code, detail }) => make("li", {}, make("strong", {}, code), ` ${detail}`)),
  );
}
