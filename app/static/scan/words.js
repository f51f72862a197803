// What the scan screen says: states, warnings and problems in words that need no knowledge of the service.

export const LOOKS = [["keep", "Colour"], ["normalize", "Even light"], ["gray", "Gray"], ["bw", "Black and white"]];
export const KINDS = [
  ["page", "a page"],
  ["spread", "two pages of a book"],
  ["joined", "a part of one large page"],
];

const ADVICE = {
  "show-all-text": "Show the whole page",
  "come-closer": "Come closer",
  "hold-still": "Hold still",
  "focus-evenly": "Hold the camera level with the page",
  "flatten-sheet": "Smooth the sheet out",
  "more-light": "Too dark: more light",
  "avoid-glare": "Move away from the glare",
  "avoid-shadow": "Move out of the shadow",
};

/** A few words while the camera is on the page: the most important advice, or null where the page reads well. */
export const adviceFor = (quality) => ADVICE[quality?.advice[0]?.code] ?? null;

const WARNINGS = {
  "kept-as-it-is": "No page was found. The photo is shown as it is: set its corners, or take it again.",
  "print-cut": "Some print is cut off in the photo.",
  "not-flat": "The page may still be bent. Lay the sheet flat, or set its corners.",
  "curved-page": "The page may still be bent.",
  "orientation-unknown": "It may lie the wrong way round. Rotate turns it.",
  "ocr-unavailable": "It may lie the wrong way round. Rotate turns it.",
  "outline-disagrees": "The edges of the sheet are not certain. Look at the corners.",
  "implausible-pose": "The shape is not certain. Look at the corners.",
  "reading-cut": "Not all of its text was read.",
  "facing-page": "A second page is in view. Both pages makes a page of each.",
  "glare": "Light is mirrored at the same place of all photos. One more photo from another side shows what is there.",
  "sheet-moved": "The sheet was bent in another way in one of the photos. The better photo is shown.",
  "one-page": "Only one page was found in the photo.",
};

/** Sentences about a page that is flat: what may be wrong with it, and what a better photo needs. */
export function warningsOf({ warnings, quality }) {
  const said = warnings.map(({ code }) => WARNINGS[code]).filter(Boolean);
  const advice = adviceFor(quality);
  return [...new Set(said), ...(advice ? [`For a better photo: ${advice[0].toLowerCase()}${advice.slice(1)}.`] : [])];
}

const PROBLEMS = {
  "no-text": "No page was found in this photo. Take it again, with the whole sheet in view.",
  "undecodable-image": "This file is damaged. Choose it again, or take another photo.",
  "unsupported-media-type": "This is not a file that can be read. JPEG, PNG, WebP, TIFF, HEIC and PDF can.",
  "too-large": "This photo is too large for the service.",
  "timed-out": "This took too long. Try again.",
  busy: "The service is busy. It goes on by itself.",
  "not-ready": "The service is starting. It goes on by itself.",
  unreachable: "There is no connection to the service. It goes on by itself.",
  unauthorized: "The service needs a key. The photo is kept here until then.",
  forbidden: "The service does not take this key. The photo is kept here until then.",
  "not-found": "The service no longer has this page. Flatten sends its photo again.",
  "photo-gone": "The photo of this page is no longer here. Take it again.",
  "not-overlapping": "These photos do not overlap enough. Neighbours should share a fifth of their area.",
  internal: "Something went wrong in the service. Try again.",
};

/** Problems of what a person set, by the field of the request. */
const FIELDS = {
  corners: "These corners cross, or one lies too far inside. Move them so that they go round the page, clockwise from its top left.",
};

export const problemText = ({ code, field, detail }) => PROBLEMS[code] ?? FIELDS[field] ?? detail ?? PROBLEMS.internal;

/** The state of a page in a few words. */
export function stateText({ state, kind, job, isChanging }) {
  if (isChanging) return "Changing ...";
  if (state === "waiting") return "Waiting";
  if (state === "working") return job ? (kind === "joined" ? "Joining ..." : "Flattening ...") : "Sending ...";
  return state === "failed" ? "Not flat" : "Ready";
}

/** How far all pages are. */
export function progressText({ all, ready, changing, failed, open }) {
  if (!all) return "";
  const pages = all === 1 ? "page is" : "pages are";
  const rest = failed && !open ? ` ${failed} ${failed === 1 ? "needs" : "need"} you.` : "";
  return `${ready - changing} of ${all} ${pages} ready.${rest}`;
}

/** Name of a language by Tesseract's code, as the browser calls it. */
export function languageName(code) {
  try {
    return new Intl.DisplayNames("en", { type: "language" }).of(code.replace("_", "-"));
  } catch {
    return code;
  }
}

/** A name for a file: of what the person typed, without what file systems refuse. */
export const fileName = (name) => name.replace(/[\\/:*?"<>|\p{Cc}\s]+/gu, " ").trim() || "Scan";
