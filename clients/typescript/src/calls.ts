/** Operations of the service: what is sent, and how the answer is read. */

import type {
  DocumentResult,
  LayoutOptions,
  LayoutResult,
  MosaicOptions,
  PlainMosaicResult,
  PlainPagesResult,
  RectifyOptions,
  StackResult,
} from "./models.js";

/** A file that the service has already (`Client.upload`); it stands for a photo, in any number of calls. */
export interface Upload {
  id: string;
}

/** A photo; a `File` has a name, too. */
export type Photo = Blob | Upload;

/** Options of a form of the service; points are lists of numbers, and null leaves an option out. */
export type Given<Options> = { [Name in keyof Options]?: Options[Name] | null | undefined };

/** A file that the service made. */
export interface MadeFile {
  content: Blob;
  mediaType: string;
  /** Codes of the warnings of all pages. */
  warnings: string[];
  /** Pages that it leaves out, and why: `3 no-text`. */
  failed: string[];
}

/** How an answer is read. */
export type Read<Answer> = (response: Response) => Promise<Answer>;

/** One operation with its photos and options. */
export interface Call<Answer> {
  path: string;
  form: FormData;
  read: Read<Answer>;
}

/** Photos of pages as one file of flat pages. */
export function flatten(photos: Photo[], options: Given<RectifyOptions> = {}): Call<MadeFile> {
  return { path: "/rectify", form: form("image", photos, { format: "pdf", ...options }), read: readFile };
}

/** What is known of the flat pages of the photos. */
export function flattenPages(photos: Photo[], options: Given<Omit<RectifyOptions, "format">> = {}): Call<PlainPagesResult> {
  return { path: "/rectify/pages", form: form("image", photos, options), read: readJson };
}

/** Overlapping photos of one page as one file of the whole page. */
export function mosaic(photos: Photo[], options: Given<MosaicOptions> = {}): Call<MadeFile> {
  return { path: "/mosaic", form: form("images", photos, { format: "pdf", ...options }), read: readFile };
}

/** What is known of the whole page that overlapping photos show. */
export function mosaicPage(photos: Photo[], options: Given<Omit<MosaicOptions, "format">> = {}): Call<PlainMosaicResult> {
  return { path: "/mosaic/json", form: form("images", photos, options), read: readJson };
}

/** Class and labels of a page; of several images, of the document and of its pages. */
export function layout(images: Photo[], options: Given<Omit<LayoutOptions, "format">> = {}): Call<LayoutResult | DocumentResult | StackResult> {
  return { path: "/layout", form: form("image", images, { ...options, format: "json" }), read: readJson };
}

/** The part of a form that names an upload. */
export const UPLOAD = "upload";

/** The name of a file, or one for the photo of this index. */
export function nameOf(photo: Blob, index = 0): string {
  return "name" in photo ? String(photo.name) : `photo-${index + 1}`;
}

async function readJson<Answer>(response: Response): Promise<Answer> {
  return (await response.json()) as Answer;
}

/** The file in the answer. */
export async function readFile(response: Response): Promise<MadeFile> {
  const { headers } = response;
  return {
    content: await response.blob(),
    mediaType: headers.get("Content-Type")?.split(";")[0] ?? "",
    warnings: listed(headers.get("Document-Warnings")),
    failed: listed(headers.get("Document-Failed")),
  };
}

function listed(header: string | null): string[] {
  return (header ?? "").split(",").map((part) => part.trim()).filter((part) => part !== "");
}

function form(part: string, photos: Photo[], options: object): FormData {
  const made = new FormData();
  photos.forEach((photo, index) => {
    if (photo instanceof Blob) made.append(part, photo, nameOf(photo, index));
    else made.append(UPLOAD, photo.id);
  });
  for (const [name, value] of Object.entries(options)) {
    if (value !== null && value !== undefined) {
      made.append(name, typeof value === "string" ? value : JSON.stringify(value));
    }
  }
  return made;
}
