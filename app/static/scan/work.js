// Photos become flat pages: several at a time, each sent once.

import { begin, get, outcome, Problem } from "../service.js";
import { SHOWN, shown } from "./kept.js";
import { filesKeyOf } from "./pages.js";
import { appendParts } from "./parts.js";
import { filesOf } from "./storage.js";

export const AGAIN_MS = 5000; // pause before what waits for the service is tried again
const LATER = ["busy", "not-ready", "unreachable", "too-many-requests"]; // refusals that end by themselves
const HAS_PAGES = /\.(pdf|tiff?)$/i; // files that may hold several pages: these are numbered
const isFlat = (result) => Boolean(result.mesh || result.patches);
const isKept = (part) => Boolean(part?.startsWith("pages/"));
const hasKeptPhotos = (page) => Boolean(page.former || page.parts?.some(isKept));
const KEY = ["unauthorized", "forbidden"]; // refusals that end with another key

export class Work {
  /** `pages` is a `Pages`, `kept` what the service keeps of them. Photos are sent as soon as they are there. */
  constructor(pages, kept) {
    Object.assign(this, { pages, kept, running: new Set(), atOnce: 2, needsKey: false, pausedUntil: 0 });
    window.addEventListener("online", () => this.resume());
  }

  /** What the service has: languages that it reads, and how many photos it works at once. */
  async ask() {
    const { workers, languages, ocr } = await get("health/ready");
    this.atOnce = Math.max(1, Math.min(4, workers)) + 1; // one more is sent while these are worked at
    Object.assign(this.kept, { canRead: ocr !== null, atOnce: this.atOnce - 1 });
    return languages;
  }

  /** Begins what waits, as far as there is room; then reads what is flat. */
  start() {
    if (this.needsKey || Date.now() < this.pausedUntil || !this.pages.isHere) return;
    const isWhole = (page) => page.kind !== "joined" || page.names.length > 1;
    const waiting = this.pages.list.filter((page) => page.state === "waiting" && isWhole(page) && !this.running.has(page));
    const begun = waiting.slice(0, this.atOnce - this.running.size);
    begun.forEach((page) => this.flatten(page));
    this.kept.busy = this.running.size;
    if (begun.length === waiting.length && this.kept.busy < this.kept.atOnce) this.kept.readAhead();
  }

  resume() {
    this.pausedUntil = 0;
    this.start();
  }

  async flatten(page) {
    this.running.add(page);
    await this.pages.update(page, { state: "working", problem: null });
    try {
      await this.receive(page, await (await this.answerFor(page)).json());
    } catch (error) {
      if (error.code === "not-found" && hasKeptPhotos(page)) this.sendAgain(page);
      else this.refused(page, error);
    } finally {
      this.running.delete(page);
      this.start();
    }
  }

  /** The response about a page. A job that was begun before a reload goes on: its photo is not sent again. */
  async answerFor(page) {
    if (!page.job) {
      const path = page.kind === "joined" ? "mosaic" : "rectify";
      const { job, response } = await begin(path, await this.formOf(page));
      if (response) return response;
      await this.pages.update(page, { job });
    }
    try {
      return await outcome(page.job);
    } catch (error) {
      if (error.code !== "unreachable") this.pages.update(page, { job: null });
      throw error;
    }
  }

  async formOf(page) {
    const form = new FormData();
    const options = { ...SHOWN, keep_photo: "true", illumination: page.look, title: page.names[0] };
    if (page.kind === "joined") await appendParts(form, page, this.pages, this.kept.endOf(page));
    else Object.assign(options, { on_no_text: "keep", pages: page.kind === "spread" ? "both" : "main", ...(await this.photoOf(page)) });
    for (const [option, value] of Object.entries(options)) form.append(option, value);
    return form;
  }

  /** The option that has the photo of a page: by the id of the page before, where the service has it. */
  async photoOf(page) {
    if (page.former) return { kept_page: page.former };
    const [image] = await filesOf(filesKeyOf(page));
    if (!image) throw new Problem({ code: "photo-gone" });
    return { image };
  }

  async receive(page, answer) {
    const results = answer.pages ?? [answer];
    const { kind, names, look, former, sources } = page;
    const wanted = page.part ? [results[page.index] ?? {}] : results; // the other parts are in the strip already
    await this.kept.forget(results.filter((result) => !wanted.includes(result)));
    if (!wanted.some(isFlat)) throw new Problem(wanted[0].problem ?? {});
    if (!this.pages.list.includes(page)) return this.kept.forget(wanted); // it was removed meanwhile
    const sides = kind === "spread" && !HAS_PAGES.test(names[0]) ? ["left", "right"] : [];
    const partOf = (index) => (results.length > 1 ? { index, part: sides[index] ?? `page ${index + 1}` } : {});
    const outcomeOf = (result) => (isFlat(result) ? { ...shown(result), id: result.page_id, state: "ready" } : { problem: result.problem, state: "failed" });
    const become = (result) => ({ ...outcomeOf(result), ...partOf(results.indexOf(result)), job: null, former: null, sources: null });
    for (const result of wanted.slice(1).reverse()) {
      await this.pages.insertAfter(page, { kind, names, look, filesKey: filesKeyOf(page), ...become(result) });
    }
    await this.pages.update(page, become(wanted[0]));
    for (const source of this.pages.list.filter(({ key }) => sources?.includes(key))) await this.pages.remove(source);
    return former && this.kept.forget([{ page_id: former }]);
  }

  /** What the service no longer keeps is sent again. */
  sendAgain(page) {
    const parts = page.parts?.map((part) => (isKept(part) ? null : part));
    this.pages.update(page, { former: null, parts, state: "waiting" });
  }

  /** Makes two pages of a photo that shows both pages of a book: of the photo that the service keeps. */
  both(page) {
    this.pages.update(page, { kind: "spread", state: "waiting", problem: null, job: null, former: page.id });
    this.resume();
  }

  /** What becomes of a page that the service refuses: it waits, or the person must see to it. */
  refused(page, error) {
    const { code = "internal", detail, retryAfter } = error;
    this.needsKey ||= KEY.includes(code);
    if (LATER.includes(code)) {
      const pause = retryAfter * 1000 || AGAIN_MS;
      this.pausedUntil = Date.now() + pause;
      setTimeout(() => this.start(), pause + 1);
    }
    const waits = this.needsKey || LATER.includes(code);
    this.pages.update(page, { state: waits ? "waiting" : "failed", problem: { code, detail } });
  }

  /** Sends again what failed. */
  again() {
    for (const page of this.pages.list) if (page.state === "failed") this.pages.update(page, { state: "waiting", problem: null });
    this.resume();
  }

  /** Another key is in use: what waited for it goes on. */
  keyChanged() {
    this.needsKey = false;
    for (const page of this.pages.list) if (KEY.includes(page.problem?.code)) this.pages.update(page, { problem: null });
    this.resume();
  }
}
