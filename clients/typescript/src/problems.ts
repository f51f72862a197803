/** What goes wrong. */

import type { Problem } from "./models.js";

/**
 * The service refused a request, or could not be asked; the message is what happened and what to do.
 *
 * `code` is the service's stable name of the problem, `field` the option or part that it is about. Names of this
 * client's own are `unreachable` (`status` is 0: there is no answer) and `unexpected-answer`: what came is not of the
 * service. `retryAfterS` are the seconds after which the service asks to come again.
 */
export class ProblemError extends Error {
  override readonly name = "ProblemError";

  constructor(
    readonly detail: string,
    readonly code: string,
    readonly status = 0,
    readonly field?: string,
    readonly requestId?: string,
    readonly retryAfterS?: number,
  ) {
    super(detail);
  }
}

/** The problem that an answer tells. */
export async function problemOf(response: Response): Promise<ProblemError> {
  const { status } = response;
  const wait = retryAfter(response);
  if (response.headers.get("Content-Type")?.startsWith("application/problem+json")) {
    try {
      const told = (await response.json()) as Problem;
      return new ProblemError(told.detail, told.code, status, told.field ?? undefined, told.request_id, wait);
    } catch {
      // Cut off on its way.
    }
  }
  const detail = `The answer is ${status} ${response.statusText}, without a reason.`;
  return new ProblemError(detail, "unexpected-answer", status, undefined, undefined, wait);
}

/** Seconds that the answer asks to wait: its header `Retry-After`, a number or a date. */
export function retryAfter(response: Response): number | undefined {
  const text = response.headers.get("Retry-After");
  if (text === null) return undefined;
  const seconds = /^\d+$/.test(text) ? Number(text) : (Date.parse(text) - Date.now()) / 1000;
  return Number.isNaN(seconds) ? undefined : Math.max(0, seconds);
}
