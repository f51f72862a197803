// View "Models": the classes, what they learned, and what the service proposes.

import { button, confirmed, labelled, make, notify, percent, problemNote, save, when } from "../elements.js";
import { get, post, request } from "../service.js";
import { auditTable } from "./audit.js";
import { healthPlot } from "./health_plot.js";
import { proposalList } from "./proposals.js";
import { acting, sampleTable, table, versionTable } from "./tables.js";
import { UnknownPages } from "./unknown.js";

const path = (name) => `layout/models/${encodeURIComponent(name)}`;
const rate = (share) => (share === null ? "" : percent(share));

export function createView() {
  const list = make("div", {});
  const detail = make("div", {});
  const found = make("div", {});
  const importer = make("input", { type: "file", accept: "application/json,.json", onchange: () => importModel() });
  const unknown = new UnknownPages(() => refresh());
  const look = button("Look for proposals", async () => {
    found.replaceChildren(make("p", {}, "Comparing…"));
    try {
      found.replaceChildren(await proposalList((id, group) => unknown.open(id, group), refreshAll));
    } catch (error) {
      found.replaceChildren(problemNote(error));
    }
  });
  const element = make(
    "div",
    { class: "view" },
    make("h1", {}, "Models"),
    make("section", { class: "panel" }, list, labelled("Import a model", importer, "A file that Export has saved.")),
    detail,
    make("section", { class: "panel" }, make("h2", {}, "Proposals"), look, found),
    make("section", { class: "panel" }, make("h2", {}, "Unknown documents"), unknown.element),
  );

  async function refresh() {
    const { models } = await get("layout/models");
    const rows = models.map((model) => [
      make("a", { href: `#models/${encodeURIComponent(model.name)}` }, model.name),
      model.version === null ? "none yet" : String(model.version),
      String(model.samples),
      rate(model.health.recent_zone_error),
      rate(model.health.recent_class_error),
      when(model.updated),
    ]);
    const heads = ["Name", "Version", "Samples", "Wrong labels", "Wrong class", "Changed"];
    list.replaceChildren(rows.length ? table("Models", heads, rows) : make("p", { class: "empty" }, "No model yet. Give a document labels in the view Layout, or import a model."));
  }

  async function refreshAll() {
    await Promise.all([refresh(), unknown.refresh()]);
  }

  async function importModel() {
    const [file] = importer.files;
    if (!file) return;
    try {
      const text = await file.text();
      const name = JSON.parse(text).name ?? file.name.replace(/(-model)?\.json$/, "");
      const imported = await (await request("PUT", path(name), { body: text, headers: { "Content-Type": "application/json" } })).json();
      notify(`${imported.name} is version ${imported.version}.`);
      await refresh();
    } catch (error) {
      const problem = error instanceof SyntaxError ? { detail: "The file is no JSON. Choose a file that Export has saved." } : error;
      detail.replaceChildren(problemNote(problem));
    }
    importer.value = "";
  }

  async function showModel(name) {
    const again = () => Promise.all([showModel(name), refresh()]);
    const place = make("div", {});
    const { feedback } = await get(`${path(name)}/feedback?limit=200`);
    const exportModel = async () => save(await (await request("GET", path(name))).blob(), `${name}-model.json`);
    const initialize = async () => {
      const made = await post(`${path(name)}/initialize`);
      notify(`Version ${made.version} is made from ${made.samples} samples.`);
      await again();
    };
    const train = async () => {
      await post(`${path(name)}/train`, { rounds: 3 });
      notify("The model is trained.");
      await again();
    };
    const remove = async () => {
      if (!(await confirmed(`Delete ${name}`, "The model and all its samples are deleted.", "Delete"))) return;
      await request("DELETE", path(name));
      location.hash = "models";
      await refresh();
    };
    const actions = [["Export", exportModel], ["Make it anew from its samples", initialize], ["Train with all samples", train], [`Delete ${name}`, remove]];
    const audit = await auditTable(name);
    place.append(
      make("h2", {}, name),
      make("p", { class: "row" }, actions.map(([text, act]) => button(text, acting(place, act)))),
      make("h3", {}, "Health"),
      healthPlot(name, feedback),
      make("h3", {}, "Versions"),
      await versionTable(name, again).catch(problemNote),
      make("h3", {}, "Samples"),
      await sampleTable(name, again),
      ...audit,
    );
    place.className = "panel";
    detail.replaceChildren(place);
  }

  async function open([name]) {
    if (name) await showModel(name);
    else detail.replaceChildren();
    await refreshAll();
  }

  return { element, open };
}
