// Photos of a joined page: each is sent once, and stays with the service as long as the page may get further ones.

import { get, Problem, request } from "../service.js";
import { filesKeyOf } from "./pages.js";
import { filesOf } from "./storage.js";

const TUS = { "Tus-Resumable": "1.0.0" }; // the protocol of /uploads
const OPTIONS = { pages: "kept_page", uploads: "upload" }; // of the form, by what the service has of a photo
const inBase64 = (text) => btoa(String.fromCharCode(...new TextEncoder().encode(text)));

/** Appends the photos of a joined page to a form, after those are sent that the service does not have. */
export async function appendParts(form, page, pages, signal) {
  const files = await filesOf(filesKeyOf(page));
  for (const [index, file] of page.names.map((_, number) => files[number]).entries()) {
    const sent = page.parts[index]?.startsWith("pages/") ? page.parts[index] : await sendPart(index, file, page, pages, signal);
    const [kind, id] = sent?.split("/") ?? [];
    if (sent) form.append(OPTIONS[kind], id);
    else form.append("images", file, file.name);
  }
}

/**
 * The path of a photo's upload, once all of it has come: what came before the network broke is not sent again. Null
 * where the service has no room for uploads.
 */
async function sendPart(index, file, page, pages, signal) {
  if (!file) throw new Problem({ code: "photo-gone" });
  try {
    const { id, offset } = (await begun(page.parts[index])) ?? (await begin(file));
    const path = `uploads/${id}`;
    await pages.update(page, { parts: page.parts.map((part, number) => (number === index ? path : part)) });
    const headers = { ...TUS, "Upload-Offset": String(offset), "Content-Type": "application/offset+octet-stream" };
    if (offset < file.size) await request("PATCH", path, { body: file.slice(offset), headers, signal });
    return path;
  } catch (error) {
    if (error.code === "busy") return null;
    throw error;
  }
}

/** How far an upload has come that was begun before; null where there is none, or no longer. */
async function begun(path) {
  try {
    return path ? await get(path) : null;
  } catch (error) {
    if (error.code === "not-found") return null;
    throw error;
  }
}

async function begin(file) {
  const headers = { ...TUS, "Upload-Length": String(file.size), "Upload-Metadata": `filename ${inBase64(file.name)}` };
  return (await request("POST", "uploads", { headers })).json();
}
