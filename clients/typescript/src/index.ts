/** Client of the document rectification service, for browsers and node. It needs nothing but `fetch`. */

import * as calls from "./calls.js";
import type { Call, Given, MadeFile, Photo, Read, Upload } from "./calls.js";
import type {
  DocumentResult,
  JobStatus,
  LayoutOptions,
  LayoutResult,
  MosaicOptions,
  PlainMosaicResult,
  PlainPagesResult,
  RectifyOptions,
  StackResult,
  UploadState,
} from "./models.js";
import { ProblemError, problemOf, retryAfter } from "./problems.js";

export type * from "./models.js";
export type { Call, Given, MadeFile, Photo, Read, Upload } from "./calls.js";
export { calls, ProblemError };

/** Called with the state of a job until it ends. */
export type Progress = (status: JobStatus) => void;

/** Work that the service goes on with; its id and its call's `read` are all that is needed to fetch the answer. */
export interface Job<Answer> {
  id: string;
  read: Read<Answer>;
}

export interface Settings {
  /** An API key, if the service wants one. */
  key?: string;
  /** How often a request is sent at most, where the service is busy or is not reached; 5. */
  tries?: number;
  /**
   * Photos of a call that have more bytes than this together are sent in pieces before (`upload`), so that a broken
   * connection costs no more than what it was just sending; 8 MiB. Infinity: only what is asked for.
   */
  piecesAbove?: number;
  /** In place of the global `fetch`. */
  fetch?: typeof fetch;
}

/** The service is busy or starts, or a proxy does not reach it. */
const RETRIED = new Set([429, 502, 503]);
/** Before the second try where the service names no time; it doubles with each try. */
const FIRST_WAIT_S = 0.5;
/** A longer wait is the caller's to decide: the problem says for how long. */
const LONGEST_WAIT_S = 120;
/** Two photos of a phone; at 1 MB/s more than that takes long enough to break off. */
const PIECES_ABOVE = 8 << 20;
/** Proxies that keep a body until it is whole lose no more. */
const PIECE_BYTES = 4 << 20;
/** A piece came too slowly, or what came before was kept after all: the service says where to go on. */
const RESUMED = new Set([...RETRIED, 0, 408, 409]);
const TUS = { "Tus-Resumable": "1.0.0" };

/**
 * Sends photos to the service at `url`; all methods reject with `ProblemError`. With `progress` the work is a job, and
 * the function is called with its state until it ends. A `signal` that is aborted ends requests and waits: the method
 * rejects with the reason of the signal, and the job that it waits for is cancelled.
 */
export class Client {
  private readonly url: string;
  private readonly headers: Record<string, string>;
  private readonly tries: number;
  private readonly piecesAbove: number;
  private readonly fetch: typeof fetch;

  constructor(url = "http://127.0.0.1:8000", settings: Settings = {}) {
    this.url = url.replace(/\/+$/, "");
    this.headers = settings.key === undefined ? {} : { "X-API-Key": settings.key };
    this.tries = settings.tries ?? 5;
    this.piecesAbove = settings.piecesAbove ?? PIECES_ABOVE;
    this.fetch = settings.fetch ?? ((input, init) => fetch(input, init));
  }

  /** Photos of pages as one file of flat pages: PDF, image, text or archive, by the option `format`. */
  flatten(photos: Photo[], options?: Given<RectifyOptions>, progress?: Progress, signal?: AbortSignal): Promise<MadeFile> {
    return this.answer(calls.flatten(photos, options), progress, signal);
  }

  /** What is known of the flat pages of the photos. */
  flattenPages(photos: Photo[], options?: Given<Omit<RectifyOptions, "format">>, progress?: Progress, signal?: AbortSignal): Promise<PlainPagesResult> {
    return this.answer(calls.flattenPages(photos, options), progress, signal);
  }

  /** Overlapping photos of one page as one file of the whole page. */
  mosaic(photos: Photo[], options?: Given<MosaicOptions>, progress?: Progress, signal?: AbortSignal): Promise<MadeFile> {
    return this.answer(calls.mosaic(photos, options), progress, signal);
  }

  /** What is known of the whole page that overlapping photos show. */
  mosaicPage(photos: Photo[], options?: Given<Omit<MosaicOptions, "format">>, progress?: Progress, signal?: AbortSignal): Promise<PlainMosaicResult> {
    return this.answer(calls.mosaicPage(photos, options), progress, signal);
  }

  /** Class and labels of a page; of several images, of the document and of its pages. */
  layout(images: Photo[], options?: Given<Omit<LayoutOptions, "format">>, progress?: Progress, signal?: AbortSignal): Promise<LayoutResult | DocumentResult | StackResult> {
    return this.answer(calls.layout(images, options), progress, signal);
  }

  /**
   * A photo that the service keeps for some time, sent in pieces: where the connection breaks, it goes on. The upload
   * stands for the photo in all methods, in any number of calls.
   */
  async upload(photo: Blob, name = calls.nameOf(photo), signal?: AbortSignal): Promise<Upload> {
    const metadata = `filename ${btoa(String.fromCharCode(...new TextEncoder().encode(name)))}`;
    const headers = { ...TUS, "Upload-Length": String(photo.size), "Upload-Metadata": metadata };
    const begun = await this.send("POST", "/uploads", { headers, signal });
    const upload = { id: (await read(readUpload, begun, signal)).id };
    let failures = 0;
    for (let offset = 0; offset < photo.size; ) {
      const body = photo.slice(offset, offset + PIECE_BYTES);
      const place = { ...TUS, "Upload-Offset": String(offset), "Content-Type": "application/offset+octet-stream" };
      try {
        await this.send("PATCH", uploadPath(upload), { headers: place, body, signal, tries: 1 });
        offset += body.size;
        failures = 0;
        continue;
      } catch (error) {
        if (!(error instanceof ProblemError) || !RESUMED.has(error.status)) throw error;
        failures += 1;
        const wait = error.retryAfterS ?? FIRST_WAIT_S * 2 ** (failures - 1);
        if (failures >= this.tries || wait > LONGEST_WAIT_S) throw error;
        await pause(wait, signal);
      }
      const told = await this.send("HEAD", uploadPath(upload), { headers: TUS, signal });
      const kept = Number(told.headers.get("Upload-Offset"));
      if (kept > offset) failures = 0;
      offset = kept;
    }
    return upload;
  }

  /** Delete an upload before its time. */
  async forget(upload: Upload): Promise<void> {
    await this.send("DELETE", uploadPath(upload), { headers: TUS, tries: 1 });
  }

  /** The answer to a call. */
  answer<Answer>(call: Call<Answer>, progress?: Progress, signal?: AbortSignal): Promise<Answer> {
    return this.sentBefore(call, signal, (sent) => this.answerSent(sent, progress, signal));
  }

  private async answerSent<Answer>(call: Call<Answer>, progress?: Progress, signal?: AbortSignal): Promise<Answer> {
    if (progress === undefined) {
      return read(call.read, await this.send("POST", call.path, { body: call.form, signal }), signal);
    }
    const job = await this.startSent(call, randomKey(), signal);
    try {
      return await this.result(job, progress, signal);
    } catch (error) {
      if (signal?.aborted) this.cancel(job).catch(() => undefined);
      throw error;
    }
  }

  /** The job of a call; the same call with the same `key` finds the same job. */
  start<Answer>(call: Call<Answer>, key = randomKey(), signal?: AbortSignal): Promise<Job<Answer>> {
    return this.sentBefore(call, signal, (sent) => this.startSent(sent, key, signal));
  }

  private async startSent<Answer>(call: Call<Answer>, key: string, signal?: AbortSignal): Promise<Job<Answer>> {
    const headers = { Prefer: "respond-async", "Idempotency-Key": key };
    const response = await this.send("POST", call.path, { headers, body: call.form, signal });
    return { id: (await read(readStatus, response, signal)).id, read: call.read };
  }

  /** The state of a job. */
  async look<Answer>(job: Job<Answer>, signal?: AbortSignal): Promise<JobStatus> {
    return read(readStatus, await this.send("GET", pathOf(job), { signal }), signal);
  }

  /** The answer of a job, when it has ended. It is asked about as often as the service advises. */
  async result<Answer>(job: Job<Answer>, progress?: Progress, signal?: AbortSignal): Promise<Answer> {
    for (;;) {
      const status = await this.look(job, signal);
      progress?.(status);
      if (status.ended !== null) break;
      await pause(status.poll_after_s ?? 1, signal);
    }
    return read(job.read, await this.send("GET", `${pathOf(job)}/result`, { signal }), signal);
  }

  /** Stop the work of a job. */
  async cancel<Answer>(job: Job<Answer>): Promise<void> {
    await this.send("DELETE", pathOf(job));
  }

  /** What `then` makes of the call. Large files are sent in pieces before, and deleted after. */
  private async sentBefore<Answer, Result>(
    call: Call<Answer>,
    signal: AbortSignal | undefined,
    then: (sent: Call<Answer>) => Promise<Result>,
  ): Promise<Result> {
    const parts = [...call.form.entries()];
    const size = parts.reduce((sum, [, part]) => sum + (typeof part === "string" ? 0 : part.size), 0);
    if (size <= this.piecesAbove) return then(call);
    const uploads: Upload[] = [];
    try {
      const form = new FormData();
      for (const [name, part] of parts) {
        if (typeof part === "string") {
          form.append(name, part);
          continue;
        }
        const upload = await this.upload(part, part.name, signal);
        uploads.push(upload);
        form.append(calls.UPLOAD, upload.id);
      }
      return await then({ ...call, form });
    } catch (error) {
      // A service that knows no uploads yet.
      if (error instanceof ProblemError && [404, 405].includes(error.status) && uploads.length === 0) return then(call);
      throw error;
    } finally {
      // Nobody waits for it; what cannot be deleted now ends by itself.
      for (const upload of uploads) this.forget(upload).catch(() => undefined);
    }
  }

  /** The answer to a request; it is sent again where that may help, when the service asks for it. */
  private async send(method: string, path: string, sent: Sent = {}): Promise<Response> {
    const { body, signal, tries = this.tries } = sent;
    const init: RequestInit = { method, headers: { ...this.headers, ...sent.headers } };
    if (body !== undefined) init.body = body;
    if (signal !== undefined) init.signal = signal;
    for (let attempt = 1; ; attempt += 1) {
      let wait = FIRST_WAIT_S * 2 ** (attempt - 1);
      let failure: ProblemError;
      try {
        const response = await this.fetch(this.url + path, init);
        if (response.ok) return response;
        failure = await problemOf(response);
        if (!RETRIED.has(response.status)) throw failure;
        wait = retryAfter(response) ?? wait;
      } catch (error) {
        signal?.throwIfAborted();
        if (error instanceof ProblemError) throw error;
        failure = new ProblemError(`The service cannot be reached: ${String(error)}.`, "unreachable");
      }
      if (attempt >= tries || wait > LONGEST_WAIT_S) throw failure;
      await pause(wait, signal);
    }
  }
}

/** What a request has beside its method and path. */
interface Sent {
  headers?: Record<string, string>;
  body?: FormData | Blob;
  signal?: AbortSignal | undefined;
  /** In place of those of the client. */
  tries?: number;
}

async function readUpload(response: Response): Promise<UploadState> {
  return (await response.json()) as UploadState;
}

function uploadPath(upload: Upload): string {
  return `/uploads/${encodeURIComponent(upload.id)}`;
}

async function readStatus(response: Response): Promise<JobStatus> {
  return (await response.json()) as JobStatus;
}

async function read<Answer>(reader: Read<Answer>, response: Response, signal?: AbortSignal): Promise<Answer> {
  try {
    return await reader(response);
  } catch (error) {
    signal?.throwIfAborted();
    throw new ProblemError(`The answer cannot be read: ${String(error)}.`, "unexpected-answer", response.status);
  }
}

function pathOf<Answer>(job: Job<Answer>): string {
  return `/jobs/${encodeURIComponent(job.id)}`;
}

/** Waits; rejects with the reason of a signal that is aborted. */
function pause(seconds: number, signal?: AbortSignal): Promise<void> {
  return new Promise((resolve, reject) => {
    signal?.throwIfAborted();
    const end = (): void => {
      clearTimeout(timer);
      reject(signal?.reason);
    };
    const timer = setTimeout(() => {
      signal?.removeEventListener("abort", end);
      resolve();
    }, seconds * 1000);
    signal?.addEventListener("abort", end, { once: true });
  });
}

/** Random, not secret. `crypto` is missing in node 18 and on pages without TLS. */
function randomKey(): string {
  return Array.from({ length: 3 }, () => Math.random().toString(36).slice(2)).join("");
}
