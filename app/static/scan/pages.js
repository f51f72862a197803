// The pages of the scan screen in their order. A change of one is stored in the browser and told to who listens.

import { filesOf, forgetFiles, forgetPage, storedPages, storedSettings, storeFiles, storePage, storeSettings } from "./storage.js";

const SETTINGS = { name: "", language: "", look: "normalize", photos: "page" };

/** A name that no other page has. `crypto.randomUUID` exists over TLS only. */
const newKey = () => Array.from(crypto.getRandomValues(new Uint32Array(4)), (part) => part.toString(36)).join("-");

/** The key of the files of a page: its own, or that of the page that came of the same file before. */
export const filesKeyOf = (page) => page.filesKey ?? page.key;

/** What the service has of each photo of a page: paths, null for those that it does not have. */
const partsOf = (page) => (page.kind === "joined" ? page.parts : [page.id && `pages/${page.id}`]);

/**
 * A page is an object of
 * - `key`, `place` (its number in the order), `kind` ("page"; "spread": both pages of a book; "joined": of many photos),
 *   `names` of its files,
 * - `state`: "waiting", "working", "ready" or "failed" (with `problem`); `job` while the service works at it,
 * - `part`: which part of its file it is, where that has several: "left" and "right" of a book, or "page 2", and `index`,
 *   its number in the answer about the file; `filesKey`: the key of its files, which all pages of a file share,
 * - `given`: the corners that a person gave last, "auto" where they were found again,
 * - `id` of the kept page, `picture` (a Blob), `facts` and `look`, once it is flat; `readIn`: the language of its text,
 * - `parts`: of a joined page, what the service has of each of its photos: "pages/ID", "uploads/ID" or null; `sources`:
 *   keys of the pages that it is joined of, until it is flat,
 * - `isChanging` while another picture of it is on its way, `turns`: quarter turns that its picture does not show yet
 *   (neither is stored).
 *
 * Events: "list" (the pages or their order), "page" (`detail` is the page).
 */
export class Pages extends EventTarget {
  constructor() {
    super();
    this.list = [];
    this.settings = { ...SETTINGS };
    this.isHere = true; // whether this tab has the pages, and no other
    this.loaded = this.load();
  }

  /** Takes up what the browser has stored: what was under way goes on, or begins again. */
  async load() {
    this.settings = { ...SETTINGS, ...(await storedSettings()) };
    const isHeld = (page) => page.state === "working";
    const stored = (await storedPages()).map((page) => ({ parts: page.names.map(() => null), ...page, ...(isHeld(page) && { state: "waiting" }) }));
    const own = new Map(this.list.map((page) => [page.key, page])); // what is under way goes on with the same object
    this.list = stored.map((page) => Object.assign(own.get(page.key) ?? {}, page)).sort((a, b) => a.place - b.place);
  }

  tell(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }

  async set(settings) {
    await this.loaded; // a person may be faster than the browser
    Object.assign(this.settings, settings);
    return this.isHere && storeSettings(this.settings);
  }

  /** Adds photos at the end: each a page, or all of them one page that is joined. */
  async add(files) {
    await this.loaded; // a person may be faster than the browser
    const kind = this.settings.photos;
    const groups = kind === "joined" ? [files] : files.map((file) => [file]);
    for (const group of groups) {
      const page = this.newPage({ kind, names: group.map((file) => file.name), parts: group.map(() => null) });
      this.list.push(page);
      await storeFiles(page.key, group);
      await storePage(page);
    }
    this.tell("list");
  }

  /** Adds photos to a page that is joined of many. */
  async addTo(page, files) {
    const all = [...(await filesOf(filesKeyOf(page))), ...files];
    await storeFiles(filesKeyOf(page), all);
    const parts = [...page.parts, ...files.map(() => null)];
    this.update(page, { parts, names: all.map((file) => file.name), state: "waiting", problem: null, id: null, job: null });
  }

  /** Adds one page that is joined of two, behind them. They go when it is flat, so that nothing is lost if it fails. */
  async join(page, other) {
    const both = [page, other];
    const key = newKey();
    await storeFiles(key, (await Promise.all(both.map((one) => filesOf(filesKeyOf(one))))).flat());
    const names = both.flatMap((one) => one.names);
    const sources = both.map((one) => one.key);
    return this.insertAfter(other, { key, kind: "joined", names, look: page.look, parts: both.flatMap(partsOf), sources });
  }

  newPage(more) {
    const place = 1 + Math.max(0, ...this.list.map((page) => page.place));
    const empty = { id: null, job: null, problem: null, picture: null, facts: null, readIn: null };
    return { key: newKey(), place, look: this.settings.look, state: "waiting", ...empty, ...more };
  }

  /** Adds a further page of a file behind another one; that page. */
  async insertAfter(page, more) {
    const next = this.list[this.list.indexOf(page) + 1];
    const place = next ? (page.place + next.place) / 2 : page.place + 1;
    const added = { ...this.newPage(more), place };
    this.list.splice(this.list.indexOf(page) + 1, 0, added);
    this.tell("list");
    if (this.isHere) await storePage(added);
    return added;
  }

  update(page, changes) {
    Object.assign(page, changes);
    if (!this.list.includes(page)) return undefined; // it was removed meanwhile
    this.tell("page", page);
    if (!this.isHere) return undefined; // another tab has the pages: it stores them
    const { isChanging, turns, ...stored } = page;
    return storePage(stored);
  }

  /** Moves a page by one place: -1 earlier, 1 later. */
  async move(page, by) {
    const at = this.list.indexOf(page);
    const other = this.list[at + by];
    if (!other) return;
    [page.place, other.place] = [other.place, page.place];
    [this.list[at], this.list[at + by]] = [other, page];
    this.tell("list");
    await Promise.all([this.update(page, {}), this.update(other, {})]);
  }

  async remove(page) {
    this.list = this.list.filter((one) => one !== page);
    this.tell("list");
    await forgetPage(page.key);
    const files = filesKeyOf(page);
    if (!this.list.some((one) => filesKeyOf(one) === files)) await forgetFiles(files);
  }

  /** Numbers for a line such as "2 of 3 pages are ready". */
  get count() {
    const of = (state) => this.list.filter((page) => page.state === state).length;
    const changing = this.list.filter((page) => page.isChanging).length; // of those that are ready
    return { all: this.list.length, ready: of("ready"), changing, failed: of("failed"), open: of("waiting") + of("working") };
  }
}
