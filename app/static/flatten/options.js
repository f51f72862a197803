// Options of a request, as far as the service has them: their values come from the OpenAPI document.

import { checkbox, labelled, make, select } from "../elements.js";
import { formFields } from "../service.js";

const TEXTS = {
  kind: { label: "Shape", auto: "find out", planar: "flat page", curved: "bent page" },
  illumination: { label: "Light", keep: "as in the photo", normalize: "dark ink on white paper" },
  crop: { label: "View", sheet: "the sheet", text: "the text with margins", photo: "the whole photo" },
  paper: { label: "Paper size" },
  language: { label: "Language" },
  composition: { label: "Words", selective: "from the sharpest photo", average: "average of the photos" },
};

/** Choices of a field: the values of its enumeration, also where it is optional or a reference. */
function valuesOf(schema) {
  return schema?.enum ?? schema?.anyOf?.flatMap((part) => part.enum ?? []) ?? [];
}

/** Controls for the named fields of a form, and `apply(form)`, which adds what was chosen. */
export async function optionControls(path, names) {
  const fields = await formFields(path);
  const controls = new Map();
  const element = make("div", { class: "options" });
  for (const name of names.filter((name) => name in fields)) {
    const texts = TEXTS[name];
    const values = valuesOf(fields[name]);
    if (fields[name].type === "boolean") {
      const box = checkbox(texts.label, fields[name].default);
      controls.set(name, () => String(box.firstElementChild.checked));
      element.append(box);
    } else if (values.length) {
      const control = select(values.map((value) => [value, texts[value] ?? value]), fields[name].default);
      controls.set(name, () => control.value);
      element.append(labelled(texts.label, control));
    } else {
      const control = make("input", { type: "text", placeholder: fields[name].default ?? "" });
      controls.set(name, () => control.value.trim());
      element.append(labelled(texts.label, control));
    }
  }
  const apply = (form) => {
    for (const [name, value] of controls) if (value()) form.append(name, value());
  };
  return { element, apply, has: (name) => name in fields };
}
