// Tables of the view "Models": versions with their differences, samples.

import { button, confirmed, draw, make, notify, problemNote, when } from "../elements.js";
import { changeInWords } from "../layout/learned.js";
import { get, post, request } from "../service.js";

const MOST_CHANGES = 20;
const path = (name) => `layout/models/${encodeURIComponent(name)}`;

export function table(caption, heads, rows) {
  const head = make("tr", {}, heads.map((text) => make("th", { scope: "col" }, text)));
  const body = rows.map((cells) => make("tr", {}, cells.map((cell) => make("td", {}, cell))));
  return make("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": caption }, make("table", {}, make("caption", { class: "quiet-caption" }, caption), make("thead", {}, head), make("tbody", {}, body)));
}

/** Runs what a button stands for; a problem is shown below `place`. */
export const acting = (place, act) => async () => {
  try {
    await act();
  } catch (error) {
    place.append(problemNote(error));
  }
};

/** Versions of a model, newest first. `onChange` is called after a rollback. */
export async function versionTable(name, onChange) {
  const { versions } = await get(`${path(name)}/versions`);
  const place = make("div", {});
  const detail = make("div", { class: "detail" });
  const difference = (version) => async () => {
    const { changes, total, against } = await get(`${path(name)}/versions/${version}/diff?limit=${MOST_CHANGES}`);
    const lines = changes.map((change) => make("li", {}, changeInWords(change)));
    detail.replaceChildren(make("h3", {}, `Version ${version} compared with ${against}: ${total} changes, the largest first`), make("ul", {}, lines));
    notify(`${total} changes.`);
  };
  const back = (version) => async () => {
    const text = `The content of version ${version} becomes the newest version. All versions and samples are kept.`;
    if (!(await confirmed(`Back to version ${version}`, text, "Go back"))) return;
    const restored = await post(`${path(name)}/rollback`, { version }, { "If-Match": `"${versions[0].version}"` });
    notify(`Version ${restored.version} equals version ${version}.`);
    await onChange();
  };
  const rows = versions.map(({ version, origin, note, created }, index) => [
    String(version),
    origin,
    note,
    when(created),
    make("span", { class: "row" }, version > 1 ? button(`Difference of ${version}`, acting(place, difference(version))) : "", index ? button(`Back to ${version}`, acting(place, back(version))) : ""),
  ]);
  place.append(table("Versions", ["Version", "Made by", "Note", "Time", "Actions"], rows), detail);
  return place;
}

/** The zones of a labelled page as a small drawing. */
export function zoneMap({ width, height, zones }) {
  const size = height / 60;
  const parts = zones.map(({ box: [x0, y0, x1, y1], label }) => [
    draw("rect", { x: x0, y: y0, width: x1 - x0, height: y1 - y0, class: label ? "labelled" : "" }),
    label ? draw("text", { x: x0 + size / 3, y: y0 + size, "font-size": size }, label) : null,
  ]);
  return draw("svg", { class: "zone-map", viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `${zones.length} zones` }, parts);
}

/** Samples of a model, newest first. */
export async function sampleTable(name, onChange) {
  const { samples } = await get(`${path(name)}/samples`);
  const place = make("div", {});
  const detail = make("div", { class: "detail" });
  const show = (id) => async () => detail.replaceChildren(make("h3", {}, `Sample ${id}`), zoneMap(await get(`${path(name)}/samples/${id}`)));
  const remove = (id) => async () => {
    const text = "The model changes when it is made again from its samples.";
    if (!(await confirmed("Delete the sample", text, "Delete"))) return;
    await request("DELETE", `${path(name)}/samples/${id}`);
    await onChange();
  };
  const rows = [...samples].reverse().map(({ id, zones, labels, created }) => [
    when(created),
    String(zones),
    Object.entries(labels).map(([label, count]) => `${label} ${count}`).join(", "),
    make("span", { class: "row" }, button("Show", acting(place, show(id))), button("Delete", acting(place, remove(id)))),
  ]);
  place.append(table(`Samples (${samples.length})`, ["Time", "Zones", "Labels", "Actions"], rows), detail);
  return place;
}
