// Requests to the service. Each one is documented at /docs and can be sent by a script as well.

const ROOT = new URL("../", import.meta.url); // the prefix of the service, where it has one
const KEY = "api-key";
const TOKEN_SPARE_MS = 30000; // a token is replaced this long before it expires
const POLL_MS = 1000;

/**
 * A refusal: `code`, `detail`, `field` and `request_id` of the problem document (RFC 9457), and `retryAfter` in seconds
 * where the service says when to come again.
 */
export class Problem extends Error {
  constructor(document) {
    super(document.detail ?? document.title ?? "The request failed.");
    Object.assign(this, { detail: this.message, code: "internal" }, document);
  }
}

export const apiKey = () => sessionStorage.getItem(KEY) ?? "";

export function setApiKey(key) {
  if (key) sessionStorage.setItem(KEY, key);
  else sessionStorage.removeItem(KEY);
  token = null;
}

/** Address of a path: of our own ("layout/models"), or one that the service has sent ("/jobs/5f"). */
export function address(path) {
  return path.startsWith("/") ? new URL(path, ROOT.origin) : new URL(path, ROOT);
}

/** The response to a request. Throws a `Problem` when the service refuses it or cannot be reached. */
export async function request(method, path, { body, headers = {}, signal } = {}) {
  const sent = new Headers(headers);
  const key = apiKey();
  if (key) sent.set("X-API-Key", String.fromCharCode(...new TextEncoder().encode(key))); // headers are bytes
  let payload = body;
  if (body !== undefined && !(body instanceof FormData) && typeof body !== "string" && !(body instanceof Blob)) {
    payload = JSON.stringify(body);
    sent.set("Content-Type", "application/json");
  }
  let response;
  try {
    response = await fetch(address(path), { method, body: payload, headers: sent, signal, cache: "no-cache" });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Problem({ code: "unreachable", detail: "The service cannot be reached. Check the network and try again." });
  }
  if (response.ok) return response;
  const retryAfter = Number(response.headers.get("Retry-After")) || undefined;
  const problem = new Problem({ ...(await problemOf(response)), retryAfter });
  if (response.status === 401 || (response.status === 403 && /API key/.test(problem.detail))) {
    document.dispatchEvent(new CustomEvent("key-needed"));
  }
  throw problem;
}

async function problemOf(response) {
  try {
    return await response.json();
  } catch {
    return { code: "internal", detail: `The service answered ${response.status}. Try again.` };
  }
}

export const get = async (path) => (await request("GET", path)).json();
export const post = async (path, body, headers, signal) => (await request("POST", path, { body, headers, signal })).json();

let token = null;
/** Address for what cannot send headers (images, events): with a short-lived token where a key is in use. */
export async function link(path) {
  const target = address(path);
  if (!apiKey()) return target;
  if (!token || Date.parse(token.expires) - Date.now() < TOKEN_SPARE_MS) token = await post("tokens");
  target.searchParams.set("token", token.token);
  return target;
}

/** Long work, sent with `Prefer: respond-async`: its `job`, or its `response` where it is done already. */
export async function begin(path, form, signal) {
  const response = await request("POST", path, { body: form, headers: { Prefer: "respond-async" }, signal });
  return response.status === 202 ? { job: await response.json() } : { response };
}

/**
 * The response to the work of a job; its progress arrives as server-sent events. `onProgress` gets the status of the job.
 * An abort of `signal` cancels the job.
 */
export async function outcome(job, onProgress, signal) {
  const cancel = () => request("DELETE", `jobs/${job.id}`).catch(() => {});
  signal?.addEventListener("abort", cancel, { once: true });
  try {
    onProgress?.(job);
    await ended(job, onProgress, signal);
    return await request("GET", job.links.result, { signal });
  } finally {
    signal?.removeEventListener("abort", cancel);
  }
}

/** The response to long work, from its beginning to its end. */
export async function work(path, form, onProgress, signal) {
  const { job, response } = await begin(path, form, signal);
  return response ?? outcome(job, onProgress, signal);
}

async function ended(job, onProgress, signal) {
  const events = new EventSource(await link(job.links.events));
  const isOver = await new Promise((resolve, reject) => {
    signal?.addEventListener("abort", () => reject(new DOMException("cancelled", "AbortError")), { once: true });
    events.onerror = () => resolve(false);
    events.onmessage = (event) => {
      const status = JSON.parse(event.data);
      onProgress?.(status);
      if (status.ended) resolve(true);
    };
  }).finally(() => events.close());
  for (let is = isOver; !is; ) {
    // a proxy cut the events: ask instead
    await new Promise((resolve) => setTimeout(resolve, POLL_MS));
    const status = await (await request("GET", `jobs/${job.id}`, { signal })).json();
    onProgress?.(status);
    is = Boolean(status.ended);
  }
}

let described = null;
/** The OpenAPI document: what this service can do. */
async function description() {
  described ??= get("openapi.json").catch((error) => {
    described = null;
    throw error;
  });
  return described;
}

/** Operations of a path, by method; undefined where the service has no such path. */
async function operationsOf(path) {
  const { paths } = await description();
  return Object.entries(paths).find(([name]) => name.endsWith(path) && !name.slice(0, -path.length).includes("{"))?.[1];
}

/** Whether the service takes the key in use: a `Problem` where it refuses it, null where all is well. */
export async function refusalOfKey() {
  try {
    await get("cameras");
    return null;
  } catch (problem) {
    return problem.code === "unauthorized" || problem.code === "forbidden" ? problem : null;
  }
}

export const offers = async (path) => Boolean(await operationsOf(path));

/** Fields of an operation's form, by name. */
export async function formFields(path) {
  const { components } = await description();
  const resolve = (schema) => (schema.$ref ? components.schemas[schema.$ref.split("/").pop()] : schema);
  const { post: operation } = await operationsOf(path);
  return resolve(operation.requestBody.content["multipart/form-data"].schema).properties;
}

/** Address of the next part of a list, from the header `Link` (RFC 8288); null after the last one. */
export function nextOf(response) {
  const next = (response.headers.get("Link") ?? "").split(",").find((part) => /;\s*rel="?next"?/.test(part));
  return next ? next.match(/<([^>]*)>/)[1] : null;
}
