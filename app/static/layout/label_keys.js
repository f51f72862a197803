// Labels by keys: a digit for the first nine, 0 for none, or the first letters.

const PAUSE_MS = 900; // after it the next letter begins a new word

export class LabelKeys {
  constructor() {
    this.typed = "";
    this.last = 0;
  }

  /** The label that a key means among `labels`: a name, null for no label, or undefined for nothing. */
  read(key, labels, now = Date.now()) {
    if (/^[0-9]$/.test(key) && !(this.typed && now - this.last < PAUSE_MS)) {
      return key === "0" ? null : labels[Number(key) - 1];
    }
    if (key.length !== 1) return undefined;
    this.typed = now - this.last < PAUSE_MS ? this.typed + key.toLowerCase() : key.toLowerCase();
    this.last = now;
    return labels.find((label) => label.toLowerCase().startsWith(this.typed));
  }
}
