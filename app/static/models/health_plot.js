// Errors of a class over time, from its feedback, as a plot.

import { draw, make, percent, when } from "../elements.js";

const WINDOW = 10; // feedbacks in each mean
const [WIDTH, HEIGHT, MARGIN] = [640, 200, 36];

/** Mean error of the last feedbacks at each feedback, oldest first. */
export function errorsOverTime(feedback) {
  const oldest = [...feedback].reverse();
  return oldest.map((_, index) => {
    const recent = oldest.slice(Math.max(0, index - WINDOW + 1), index + 1);
    const zones = recent.reduce((sum, one) => sum + one.zones, 0);
    return {
      time: oldest[index].created,
      zones: zones ? recent.reduce((sum, one) => sum + one.wrong, 0) / zones : 0,
      classes: recent.filter((one) => one.class.found !== one.class.verified).length / recent.length,
    };
  });
}

const line = (points, key, most) =>
  points
    .map((point, index) => {
      const x = MARGIN + (index / Math.max(1, points.length - 1)) * (WIDTH - 2 * MARGIN);
      const y = HEIGHT - MARGIN - (point[key] / most) * (HEIGHT - 2 * MARGIN);
      return `${index ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`;
    })
    .join("");

/** The plot, or a sentence where there is no feedback yet. */
export function healthPlot(name, feedback) {
  const points = errorsOverTime(feedback);
  if (!points.length) return make("p", { class: "empty" }, "No feedback yet.");
  const most = Math.max(0.05, ...points.flatMap(({ zones, classes }) => [zones, classes]));
  const last = points[points.length - 1];
  const words = `Wrong labels of ${name}: ${percent(last.zones)} of zones, wrong class: ${percent(last.classes)} of the last ${Math.min(WINDOW, points.length)} pages`;
  const ticks = [0, 0.5, 1].map((share) => {
    const y = HEIGHT - MARGIN - share * (HEIGHT - 2 * MARGIN);
    return [
      draw("line", { class: "grid", x1: MARGIN, x2: WIDTH - MARGIN, y1: y, y2: y }),
      draw("text", { class: "tick", x: MARGIN - 4, y: y + 4, "text-anchor": "end" }, percent(share * most)),
    ];
  });
  const svg = draw(
    "svg",
    { class: "plot", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": words },
    ticks,
    draw("path", { class: "series zones", d: line(points, "zones", most) }),
    draw("path", { class: "series classes", d: line(points, "classes", most) }),
    draw("text", { class: "tick", x: MARGIN, y: HEIGHT - 10 }, when(points[0].time)),
    draw("text", { class: "tick", x: WIDTH - MARGIN, y: HEIGHT - 10, "text-anchor": "end" }, when(last.time)),
  );
  const key = make("figcaption", {}, make("span", { class: "key zones" }, "wrong labels"), " ", make("span", { class: "key classes" }, "wrong class"), ` (mean of ${WINDOW} feedbacks)`);
  return make("figure", {}, svg, key);
}
