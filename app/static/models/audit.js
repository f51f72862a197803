// Who did what to a model.

import { make, when } from "../elements.js";
import { get, offers } from "../service.js";
import { table } from "./tables.js";

/** The heading and the table; empty where the service keeps no such list or the key may not read it. */
export async function auditTable(name) {
  if (!(await offers("/audit"))) return [];
  try {
    const { entries } = await get(`audit?model=${encodeURIComponent(name)}&limit=50`);
    const rows = entries.map(({ time, who, action, detail }) => [when(time), who ?? "without a key", action, detail]);
    const list = rows.length ? table("Who did what", ["Time", "Who", "What", "Detail"], rows) : make("p", { class: "empty" }, "Nothing yet.");
    return [make("h3", {}, "Who did what"), list];
  } catch {
    return [];
  }
}
