// The kept picture of a recognized page.

import { get, link, post, request } from "../service.js";

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

/** Adds a labelled page to the samples of a class, with the kept picture of its result if it shows every pixel. */
export async function postSample(name, { width, height, zones }, result) {
  const path = `layout/models/${encodeURIComponent(name)}/samples`;
  const picture = await wholePicture(result, width);
  if (!picture) return post(path, { width, height, zones });
  const form = new FormData();
  form.append("image", picture, "page.jpg");
  form.append("zones", JSON.stringify({ width, height, zones }));
  return (await request("POST", path, { body: form })).json();
}

async function wholePicture(result, width) {
  try {
    const { image } = await get(`layout/results/${result}`);
    if (image?.width !== width) return null;
    return await (await request("GET", `layout/results/${result}/image`)).blob();
  } catch {
    return null; // the result has expired
  }
}
