// What is made of all pages: a PDF, pictures, text; and the name and language that they have.

import { button, labelled, make, notify, problemNote, save, select, setOptions } from "../elements.js";
import { fileName, languageName, problemText } from "./words.js";

const STANDARD = ["", "as the service is set"];
const TYPES = { pdf: "application/pdf", zip: "application/zip", txt: "text/plain" };

export class FilesBar {
  /** `pages` is a `Pages`, `kept` a `Kept`; `onClear` empties the strip. */
  constructor(pages, kept, onClear) {
    Object.assign(this, { pages, kept, prepared: null, isBusy: false });
    this.name = make("input", { type: "text", placeholder: "Scan", maxlength: "200", oninput: () => this.set({ name: this.name.value }) });
    this.language = select([STANDARD], "", () => this.set({ language: this.language.value }));
    this.pdf = button("Download PDF", () => this.download("pdf"), "primary");
    this.share = button("Share", () => this.sharePdf());
    this.share.hidden = !navigator.share;
    const others = [button("Images (ZIP)", () => this.download("zip")), button("Text", () => this.download("txt"))];
    this.problem = make("div", {});
    this.element = make(
      "section",
      { class: "panel files", "aria-label": "Document" },
      make("div", { class: "row" }, labelled("Name", this.name), labelled("Language of the text", this.language)),
      make("div", { class: "row" }, this.pdf, this.share, others, button("Clear", onClear, "quiet")),
      this.problem,
    );
  }

  set(settings) {
    this.prepared = null;
    this.pages.set(settings);
    this.kept.readAhead();
  }

  /** Languages that the service reads, by Tesseract's codes. */
  offer(languages) {
    const { name, language } = this.pages.settings;
    setOptions(this.language, [STANDARD, ...languages.map((code) => [code, languageName(code)])], language);
    if (!this.language.value) this.language.value = "";
    this.name.value = name;
  }

  /** The pages have changed: what was made of them is old. */
  show(count) {
    this.prepared = null;
    this.element.hidden = !count.all;
    for (const one of this.element.querySelectorAll("button:not(.quiet)")) one.ariaDisabled = count.ready ? null : "true";
  }

  /** The file of all pages; null where there is none, and the bar says why. */
  async make(format) {
    if (this.isBusy) return null;
    if (!this.pages.count.ready) {
      notify("No page is ready yet.");
      return null;
    }
    this.isBusy = true;
    this.problem.replaceChildren(make("p", { role: "status" }, format === "txt" ? "Reading the pages ..." : "Making the file ..."));
    try {
      const blob = await this.kept.file(format);
      this.problem.replaceChildren();
      return new File([blob], `${fileName(this.pages.settings.name)}.${format}`, { type: TYPES[format] });
    } catch (error) {
      this.problem.replaceChildren(problemNote({ detail: problemText(error) }));
      return null;
    } finally {
      this.isBusy = false;
    }
  }

  async download(format) {
    const { open } = this.pages.count;
    const file = await this.make(format);
    if (!file) return;
    save(file, file.name);
    notify(open ? `${file.name} has the pages that are ready; ${open} are not.` : `${file.name} is saved.`);
  }

  /** Shares the PDF. A browser shares only right after a press: where making it took too long, it asks for another one. */
  async sharePdf() {
    const file = this.prepared ?? (await this.make("pdf"));
    if (!file) return;
    try {
      await navigator.share({ files: [file], title: file.name });
      this.prepared = null;
    } catch (error) {
      if (error.name === "AbortError") return; // the person has closed the list
      this.prepared = error.name === "NotAllowedError" ? file : null;
      notify(this.prepared ? "The PDF is ready. Press Share again." : "This browser cannot share the PDF. Download it.");
    }
  }
}
