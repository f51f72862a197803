// The shell of the page: which view is shown, and the API key.

import { notify, problemNote } from "./elements.js";
import { address, apiKey, refusalOfKey, setApiKey } from "./service.js";

const VIEWS = {
  flatten: { title: "Flatten", load: () => import("./scan/view.js") },
  layout: { title: "Layout", load: () => import("./layout/view.js") },
  models: { title: "Models", load: () => import("./models/view.js") },
  review: { title: "Review", load: () => import("./review/view.js") },
};
const main = document.getElementById("main");
const shown = new Map();
let current = null;

/** Name of the view and what it shows, from the address: `#review/01M7...`. */
function place() {
  const [name, ...rest] = location.hash.slice(1).split("/");
  return [name in VIEWS ? name : "flatten", rest.map(decodeURIComponent)];
}

async function show() {
  const [name, rest] = place();
  for (const link of document.querySelectorAll("nav a")) {
    if (link.hash === `#${name}`) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  document.title = `${VIEWS[name].title} - Document rectification`;
  const view = (current = { name });
  try {
    if (!shown.has(name)) {
      const module = await VIEWS[name].load();
      shown.set(name, module.createView());
    }
    if (current !== view) return; // another view was chosen meanwhile
    const { element, open } = shown.get(name);
    if (main.firstElementChild !== element) main.replaceChildren(element);
    await open?.(rest);
  } catch (error) {
    if (current === view) main.append(problemNote(error));
  }
}

const dialog = document.getElementById("key-dialog");
const reason = document.getElementById("key-reason");
const field = document.getElementById("key-field");

const NEEDED = "The service needs a key. Whoever runs it has one for you.";
const REFUSED = "The service does not know this key, or not for this. Check it and enter it again.";

function askForKey(why) {
  if (dialog.open && why) reason.textContent = why;
  if (dialog.open) return;
  reason.textContent = why ?? "The key stays in this browser tab.";
  field.value = apiKey();
  dialog.returnValue = "cancel";
  dialog.showModal();
  field.focus();
}

document.getElementById("key-button").addEventListener("click", () => askForKey());
document.addEventListener("key-needed", () => askForKey(apiKey() ? REFUSED : NEEDED));
dialog.addEventListener("close", () => {
  if (dialog.returnValue === "cancel") return;
  setApiKey(dialog.returnValue === "use" ? field.value.trim() : "");
  field.value = "";
  tryKey();
});

/** Uses the key that was entered, unless the service refuses it. A view that holds work goes on with it. */
async function tryKey() {
  if (apiKey() && (await refusalOfKey())) return askForKey(REFUSED);
  notify(apiKey() ? "The key is in use." : "No key is in use.");
  for (const [name, view] of shown) if (!view.keyChanged) shown.delete(name);
  for (const view of shown.values()) view.keyChanged();
  return show();
}

document.querySelector(".skip").addEventListener("click", (event) => {
  event.preventDefault();
  main.focus();
});
window.addEventListener("hashchange", () => {
  show();
  main.focus();
});
// A photo that is dropped beside the field must not replace the page.
for (const name of ["dragover", "drop"]) window.addEventListener(name, (event) => event.preventDefault());
// Over TLS the page shows itself and its state without a network. It works without that, too.
navigator.serviceWorker?.register(address("service-worker.js")).catch(() => {});
show();
