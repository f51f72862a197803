// Outlines over a picture: of a page in a photo, and of the photos of a joined page. Coordinates are pixels.

import { draw } from "../elements.js";

/** A closed line through the points, as the `d` of an SVG path. */
export const closedPath = (points) => `M${points.map(([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`).join("L")}Z`;

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

/** Draws where each photo lies on a joined page, with its number: `borders` are closed lines, null where none is known. */
export function drawPlaces(svg, borders) {
  const width = svg.viewBox.baseVal.width;
  const parts = borders.flatMap((border, index) => {
    if (!border) return [];
    const x = border.reduce((sum, point) => sum + point[0], 0) / border.length;
    const y = border.reduce((sum, point) => sum + point[1], 0) / border.length;
    const colour = `patch patch-${index % 6}`;
    return [
      draw("path", { class: colour, d: closedPath(border) }),
      draw("circle", { class: `${colour} mark`, cx: x, cy: y, r: width / 36 }),
      draw("text", { class: "number", x, y, "font-size": width / 28 }, String(index + 1)),
    ];
  });
  svg.replaceChildren(...parts);
}
