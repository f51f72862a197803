// What the service saw, drawn on the photo: outline, mesh, rulings. Coordinates are pixels of the upright photo.

import { draw } from "../elements.js";

const LINES = 16; // lines of the mesh that are drawn in each direction

const path = (points, isClosed) => `M${points.map(([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`).join("L")}${isClosed ? "Z" : ""}`;

/** An empty drawing over a picture of this size; the origin is the centre of the first pixel. */
export function emptyDrawing(width, height) {
  const options = { class: "drawing", viewBox: `-0.5 -0.5 ${width} ${height}`, "aria-hidden": "true" };
  return draw("svg", options);
}

/** The point of a picture of this size that a pointer event is at; `element` shows all of the picture. */
export function pointOf(event, element, width, height) {
  const box = element.getBoundingClientRect();
  return [((event.clientX - box.left) / box.width) * width - 0.5, ((event.clientY - box.top) / box.height) * height - 0.5];
}

/** The nearest point in a picture of this size. */
export const inPicture = ([x, y], width, height) => [Math.min(width - 1, Math.max(0, x)), Math.min(height - 1, Math.max(0, y))];

/** Border of a mesh, clockwise from its first node. */
export function borderOf(nodes) {
  const last = nodes.length - 1;
  const right = nodes.slice(1, last).map((row) => row[row.length - 1]);
  const left = nodes.slice(1, last).map((row) => row[0]);
  return [...nodes[0], ...right, ...[...nodes[last]].reverse(), ...left.reverse()];
}

function meshLines(nodes) {
  const every = (count) => Math.max(1, Math.round((count - 1) / LINES));
  const rows = nodes.filter((_, row) => row % every(nodes.length) === 0);
  const columns = nodes[0].map((_, column) => nodes.map((row) => row[column]));
  const picked = columns.filter((_, column) => column % every(columns.length) === 0);
  return [...rows, ...picked].map((line) => path(line)).join("");
}

/** The straight lines on the page along which it is not bent. */
function rulingLines(rulings, length) {
  return rulings
    .map(({ point: [x, y], angle_deg: angle }) => {
      const dx = (Math.cos((angle * Math.PI) / 180) * length) / 2;
      const dy = (Math.sin((angle * Math.PI) / 180) * length) / 2;
      return path([[x - dx, y - dy], [x + dx, y + dy]]);
    })
    .join("");
}

/** Draws a RectifyResult over its photo; each part has a class by which it can be hidden. */
export function drawResult(svg, result) {
  const { source } = result.mesh;
  const border = path(borderOf(source), true);
  const id = `page-${Math.random().toString(36).slice(2)}`;
  const rulings = result.surface.rulings ?? [];
  const corners = (result.corners ?? []).filter(Boolean);
  const width = svg.viewBox.baseVal.width;
  svg.replaceChildren(
    draw("clipPath", { id }, draw("path", { d: border })),
    draw("path", { class: "mesh", d: meshLines(source) }),
    draw("path", { class: "rulings", d: rulingLines(rulings, 2 * width), "clip-path": `url(#${id})` }),
    draw("path", { class: "outline", d: border }),
    ...corners.map(([cx, cy]) => draw("circle", { class: "outline corner", cx, cy, r: width / 90 })),
  );
}

/** Where each photo lies on a mosaic, with its number. */
export function drawPatches(svg, patches) {
  const width = svg.viewBox.baseVal.width;
  const parts = patches.flatMap((patch, index) => {
    if (!patch.placed) return [];
    const border = borderOf(patch.mesh.target);
    const x = border.reduce((sum, point) => sum + point[0], 0) / border.length;
    const y = border.reduce((sum, point) => sum + point[1], 0) / border.length;
    const colour = `patch patch-${index % 6}`;
    return [
      draw("path", { class: colour, d: path(border, true) }),
      draw("circle", { class: `${colour} mark`, cx: x, cy: y, r: width / 36 }),
      draw("text", { class: "number", x, y, "font-size": width / 28 }, String(index + 1)),
    ];
  });
  svg.replaceChildren(...parts);
}
