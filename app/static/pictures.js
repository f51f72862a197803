// Pictures that the page shows: uploads as they are, and images that come in JSON.

import { address } from "./service.js";

const STARTS = { "/9j/": "image/jpeg", iVBOR: "image/png", UklGR: "image/webp" };

/** A Blob of an image in base64; null for a format that browsers do not show. */
export function imageOf(base64) {
  const type = Object.entries(STARTS).find(([start]) => base64.startsWith(start))?.[1];
  if (!type) return null;
  return new Blob([Uint8Array.from(atob(base64), (character) => character.charCodeAt(0))], { type });
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

/** Sets an image, and resolves when it is shown. */
export async function showImage(image, source) {
  if (image.src.startsWith("blob:")) URL.revokeObjectURL(image.src);
  image.src = source instanceof Blob ? URL.createObjectURL(source) : address(source);
  await image.decode().catch(() => {});
}

export const stemOf = (name) => name.replace(/\.[^.]*$/, "") || "page";
