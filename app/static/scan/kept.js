// Pages that the service keeps: changed as the person says, read, bound to files, and deleted. No photo is sent again.

import { imageOf } from "../pictures.js";
import { post, request } from "../service.js";
import { borderOf } from "./overlay.js";

const SHOWN_PX = Math.min(1200, Math.round(600 * devicePixelRatio)); // a page of the strip is 300 to 540 px wide

/** Options of an answer whose picture the strip shows. */
export const SHOWN = { format: "json", embed_format: "jpeg", max_width: SHOWN_PX, max_height: Math.round(1.42 * SHOWN_PX) };

const rounded = (points) => points.map(([x, y]) => [Math.round(x * 10) / 10, Math.round(y * 10) / 10]);

/** What the screen needs of an answer about a flat page. Corners that were not seen are those of the view. */
function factsOf({ width, height, orientation, warnings, quality, corners, photo, mesh }) {
  const last = mesh.rows - 1;
  const view = [mesh.source[0][0], mesh.source[0].at(-1), mesh.source[last].at(-1), mesh.source[last][0]];
  const seen = rounded(view.map((point, index) => corners[index] ?? point));
  return { width, height, warnings, quality, photo, corners: seen, rotation: orientation.rotation_deg };
}

/** A kept page for a joined page, which counts as its own photo. `places` are outlines of its photos. */
function factsOfJoined({ width, height, warnings, patches }) {
  const places = patches.map((patch) => (patch.placed ? rounded(borderOf(patch.mesh.target)) : null));
  return { width, height, warnings, quality: null, photo: null, corners: null, rotation: 0, places };
}

/** What an answer changes of a page of the strip. */
export const shown = (result) => ({
  picture: imageOf(result.image),
  facts: result.patches ? factsOfJoined(result) : factsOf(result),
  problem: null,
  readIn: null,
});

export class Kept {
  /** `pages` is a `Pages`. */
  constructor(pages) {
    Object.assign(this, { pages, canRead: true, atOnce: 1, busy: 0, ahead: 0, changes: new Map(), readings: new Map(), ends: new Map() });
  }

  /** A signal for requests that end with the page: they would be about nothing. */
  endOf(page) {
    if (!this.ends.has(page.key)) this.ends.set(page.key, new AbortController());
    return this.ends.get(page.key).signal;
  }

  /** Answers again about a page. */
  answer(page, body) {
    return post(`pages/${page.id}/render`, body, {}, this.endOf(page));
  }

  /**
   * Answers again about a page with what the person says: `wish` makes the body, after all earlier changes are done.
   * Quarter `turns` of it are shown meanwhile.
   */
  change(page, wish, turns = 0) {
    const before = this.changes.get(page.key) ?? Promise.resolve();
    this.pages.update(page, { turns: (page.turns ?? 0) + turns });
    const done = before.then(() => this.render(page, wish(page.facts), turns));
    this.changes.set(page.key, done);
    return done;
  }

  async render(page, wish, turns) {
    this.pages.update(page, { isChanging: true, problem: null });
    try {
      const changed = shown(await this.answer(page, { ...SHOWN, ...wish }));
      if (page.facts.places && !("rotate" in wish)) changed.facts.places = page.facts.places;
      await this.pages.update(page, { ...changed, isChanging: false, turns: page.turns - turns });
    } catch (error) {
      page.turns -= turns;
      this.refused(page, error);
    }
  }

  refused(page, { code = "internal", field, detail }) {
    const isGone = code === "not-found";
    this.pages.update(page, { isChanging: false, problem: { code, field, detail }, ...(isGone ? { state: "failed", id: null } : {}) });
  }

  /** Reads pages that are flat and not read yet, some at once, so that a searchable file is made quickly. */
  async readAhead() {
    if (!this.canRead || !this.pages.isHere) return;
    const room = this.atOnce + this.ahead - this.busy - this.readings.size; // `busy` of the workers flatten
    const begun = this.unread().slice(0, Math.max(this.readings.size ? 0 : 1, room));
    await Promise.all(begun.map((page) => this.read(page).then(() => this.readAhead())));
  }

  /** Resolves when changes that are under way are done, and all pages are read where `isRead`. */
  async settled(isRead) {
    await Promise.all(this.changes.values());
    this.ahead = 1; // one more is asked for while the workers read: nobody waits for anything else
    while (isRead && this.canRead && (this.readings.size || this.unread().length)) {
      this.readAhead();
      await Promise.race(this.readings.values());
    }
    this.ahead = 0;
  }

  unread() {
    const { language } = this.pages.settings;
    const isUnread = (page) => page.state === "ready" && page.readIn !== language && !page.isChanging && !page.problem;
    return this.pages.list.filter((page) => isUnread(page) && !this.readings.has(page.key));
  }

  /** Has the service read a page; it keeps the text. What cannot be read is a page all the same. */
  read(page) {
    const reading = this.readPage(page).finally(() => this.readings.delete(page.key));
    this.readings.set(page.key, reading);
    return reading;
  }

  async readPage(page) {
    const { language } = this.pages.settings;
    const { facts } = page;
    try {
      await this.answer(page, { format: "json", text: true, ...(language ? { language } : {}) });
      if (page.facts === facts) await this.pages.update(page, { readIn: language }); // else it was changed meanwhile
    } catch (error) {
      if (error.code === "not-found") this.refused(page, error);
      else if (error.code === "invalid-option") this.canRead = false; // no engine, or no such language
      else await this.pages.update(page, { readIn: language }); // the file reads it, if it can
    }
  }

  /** A file of all pages that are ready, after what is under way. Throws the `Problem` where there is none. */
  async file(format) {
    const isRead = format === "txt" || (format === "pdf" && this.canRead);
    await this.settled(isRead);
    const { name, language } = this.pages.settings;
    const ready = this.pages.list.filter((page) => page.state === "ready" && page.id);
    const body = { pages: ready.map((page) => page.id), format, title: name.trim(), text: isRead };
    if (isRead && language) body.language = language;
    try {
      return await (await request("POST", "pages/bind", { body })).blob();
    } catch (error) {
      for (const page of ready) if (error.code === "not-found" && error.detail.includes(page.id)) this.refused(page, error);
      throw error;
    }
  }

  /** The photo of a page, upright. */
  photo = async (page, width) => (await request("GET", `pages/${page.id}/photo?width=${width}`)).blob();

  /** The flat page at full resolution. */
  whole = async (page) => (await request("POST", `pages/${page.id}/render`, { body: { format: "jpeg" } })).blob();

  /** Deletes a page, here and in the service. */
  async remove(page) {
    const { id, job, parts } = page;
    this.ends.get(page.key)?.abort();
    this.ends.delete(page.key);
    await this.pages.remove(page);
    const used = this.pages.list.flatMap((one) => [`pages/${one.id}`, ...(one.parts ?? [])]);
    await this.forgetPaths((parts ?? []).filter((part) => !used.includes(part)));
    if (id) await this.forget([{ page_id: id }]);
    else if (job) await this.forgetPaths([`jobs/${job.id}`]);
  }

  /** Deletes the kept pages of answers. */
  forget(results) {
    return this.forgetPaths(results.map(({ page_id: id }) => id && `pages/${id}`));
  }

  async forgetPaths(paths) {
    for (const path of paths) if (path) await request("DELETE", path).catch(() => {});
  }
}
