// View "Flatten": photos or the camera in, a strip of flat pages, one document out.

import { button, confirmed, labelled, make, notify, select } from "../elements.js";
import { showImage } from "../pictures.js";
import { hasCamera, useCamera } from "./camera.js";
import { editCorners } from "./corners.js";
import { FilesBar } from "./files_bar.js";
import { Kept } from "./kept.js";
import { haveAlone } from "./one_tab.js";
import { PageItem } from "./page_item.js";
import { Pages } from "./pages.js";
import { KINDS, progressText } from "./words.js";
import { AGAIN_MS, Work } from "./work.js";

const ACCEPTED = "image/*,.heic,.heif,.tif,.tiff,.webp,.pdf";

export function createView() {
  const pages = new Pages();
  const kept = new Kept(pages);
  const work = new Work(pages, kept);
  const items = new Map(); // by page
  const bar = new FilesBar(pages, kept, clear);
  const photos = make("input", { type: "file", multiple: true, accept: ACCEPTED, onchange: () => add([...photos.files]) });
  const capture = make("input", { type: "file", accept: "image/*", capture: "environment", class: "unseen", tabindex: "-1", "aria-label": "Phone's own", onchange: () => add([...capture.files]) });
  const camera = button("Camera", openCamera, "primary");
  const kind = select(KINDS, "page", async () => {
    const photos = kind.value;
    await pages.set({ photos });
    kind.value = photos; // what was stored may have come in between
  });
  const drop = make(
    "div",
    { class: "panel drop", ondragover: over, ondragleave: over, ondrop: dropped },
    make("div", { class: "field" }, camera, capture),
    labelled("Photos", photos),
    labelled("Each photo shows", kind),
  );
  const meter = make("progress", { max: 1, value: 0, "aria-label": "Pages that are ready" });
  const line = make("span", { role: "status" });
  const again = button("Flatten", () => {
    work.again();
    progress.focus(); // the button is gone
  });
  const whatAgain = make("small", { id: "what-flatten-does" }, "Flatten tries again what is not flat yet.");
  again.setAttribute("aria-describedby", whatAgain.id);
  const progress = make("p", { class: "progress", hidden: true, tabindex: "-1" }, meter, line, again, whatAgain);
  const strip = make("ol", { class: "pages", "aria-label": "Pages" });
  const empty = make(
    "div",
    { class: "panel empty", hidden: true },
    make("p", {}, "Photograph a page, or choose photos. Each becomes a flat page here, and all of them one PDF."),
    button("Try an example", example),
  );
  const here = make("div", {}, drop, progress, empty, strip, bar.element);
  const takeOver = button("Use them here", () => takePages(), "primary");
  const elsewhere = make("div", { class: "panel empty", role: "status", hidden: true }, make("p", {}, "Your pages are open in another tab."), takeOver);
  const element = make("div", { class: "view scan" }, make("h1", {}, "Flatten"), elsewhere, here);
  let takePages = null;
  const acts = {
    corners: (page) => editCorners(page, kept).catch((problem) => kept.refused(page, problem)),
    rotate: (page) => kept.change(page, (facts) => ({ rotate: (facts.rotation + 90) % 360 }), 1).then(() => work.start()),
    both: (page) => work.both(page),
    join,
    look: setLook,
    lookForAll: ({ look }) => Promise.all(pages.list.filter((page) => page.state === "ready" && page.look !== look).map((page) => setLook(page, look))),
    move,
    remove,
    view: showWhole,
    again: (page) => {
      pages.update(page, { state: "waiting", problem: null });
      work.resume();
    },
    addTo: async (page, files) => {
      await pages.addTo(page, files);
      work.start();
    },
  };

  function over(event) {
    event.preventDefault();
    drop.classList.toggle("is-over", event.type === "dragover");
  }

  function dropped(event) {
    over(event);
    event.stopPropagation();
    drop.classList.remove("is-over");
    add([...event.dataTransfer.files]);
  }

  document.addEventListener("paste", (event) => {
    if (element.isConnected && pages.isHere && event.clipboardData.files.length) add([...event.clipboardData.files]);
  });

  async function add(files) {
    photos.value = capture.value = "";
    if (!files.length) return;
    await pages.add(files);
    work.start();
  }

  /** The camera in the page; without one, or where the person does not allow it, that of the phone. */
  async function openCamera() {
    if (!hasCamera()) return capture.click();
    try {
      await useCamera((file) => add([file]));
    } catch {
      notify("The page may not use a camera here. Choose photos, or take them with the phone's own camera.");
      capture.classList.remove("unseen");
      capture.removeAttribute("tabindex");
      capture.focus();
    }
    return camera.focus();
  }

  async function example() {
    const response = await fetch(new URL("example.jpg", import.meta.url));
    await add([new File([await response.blob()], "Example.jpg", { type: "image/jpeg" })]);
  }

  async function move(page, by) {
    await pages.move(page, by);
    const item = items.get(page);
    item.element.scrollIntoView({ block: "nearest", inline: "nearest" });
    const pressed = by < 0 ? item.earlier : item.later;
    (pressed.disabled ? (by < 0 ? item.later : item.earlier) : pressed).focus();
    notify(`It is page ${pages.list.indexOf(page) + 1} now.`);
  }

  /** Joins the photos of a page and of the next one to one large page. */
  async function join(page) {
    const next = pages.list[pages.list.indexOf(page) + 1];
    if (next?.state !== "ready" || next.part) return notify("The next page is not ready to be joined.");
    const joined = await pages.join(page, next);
    items.get(joined)?.title.focus(); // it may be outside of a phone's window
    return work.start();
  }

  async function remove(page) {
    const at = pages.list.indexOf(page);
    const done = kept.remove(page); // the strip shows it at once
    const next = pages.list[Math.min(at, pages.list.length - 1)];
    (next ? items.get(next).title : camera).focus();
    notify("The page is removed.");
    await done;
  }

  async function clear() {
    const text = "All pages are deleted, here and in the service.";
    if (!(await confirmed("Clear all pages?", text, "Delete all"))) return;
    const done = pages.list.map((page) => kept.remove(page)); // the strip shows it at once
    bar.name.value = "";
    camera.focus();
    await Promise.all([...done, pages.set({ name: "" })]);
  }

  /** Changes the look of a page; photos that come later have it too. It shows at once what was chosen. */
  async function setLook(page, look) {
    const before = page.look;
    await Promise.all([pages.update(page, { look }), pages.set({ look })]);
    await kept.change(page, () => ({ illumination: look }));
    if (page.problem && page.look === look) await pages.update(page, { look: before });
    work.start();
  }

  /** A page alone, as large as the window or at full size. */
  async function showWhole(page) {
    if (!page.picture) return;
    const picture = make("img", { alt: "Page" });
    const full = button("100 %", () => {
      const isOn = dialog.classList.toggle("full-size");
      full.setAttribute("aria-pressed", String(isOn));
    });
    const close = button("Close", () => dialog.close(), "primary");
    const view = make("div", { class: "whole-view", tabindex: "0", role: "region", "aria-label": "Page" }, picture);
    const dialog = make("dialog", { class: "wide", "aria-label": "Page" }, make("div", { class: "row" }, close, full), view);
    document.body.append(dialog);
    dialog.showModal();
    dialog.addEventListener("close", () => dialog.remove());
    await showImage(picture, page.picture);
    const whole = await kept.whole(page).catch(() => null); // without the service the small picture is all there is
    if (whole) await showImage(picture, whole);
  }

  function showCount() {
    const { count } = pages;
    const { all, ready, changing, failed, open } = count;
    empty.hidden = all > 0;
    progress.hidden = !all;
    meter.hidden = !open;
    meter.max = Math.max(all, 1);
    meter.value = ready - changing + failed;
    const text = progressText(count);
    if (line.textContent !== text) line.textContent = text;
    again.hidden = whatAgain.hidden = !failed && !pages.list.some((page) => page.state === "waiting" && page.problem);
    bar.show(count);
  }

  /** The items in the order of the pages. Only what has another place moves, and keeps the focus. */
  function showOrder() {
    const focused = document.activeElement;
    const elements = pages.list.map((page) => items.get(page).element);
    for (const old of [...strip.children]) if (!elements.includes(old)) old.remove();
    elements.forEach((one, index) => strip.children[index] === one || strip.insertBefore(one, strip.children[index]));
    if (focused !== document.activeElement && strip.contains(focused)) focused.focus();
  }

  pages.addEventListener("list", () => {
    for (const page of items.keys()) if (!pages.list.includes(page)) items.delete(page);
    for (const page of pages.list) if (!items.has(page)) items.set(page, new PageItem(page, acts));
    showOrder();
    pages.list.forEach((page, index) => items.get(page).show(index + 1, pages.list.length));
    showCount();
  });
  pages.addEventListener("page", ({ detail: page }) => {
    items.get(page)?.show(pages.list.indexOf(page) + 1, pages.list.length);
    showCount();
  });

  let languages = [];
  let isLoaded = false;
  async function open() {
    if (isLoaded) return;
    isLoaded = true;
    await pages.loaded;
    takePages = haveAlone(showHere);
    await ask();
  }

  /** Shows the pages as they are stored, where this tab has them. */
  async function showHere(isHere) {
    const isTaken = isHere && !elsewhere.hidden;
    pages.isHere = isHere;
    if (isTaken) await (pages.loaded = pages.load());
    here.hidden = !isHere;
    elsewhere.hidden = isHere;
    if (!isHere) return;
    pages.tell("list");
    kind.value = pages.settings.photos;
    bar.offer([...languages]);
    if (isTaken) camera.focus();
    work.start();
  }

  /** What the service has; it is asked again until it is there. */
  async function ask() {
    try {
      languages = await work.ask();
      bar.offer(languages);
      work.start();
    } catch {
      setTimeout(ask, AGAIN_MS);
    }
  }

  return { element, open, keyChanged: () => work.keyChanged() };
}
