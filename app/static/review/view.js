// View "Review": the pages that need a person, in the order in which a correction teaches most.

import { button, labelled, make, notify, percent, problemNote, select, when } from "../elements.js";
import { PageEditor } from "../layout/editor.js";
import { keptPicture } from "../layout/picture.js";
import { get, link, nextOf, post, request } from "../service.js";

const LISTED = 50;
const RENEW_MS = 120000; // a claim is renewed this often while its page is open
const STATES = [["open", "open"], ["skipped", "skipped"], ["corrected", "corrected"], ["confirmed", "confirmed"], ["all", "all"]];
const ORDERS = [["gain", "what teaches most"], ["confidence", "the least sure"], ["newest", "the newest"]];

export function createView() {
  const state = select(STATES, "open", () => list());
  const order = select(ORDERS, "gain", () => list());
  const rows = make("ul", { class: "queue", "aria-label": "Queue" });
  const more = button("More", () => append());
  const begin = button("Begin with the first", () => next(), "primary");
  const notes = make("div", {});
  const skip = button("Skip", () => skipPage());
  const leave = button("Back to the queue", () => close());
  const following = button("Next", () => next());
  const reasons = make("div", {});
  const editor = new PageEditor({ actions: [following, skip, leave], onConfirmed: () => endClaim() });
  const page = make("section", { "aria-label": "Open page", hidden: true }, reasons, editor.element);
  const queue = make("section", { class: "panel" }, make("div", { class: "row" }, labelled("State", state), labelled("Order", order), begin), rows, more);
  const element = make("div", { class: "view" }, make("h1", {}, "Review"), notes, queue, page);
  let nextPart = null; // address of the next part of the list
  let claim = null; // the page that is open, with its claim
  const seen = new Set(); // pages that this person has left

  async function list() {
    rows.replaceChildren();
    const of = state.value === "all" ? "" : `state=${state.value}&`;
    nextPart = `layout/results?${of}order=${order.value}&limit=${LISTED}`;
    if ((await append()) && !rows.children.length) rows.append(make("li", { class: "empty" }, "Nothing to do here."));
  }

  /** Adds the next part of the list; false if the service did not give it. */
  async function append() {
    try {
      const response = await request("GET", nextPart);
      const { results } = await response.json();
      nextPart = nextOf(response);
      more.hidden = !nextPart;
      rows.append(...results.map(entry));
      return true;
    } catch (error) {
      notes.replaceChildren(problemNote(error));
      return false;
    }
  }

  function entry(one) {
    const name = one.class ?? "no class";
    const { review } = one;
    if (!review) return make("li", { class: "queue-entry" }, `${name} ${one.state}, ${when(one.created)}`);
    const facts = `${review.zones} zones, least sure ${percent(review.confidence)}, about ${review.gain.toFixed(1)} wrong; ${when(one.created)}`;
    const taken = review.claimed_until ? `claimed${review.claimed_by ? ` by ${review.claimed_by}` : ""} until ${new Date(review.claimed_until).toLocaleTimeString()}` : "";
    const picture = make("img", { alt: "", loading: "lazy", width: 72 });
    if (review.has_image) link(`layout/results/${one.id}/image?width=144`).then((address) => (picture.src = address));
    return make(
      "li",
      { class: "queue-entry" },
      review.has_image ? picture : null,
      make("div", {}, make("strong", {}, name), ` ${one.state}, ${review.decision === "accept" ? "may go through" : "needs a person"}`, make("br", {}), make("small", {}, facts, taken ? make("span", { class: "bad" }, ` ${taken}`) : "")),
      button(`Open ${name}`, () => openPage(one.id)),
    );
  }

  /** Claims the first page that is free and not seen yet, and opens it. */
  async function next() {
    await letGo();
    let path = `layout/results?state=open&order=${order.value}&limit=${LISTED}`;
    while (path) {
      const response = await request("GET", path);
      const { results } = await response.json();
      for (const { id, review } of results) {
        if (review.claimed_until || seen.has(id)) continue;
        if (await openPage(id, false)) return;
      }
      path = nextOf(response);
    }
    await close();
    notify("No page is open.");
  }

  /** Opens a page with a claim on it; false if somebody else has it. `reopen`: also if it is skipped or verified. */
  async function openPage(id, reopen = true) {
    try {
      if (claim?.result !== id) {
        await letGo();
        claim = await post(`layout/results/${id}/claim`, { recognize: true, reopen });
      }
      const result = await get(`layout/results/${id}`);
      queue.hidden = true;
      page.hidden = false;
      notes.replaceChildren();
      reasons.replaceChildren(decisionNote(result.decision));
      await editor.open(result, await keptPicture(result));
      const unsure = [...result.zones].sort((a, b) => a.confidence - b.confidence)[0];
      if (unsure) editor.viewer.focus(unsure.id);
      return true;
    } catch (error) {
      if (error.code === "conflict") {
        notify("Another person has or had this page.");
        return false;
      }
      notes.replaceChildren(problemNote(error));
      return false;
    }
  }

  setInterval(async () => {
    if (claim && !page.hidden) await post(`layout/results/${claim.result}/claim`, { claim: claim.claim }).catch(() => {});
  }, RENEW_MS);

  /** Ends the claim on the open page; a page without feedback stays open for others. */
  async function letGo() {
    if (!claim) return;
    const { result, claim: secret } = endClaim();
    await request("POST", `layout/results/${result}/release`, { body: { claim: secret } }).catch(() => {});
  }

  /** Forgets the claim, which feedback ends too; what it was. */
  function endClaim() {
    const ended = claim;
    claim = null;
    if (ended) seen.add(ended.result);
    return ended;
  }

  async function skipPage() {
    if (!claim) return next(); // after feedback
    const { result, claim: secret } = endClaim();
    try {
      await request("POST", `layout/results/${result}/skip`, { body: { claim: secret } });
      notify("Skipped.");
      await next();
    } catch (error) {
      notes.replaceChildren(problemNote(error));
    }
  }

  async function close() {
    await letGo();
    page.hidden = true;
    queue.hidden = false;
    if (location.hash !== "#review") history.replaceState(null, "", "#review");
    await list();
  }

  async function open([id]) {
    if (id) await openPage(id);
    else if (page.hidden) await list();
  }

  return { element, open };
}

function decisionNote(decision) {
  if (!decision) return "";
  if (decision.action === "accept") return make("p", { class: "good" }, `May go through: at most ${percent(decision.tolerated_error)} of such labels are wrong.`);
  return make("ul", { class: "warnings", "aria-label": "Why a person should look" }, decision.reasons.map(({ detail }) => make("li", {}, detail)));
}
