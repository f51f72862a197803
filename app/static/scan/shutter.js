// When the shutter fires by itself: the outline of a page is steady, and the picture is sharp.

const STEADY = 0.012; // of the outline's diagonal: mean move of its corners from one preview to the next. A hand that
// holds still moves them by 0.2 to 0.8 % (and the preview's own noise is 0.1 %), one that aims by 3 % and more.
const TIMES = 2; // steady moves in a row, so three previews that agree
const MOVED = 0.08; // of the diagonal: so far from the page that was taken is another page, or the next one
const LEAST_AREA = 0.12; // of the picture: what is smaller is far away, or no page that is meant
const UNSHARP = ["hold-still", "focus-evenly"];

const diagonal = ([a, , c]) => Math.hypot(c[0] - a[0], c[1] - a[1]);
const apart = (a, b) => a.reduce((sum, [x, y], index) => sum + Math.hypot(x - b[index][0], y - b[index][1]), 0) / a.length;

/** Area of a polygon. */
function area(points) {
  const doubled = points.reduce((sum, [x, y], index) => {
    const [nextX, nextY] = points[(index + 1) % points.length];
    return sum + x * nextY - nextX * y;
  }, 0);
  return Math.abs(doubled) / 2;
}

export class Shutter {
  constructor() {
    Object.assign(this, { before: null, taken: null, steady: 0 });
  }

  /** A preview: four corners (null: no page is seen), codes of advice, and the size of its picture. True: fire now. */
  see(corners, advice, { width, height }) {
    const before = this.before;
    this.before = corners;
    if (!corners) {
      Object.assign(this, { steady: 0, taken: null }); // the page has left the picture: the next one may be taken
      return false;
    }
    if (this.taken && apart(corners, this.taken) > MOVED * diagonal(corners)) this.taken = null;
    const isSteady = before && apart(corners, before) < STEADY * diagonal(corners);
    this.steady = isSteady ? this.steady + 1 : 0;
    const isGood = area(corners) > LEAST_AREA * width * height && !advice.some((code) => UNSHARP.includes(code));
    return !this.taken && isGood && this.steady >= TIMES;
  }

  /** The page in view is taken; it is not taken again before it has moved or gone. */
  fired() {
    Object.assign(this, { taken: this.before, steady: 0 });
  }
}
