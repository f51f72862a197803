// The kept picture of a recognized page.

import { get, link } from "../service.js";

/** Address of a result's kept picture; null where none is kept. */
export async function keptPicture(result) {
  return result.image ? link(`layout/results/${result.id}/image`) : null;
}

/** The same for the id of a result, which may have expired. */
export async function pictureOf(id) {
  try {
    return await keptPicture(await get(`layout/results/${id}`));
  } catch {
    return null;
  }
}
