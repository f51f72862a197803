// What the TypeScript client does with the service: node visit.mjs URL OUTPUT < {"flat", "noText", "wait", "zones"}
// Prints what it saw, as JSON.
import { readFileSync, writeFileSync } from "node:fs";
import { Client, ProblemError, calls } from "document-rectification-client";

const [url, output] = process.argv.slice(2);
const scripts = JSON.parse(readFileSync(0, "utf8"));
const photo = (script) => new Blob([Buffer.from(script, "latin1")]);
const flat = photo(scripts.flat);
const seen = { pauses: [], keys: [] };

// Pauses of the client, not those of node's own `fetch`, are told and cut short.
let whenPaused;
const { setTimeout: wait } = globalThis;
globalThis.setTimeout = (then, milliseconds, ...more) => {
  if (!new Error().stack.includes("dist/index.js")) return wait(then, milliseconds, ...more);
  seen.pauses.push(milliseconds / 1000);
  if (whenPaused === undefined) return wait(then, 20);
  queueMicrotask(whenPaused);
  return wait(() => undefined, 0);
};
const fates = [];
const methods = [];
const network = async (input, init) => {
  methods.push(init.method);
  if (init.headers["Idempotency-Key"]) seen.keys.push(init.headers["Idempotency-Key"]);
  const fate = fates.shift();
  if (fate instanceof Response) return fate;
  if (fate === "never") {
    return new Promise((_, reject) => init.signal.addEventListener("abort", () => reject(init.signal.reason)));
  }
  const response = await fetch(input, init);
  if (fate === "lost") throw new TypeError("cut off");
  return response;
};
const service = new Client(url, { fetch: network });
const problem = async (promise) => {
  try {
    await promise;
  } catch (error) {
    if (!(error instanceof ProblemError)) throw error;
    return { code: error.code, status: error.status, field: error.field ?? null, wait: error.retryAfterS ?? null };
  }
  return null;
};
const busy = (seconds) => new Response("", { status: 503, headers: { "Retry-After": seconds } });

const file = await service.flatten([flat, flat], { format: "pdf", text: true });
writeFileSync(output, Buffer.from(await file.content.arrayBuffer()));
seen.mediaType = file.mediaType;
seen.states = (await service.flattenPages([flat, photo(scripts.noText)])).pages.map((page) => page.state);
seen.width = (await service.mosaicPage([flat, flat])).width;
seen.zones = (await service.layout([], { zones: JSON.parse(scripts.zones) })).zones.length;
seen.refused = await problem(service.flatten([photo(scripts.noText)]));
seen.unpaused = seen.pauses.length;

fates.push(busy("7"), busy(""));
await service.flatten([flat]);
fates.push(busy("3600"));
seen.late = await problem(service.flatten([flat]));
seen.unreachable = await problem(new Client("http://127.0.0.1:1", { tries: 2 }).flatten([flat]));
seen.retries = seen.pauses.splice(0);

fates.push("lost");
const progress = [];
const made = await service.flatten([flat], {}, (status) => progress.push(status.state));
seen.job = [await made.content.text(), progress.at(-1), new Set(seen.keys).size, seen.keys.length];
const job = await service.start(calls.flatten([photo(scripts.wait)]));
await service.cancel(job);
seen.cancelled = await problem(service.result(job));

// What is given up ends at once: a request, a wait before the next try, a wait for a job, which is then cancelled.
const reasonOf = (promise) => promise.then(() => null, (error) => error.message);
const given = () => new AbortController();
const request = given();
fates.push("never");
const unanswered = service.flatten([flat], {}, undefined, request.signal);
request.abort(new Error("of a request"));
const retry = given();
fates.push(busy("100"));
const asked = service.flatten([flat], {}, undefined, retry.signal);
whenPaused = () => retry.abort(new Error("of a try"));
seen.aborted = [await reasonOf(unanswered), await reasonOf(asked)];
const work = given();
whenPaused = () => work.abort(new Error("of a job"));
let last;
const told = (status) => (last = status);
seen.aborted.push(await reasonOf(service.flatten([photo(scripts.wait)], {}, told, work.signal)));
whenPaused = undefined;
seen.givenUp = await problem(service.result({ id: last.id, read: async () => "" }));
seen.early = await reasonOf(service.flatten([flat], {}, undefined, AbortSignal.abort(new Error("before"))));

// Photos of more than ten bytes are sent in pieces, and go on after breaks; none is sent again that was kept.
const thrifty = new Client(url, { fetch: network, piecesAbove: 10 });
seen.pauses.splice(0);
methods.splice(0);
fates.push(undefined, "lost", undefined, undefined, busy("3"));
seen.pieces = [await (await thrifty.flatten([flat, flat])).content.text(), methods.slice(0, 7), seen.pauses.splice(0)];
const upload = await thrifty.upload(flat, "my photo.jpg");
seen.upload = await (await thrifty.mosaic([upload, flat], { format: "png" })).content.text();
await thrifty.forget(upload);
seen.forgotten = await problem(thrifty.flatten([upload]));
fates.push(new Response("", { status: 404 }));
seen.unknown = await (await thrifty.flatten([flat])).content.text();
console.log(JSON.stringify(seen));
