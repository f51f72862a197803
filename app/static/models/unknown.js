// Pages that fit no class: listed, labelled, and made the samples of a class.

import { button, make, notify, when } from "../elements.js";
import { PageEditor } from "../layout/editor.js";
import { pictureOf, postSample } from "../layout/picture.js";
import { get, post, request } from "../service.js";
import { carriedOver } from "./proposals.js";
import { acting, table } from "./tables.js";

/** The list of unknown pages, and an editor that opens below it. */
export class UnknownPages {
  constructor(onChange) {
    this.onChange = onChange;
    this.list = make("div", {});
    this.editor = new PageEditor({ submit: (name, zones) => this.submit(name, zones) });
    this.editor.element.hidden = true;
    this.element = make("div", {}, this.list, this.editor.element);
  }

  async refresh() {
    const { pages } = await get("layout/unknown-pages");
    const rows = pages.map(({ id, zones, created }) => [
      when(created),
      String(zones),
      make("span", { class: "row" }, button("Give it labels", acting(this.list, () => this.open(id))), button("Discard", acting(this.list, () => this.discard(id)))),
    ]);
    this.list.replaceChildren(rows.length ? table(`Unknown documents (${rows.length})`, ["Time", "Zones", "Actions"], rows) : make("p", { class: "empty" }, "No unknown documents."));
  }

  async discard(id) {
    await request("DELETE", `layout/unknown-pages/${id}`);
    await this.refresh();
  }

  async open(id, group = null) {
    this.page = await get(`layout/unknown-pages/${id}`);
    this.group = group;
    const zones = this.page.zones.map((zone, order) => ({ ...zone, id: String(zone.id), label: zone.label ?? null, confidence: 1, order }));
    const result = { ...this.page, zones, class: null, classes: [], unknown_probability: 1 };
    this.editor.element.hidden = false;
    await this.editor.open(result, await pictureOf(this.page.result));
    this.editor.element.scrollIntoView({ block: "start" });
    this.editor.viewer.focus(zones[0]?.id);
  }

  /** The page, and those of its group, become samples of the class; its model is made from them. */
  async submit(name, zones) {
    const pages = await carriedOver(this.page, zones, this.group);
    for (const page of pages) await postSample(name, page, page.result);
    const made = await post(`layout/models/${encodeURIComponent(name)}/initialize`);
    for (const { id } of pages) await request("DELETE", `layout/unknown-pages/${id}`);
    notify(`${name} has ${made.samples} samples.`);
    await this.refresh();
    await this.onChange();
    return make("p", {}, `${pages.length} samples were added to ${name}, which is version ${made.version} now.`);
  }
}
