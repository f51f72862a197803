// Downloads of a page in other formats: the same request again, in that format.

import { make, notify, save } from "../elements.js";
import { work } from "../service.js";

const EXTENSIONS = { jpeg: "jpg", hocr: "html", markdown: "md" };

/**
 * A link that sends the request with another format when it is followed, and saves the answer.
 * `formOf` makes the form without the format; `onProgress` as for `work`.
 */
export function downloadLink(text, { path, formOf, format, more = {}, name, onProgress, onProblem }) {
  let isBusy = false;
  const follow = async (event) => {
    event.preventDefault();
    if (isBusy) return;
    isBusy = true;
    link.setAttribute("aria-busy", "true");
    try {
      const form = formOf();
      for (const [option, value] of Object.entries({ ...more, format })) form.set(option, value);
      const response = await work(path, form, onProgress);
      save(await response.blob(), `${name}.${EXTENSIONS[format] ?? format}`);
      notify(`${text}: done.`);
    } catch (error) {
      onProblem(error);
    } finally {
      isBusy = false;
      link.removeAttribute("aria-busy");
    }
  };
  const link = make("a", { href: `#flatten/${format}`, class: "download", onclick: follow }, text);
  return link;
}

/** A link that saves bytes that are already here. */
export function saveLink(text, blob, name) {
  return make("a", { href: URL.createObjectURL(blob), download: name, class: "download" }, text);
}
