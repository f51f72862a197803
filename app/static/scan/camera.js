// The camera with the outline of the page that it sees, advice in a few words, and a shutter that fires by itself.

import { button, checkbox, draw, make } from "../elements.js";
import { request } from "../service.js";
import { borderOf, closedPath, emptyDrawing } from "./overlay.js";
import { Shutter } from "./shutter.js";
import { adviceFor } from "./words.js";

const WANTED = { video: { facingMode: "environment", width: { ideal: 4096 }, height: { ideal: 3072 } } };
const PREVIEW_PX = 960; // long side of the pictures that are sent while the camera is on the page
const PAUSE_MS = 150; // between two previews; each takes about as long again
const JPEG_QUALITY = 0.92;

/** Whether this browser may show a camera: over TLS or on this machine only. */
export const hasCamera = () => Boolean(navigator.mediaDevices?.getUserMedia);

/** A picture of the video, at most `most` pixels on its long side, as a JPEG file. */
function grab(video, most = Infinity, quality = JPEG_QUALITY) {
  const factor = Math.min(1, most / Math.max(video.videoWidth, video.videoHeight));
  const canvas = make("canvas", { width: Math.round(video.videoWidth * factor), height: Math.round(video.videoHeight * factor) });
  canvas.getContext("2d").drawImage(video, 0, 0, canvas.width, canvas.height);
  return new Promise((resolve) => canvas.toBlob(resolve, "image/jpeg", quality));
}

/** The best picture that the camera gives: a photo, where there is one, else a picture of the video. */
async function photograph(video, track) {
  try {
    return await new ImageCapture(track).takePhoto();
  } catch {
    return grab(video);
  }
}

/**
 * Shows the camera until the person closes it. `onPhoto(file)` gets each photo. Throws where there is no camera, or the
 * person does not let the page use it.
 */
export async function useCamera(onPhoto) {
  const stream = await navigator.mediaDevices.getUserMedia(WANTED);
  const [track] = stream.getVideoTracks();
  const video = make("video", { autoplay: true, muted: true, playsinline: true });
  const stage = make("div", { class: "camera-stage" }, video);
  const advice = make("p", { class: "camera-advice", role: "status" }, "Looking for a page ...");
  const take = button("Take photo", () => shoot(), "primary");
  const byItself = checkbox("By itself", true);
  const torch = button("Light", switchTorch);
  torch.hidden = !track.getCapabilities?.().torch;
  const count = make("span", { class: "camera-count" });
  const close = button("Close", () => dialog.close());
  const tools = make("div", { class: "row" }, take, byItself, torch, count, close);
  const dialog = make("dialog", { class: "wide camera", "aria-label": "Camera" }, stage, advice, tools);
  const shutter = new Shutter();
  let taken = 0;
  let drawing = null;
  let isShooting = false;

  async function switchTorch() {
    const isOn = torch.getAttribute("aria-pressed") !== "true";
    await track.applyConstraints({ advanced: [{ torch: isOn }] }).catch(() => {});
    torch.setAttribute("aria-pressed", String(isOn));
  }

  async function shoot() {
    if (isShooting || !video.videoWidth) return;
    isShooting = true;
    shutter.fired();
    stage.classList.add("flash");
    const photo = await photograph(video, track);
    taken += 1;
    count.textContent = taken === 1 ? "1 photo" : `${taken} photos`;
    onPhoto(new File([photo], `Photo ${new Date().toLocaleString("sv").replaceAll(":", ".")}.jpg`, { type: photo.type }));
    setTimeout(() => stage.classList.remove("flash"), 200);
    isShooting = false;
  }

  /** What the service sees in the picture now: its answer, or null where it sees no page. */
  async function preview() {
    const form = new FormData();
    form.append("image", await grab(video, PREVIEW_PX, 0.7), "preview.jpg");
    for (const [name, value] of Object.entries({ preview: "true", format: "json", on_no_text: "keep" })) form.append(name, value);
    const seen = await (await request("POST", "rectify", { body: form })).json();
    return seen.warnings.some(({ code }) => code === "kept-as-it-is") ? null : seen;
  }

  function showOutline(seen) {
    drawing?.remove();
    if (!seen) return;
    drawing = emptyDrawing(seen.photo.width, seen.photo.height);
    drawing.append(draw("path", { class: "outline", d: closedPath(borderOf(seen.mesh.source)) }));
    stage.append(drawing);
  }

  async function look() {
    while (dialog.open) {
      try {
        if (video.videoWidth) {
          const seen = await preview();
          if (!dialog.open) return;
          showOutline(seen);
          const { source } = seen?.mesh ?? {};
          const corners = seen && [source[0][0], source[0].at(-1), source.at(-1).at(-1), source.at(-1)[0]];
          const codes = seen?.quality?.advice.map((one) => one.code) ?? [];
          const fires = shutter.see(corners, codes, seen?.photo ?? {});
          advice.textContent = seen ? (adviceFor(seen.quality) ?? "Good: hold still") : "No page in view";
          if (fires && byItself.firstElementChild.checked) await shoot();
        }
      } catch {
        advice.textContent = "No outline now. Take photo works all the same.";
        await new Promise((resolve) => setTimeout(resolve, 10 * PAUSE_MS));
      }
      await new Promise((resolve) => setTimeout(resolve, PAUSE_MS));
    }
  }

  video.srcObject = stream;
  document.body.append(dialog);
  dialog.showModal();
  take.focus();
  look();
  await new Promise((resolve) => dialog.addEventListener("close", resolve));
  track.stop();
  dialog.remove();
}
