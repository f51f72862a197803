// Proposals of the service: new classes, merges, splits. Each is carried out by requests of its own after one confirmation.

import { button, confirmed, labelled, make, notify, percent } from "../elements.js";
import { get, post, request, work } from "../service.js";
import { acting } from "./tables.js";

const model = (name) => `layout/models/${encodeURIComponent(name)}`;

/** Looks for proposals and shows them. `label(page, group)` begins to label an unknown page; `onChange` after a change. */
export async function proposalList(label, onChange, onProgress) {
  const proposals = await (await work("layout/proposals", undefined, onProgress)).json();
  const place = make("div", {});
  const { new_classes: classes, merges, splits, looked_at: seen } = proposals;
  const items = [
    ...classes.map((group) => newClass(group, label)),
    ...merges.map((merge) => mergeItem(merge, place, onChange)),
    ...splits.map((split) => splitItem(split, place, onChange)),
  ];
  const looked = `Looked at ${seen.unknown_pages} unknown pages, ${seen.models} models and ${seen.samples} samples.`;
  place.append(make("p", {}, looked), items.length ? make("ul", { class: "plain", "aria-label": "Proposals" }, items) : make("p", { class: "empty" }, "Nothing to propose."));
  notify(`${items.length} proposals.`);
  return place;
}

function newClass(group, label) {
  const text = `${group.pages.length} unknown pages are alike (${percent(group.cohesion)}). Label the typical one; its labels are carried over to the others.`;
  return make("li", { class: "card" }, make("strong", {}, "A new kind of document. "), text, make("p", {}, button("Begin with the typical one", () => label(group.typical, group))));
}

function mergeItem(merge, place, onChange) {
  const [kept, gone] = merge.models;
  const text = `${kept} and ${gone} look like one class: they agree on ${percent(merge.agreement)} of the zones.`;
  const carryOut = async () => {
    if (!(await confirmed("Merge", `All samples of ${gone} go to ${kept}, which is made anew; ${gone} is deleted.`, "Merge"))) return;
    // `labels` maps labels of the first model to those of the second, and the samples go the other way
    const names = new Map(Object.entries(merge.labels).map(([first, second]) => [second, first]));
    const { samples } = await get(`${model(gone)}/samples`);
    for (const { id } of samples) {
      const { width, height, zones } = await get(`${model(gone)}/samples/${id}`);
      const renamed = zones.map((zone) => ({ ...zone, label: names.get(zone.label) ?? zone.label }));
      await post(`${model(kept)}/samples`, { width, height, zones: renamed });
    }
    await post(`${model(kept)}/initialize`);
    await request("DELETE", model(gone));
    notify(`${gone} is part of ${kept} now.`);
    await onChange();
  };
  return make("li", { class: "card" }, make("strong", {}, "A merge. "), text, make("p", {}, button(`Merge ${gone} into ${kept}`, acting(place, carryOut))));
}

function splitItem(split, place, onChange) {
  const name = make("input", { type: "text", maxlength: 60 });
  const [large, small] = split.parts;
  const text = `The samples of ${split.model} form two groups, of ${large.samples.length} and ${small.samples.length}; two models explain them better by ${percent(split.gain)}.`;
  const carryOut = async () => {
    const other = name.value.trim();
    if (!other) return name.focus();
    const what = `${small.samples.length} samples go from ${split.model} to ${other}, and both models are made anew.`;
    if (!(await confirmed("Split", what, "Split"))) return;
    for (const id of small.samples) {
      const { width, height, zones } = await get(`${model(split.model)}/samples/${id}`);
      await post(`${model(other)}/samples`, { width, height, zones });
    }
    for (const id of small.samples) await request("DELETE", `${model(split.model)}/samples/${id}`);
    for (const one of [split.model, other]) await post(`${model(one)}/initialize`);
    notify(`${split.model} is split.`);
    await onChange();
  };
  return make("li", { class: "card" }, make("strong", {}, "A split. "), text, make("div", { class: "row" }, labelled("Name of the smaller group", name), button(`Split ${split.model}`, acting(place, carryOut))));
}

/** Gives every page of a group the labels of one of them; the labelled pages, the given one first. */
export async function carriedOver(page, zones, group) {
  const labelled = [{ id: page.id, result: page.result, width: page.width, height: page.height, zones }];
  const labels = new Map(zones.map((zone) => [zone.id, zone.label]));
  for (const id of group?.pages ?? []) {
    if (id === page.id) continue;
    const other = await get(`layout/unknown-pages/${id}`);
    const same = new Map(group.recurring_zones.filter((one) => one[id] && one[page.id]).map((one) => [one[id], labels.get(one[page.id]) ?? null]));
    const theirs = other.zones.map((zone) => ({ ...zone, label: same.get(String(zone.id)) ?? null }));
    if (theirs.some(({ label }) => label !== null)) labelled.push({ id, result: other.result, width: other.width, height: other.height, zones: theirs });
  }
  return labelled;
}
