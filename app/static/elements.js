// Elements of the page. All text is set as text, never as markup.

const SVG = "http://www.w3.org/2000/svg";

function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes ?? {})) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined));
  return element;
}

/** An HTML element; attributes that begin with `on` are event listeners. */
export function make(name, attributes, ...children) {
  return fill(document.createElement(name), attributes, children);
}

/** An SVG element. */
export function draw(name, attributes, ...children) {
  return fill(document.createElementNS(SVG, name), attributes, children);
}

export function button(text, action, className) {
  return make("button", { type: "button", class: className, onclick: action }, text);
}

let last = 0;
/** A form control with its label. */
export function labelled(text, control, hint) {
  control.id ||= `field-${++last}`;
  const help = hint && make("small", { id: `${control.id}-hint` }, hint);
  if (help) control.setAttribute("aria-describedby", help.id);
  return make("div", { class: "field" }, make("label", { for: control.id }, text), control, help);
}

/** A select; options are values, or pairs of a value and its text. */
export function select(options, value, onchange) {
  const control = make("select", { onchange });
  setOptions(control, options, value);
  return control;
}

export function setOptions(control, options, value) {
  control.replaceChildren(
    ...options.map((option) => {
      const [id, text] = Array.isArray(option) ? option : [option, option];
      return make("option", { value: id }, text);
    }),
  );
  if (value !== undefined && value !== null) control.value = value;
}

export function checkbox(text, checked, onchange) {
  return make("label", { class: "check" }, make("input", { type: "checkbox", checked, onchange }), ` ${text}`);
}

/** Says something to everybody, also to those who do not see the page. */
export function notify(text) {
  const notice = document.getElementById("notice");
  notice.textContent = "";
  requestAnimationFrame(() => (notice.textContent = text));
}

/** A problem as a part of the page. */
export function problemNote(problem) {
  const detail = problem.detail ?? "The work failed. Try again.";
  const id = problem.request_id ? make("small", {}, ` (${problem.code}, request ${problem.request_id})`) : "";
  return make("p", { class: "problem", role: "alert" }, detail, id);
}

/** Asks before something is changed that is hard to take back. Resolves to true or false. */
export function confirmed(title, text, action) {
  const dialog = make(
    "dialog",
    { "aria-label": title },
    make(
      "form",
      { method: "dialog" },
      make("h2", {}, title),
      make("p", {}, text),
      make(
        "p",
        { class: "row" },
        make("button", { value: "no", class: "primary", autofocus: true }, "Cancel"),
        make("button", { value: "yes" }, action),
      ),
    ),
  );
  document.body.append(dialog);
  dialog.showModal();
  return new Promise((resolve) =>
    dialog.addEventListener("close", () => {
      dialog.remove();
      resolve(dialog.returnValue === "yes");
    }),
  );
}

/** Saves bytes under a name, as a click on a link does. */
export function save(blob, name) {
  const link = make("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}

export const percent = (share) => `${Math.round(share * 100)} %`;
export const when = (time) => new Date(time).toLocaleString();
