// Pictures that the page shows: uploads as they are, and images that come in JSON.

import { address } from "./service.js";

const STARTS = { "/9j/": "image/jpeg", iVBOR: "image/png", UklGR: "image/webp" };

/** A Blob of an image in base64; null for a format that browsers do not show. */
export function imageOf(base64) {
  const type = Object.entries(STARTS).find(([start]) => base64.startsWith(start))?.[1];
  if (!type) return null;
  const characters = atob(base64);
  const bytes = new Uint8Array(characters.length);
  for (let at = 0; at < bytes.length; at += 1) bytes[at] = characters.charCodeAt(at); // a call for each takes ten times as long
  return new Blob([bytes], { type });
}

/** Size of an image file, upright; null if this browser cannot show it (HEIC, TIFF, PDF). */
export async function sizeOf(file) {
  try {
    const bitmap = await createImageBitmap(file, { imageOrientation: "from-image" });
    const size = { width: bitmap.width, height: bitmap.height };
    bitmap.close();
    return size;
  } catch {
    return null;
  }
}

let reduced = Promise.resolve();

/**
 * A small picture of an image file, `height` pixels high, as a canvas; null if this browser cannot show it, or nobody
 * `wants` it any more. One file is decoded at a time: a photo of 12 megapixels takes 50 MB until it is small.
 */
export function thumbnailOf(file, height, wants) {
  const made = reduced.then(async () => {
    if (!wants()) return null;
    const bitmap = await createImageBitmap(file, { resizeHeight: height, resizeQuality: "medium" });
    const canvas = Object.assign(document.createElement("canvas"), { width: bitmap.width, height: bitmap.height });
    canvas.getContext("2d").drawImage(bitmap, 0, 0);
    bitmap.close();
    return canvas;
  });
  return (reduced = made.catch(() => null));
}

/** Sets an image, and resolves when it is shown. */
export async function showImage(image, source) {
  if (image.src.startsWith("blob:")) URL.revokeObjectURL(image.src);
  image.src = source instanceof Blob ? URL.createObjectURL(source) : address(source);
  await image.decode().catch(() => {});
}

export const stemOf = (name) => name.replace(/\.[^.]*$/, "") || "page";
