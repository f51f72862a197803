// What a feedback changed, in words.

import { make } from "../elements.js";
import { get } from "../service.js";

const MOST_CHANGES = 5;
const quoted = (label) => (label === null ? "zones without a label" : `"${label}"`);
const short = (value) => (value === null ? "nothing" : String(+value.toPrecision(3)));

/** One change of a model as a sentence. */
export function changeInWords({ part, labels, attribute, old, new: now }) {
  const change = `from ${short(old)} to ${short(now)}`;
  const words = attribute.replaceAll(":", " ").replaceAll("-", " ").replaceAll("_", " ");
  if (part === "edge") return `${quoted(labels[0])} with ${quoted(labels[1])}: ${words} ${change}.`;
  if (part === "node") return `${quoted(labels[0])}: ${words} ${change}.`;
  return `The model: ${words} ${change}.`;
}

function costSentence({ cost_found: found, cost_verified: verified }) {
  if (!found?.before || !verified?.before) return "";
  const gap = (when) => verified[when] - found[when];
  if (found.after === null || verified.after === null) return "";
  const better = gap("before") - gap("after");
  if (Math.abs(better) < 0.005) return " The found labels were right already; the model now knows one page more.";
  return ` Compared with the found labels, your labels fit ${better > 0 ? "better" : "worse"} by ${Math.abs(better).toFixed(2)}.`;
}

/** A list that says what was wrong and what each model learned. */
export async function learnedNote(feedback) {
  const lines = [];
  if (feedback.class.found !== feedback.class.verified) {
    lines.push(`Class: ${feedback.class.found ?? "none"} was found, ${feedback.class.verified ?? "none"} is right.`);
  }
  const { wrong } = feedback;
  if (feedback.class.verified === null) lines.push("The page is of none of the classes, so nothing was learned from its labels. It is among the unknown documents (Models).");
  else lines.push(wrong.length ? `${wrong.length} of ${feedback.zones} labels were wrong.` : `All ${feedback.zones} labels were right.`);
  for (const { zone, found, verified } of wrong) lines.push(`Zone ${zone}: ${quoted(found)} is ${quoted(verified)}.`);
  if (feedback.class.verified !== null && feedback.sample === null) lines.push("The page was not added to the samples of the class: these are as many as it may have.");
  if (!feedback.models.length) lines.push("No model has changed.");
  const parts = [make("ul", {}, lines.map((line) => make("li", {}, line)))];
  for (const model of feedback.models) {
    const from = model.old_version === null ? "is new" : `was version ${model.old_version}`;
    parts.push(make("p", {}, make("strong", {}, model.name), ` is now version ${model.new_version} (${from}).${costSentence(model)}`));
    if (model.old_version !== null) parts.push(await changeList(model));
  }
  for (const { detail } of feedback.warnings ?? []) parts.push(make("p", { class: "warnings" }, detail));
  return make("div", { class: "learned" }, make("h2", {}, "What the models learned"), parts);
}

async function changeList({ name, new_version: version, old_version: against }) {
  const path = `layout/models/${encodeURIComponent(name)}/versions/${version}/diff?against=${against}&limit=${MOST_CHANGES}`;
  try {
    const { total, changes } = await get(path);
    const summary = make("summary", {}, `The largest of ${total} changes`);
    return make("details", {}, summary, make("ul", {}, changes.map((change) => make("li", {}, changeInWords(change)))));
  } catch {
    return ""; // the words above say the most important
  }
}
