// The header and the numbers behind it.

/** Decodes the page's data: { header, slice }, where `slice` gives the numbers of an array of the header. */
function readData() {
  const text = (id) => document.getElementById(id).textContent.trim();
  const header = JSON.parse(text("header"));
  const coded = atob(text("numbers"));
  const bytes = new Uint8Array(coded.length);
  for (let k = 0; k < coded.length; k++) bytes[k] = coded.charCodeAt(k);
  // Little-endian, as every machine is that has a browser.
  const numbers = new Float32Array(bytes.buffer);
  return { header, slice: ({ offset, length }) => numbers.subarray(offset, offset + length) };
}

/** An array with one row per frame, and rows between frames. */
class Rows {
  constructor(values, frames) {
    this.values = values;
    this.width = frames > 0 ? values.length / frames : 0;
    this.between = new Float32Array(this.width);
  }

  /** The row at a frame, or on the line between two at a fraction; valid until the next call. */
  at(frame) {
    const k = Math.floor(frame);
    const part = frame - k;
    const from = k * this.width;
    if (part === 0) return this.values.subarray(from, from + this.width);
    for (let j = 0; j < this.width; j++) {
      const a = this.values[from + j];
      this.between[j] = a + part * (this.values[from + this.width + j] - a);
    }
    return this.between;
  }
}

/** The frame of a time, with its fraction; `time` is increasing. */
function frameOf(time, t) {
  const last = time.length - 1;
  if (!(t > time[0])) return 0;
  if (t >= time[last]) return last;
  let [low, high] = [0, last];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (time[middle] <= t) low = middle;
    else high = middle;
  }
  return low + (t - time[low]) / (time[high] - time[low]);
}

/** The least and the greatest of many numbers. */
function range(values) {
  return values.reduce(([low, high], x) => (Number.isFinite(x) ? [Math.min(low, x), Math.max(high, x)] : [low, high]), [Infinity, -Infinity]);
}

/** A number with a prefix of its unit, as people read it. */
function quantity(x, unitName) {
  const prefixes = [[1e6, "M"], [1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"]];
  const size = Math.abs(x);
  const [scale, prefix] = prefixes.find(([s]) => size >= s) ?? (size === 0 ? [1, ""] : prefixes[prefixes.length - 1]);
  if (size > 0 && size < 1e-9) return `${x.toExponential(3).replaceAll("-", "−")} ${unitName}`;
  const digits = size === 0 ? "0" : (x / scale).toPrecision(4);
  return `${digits.replace("-", "−")} ${prefix}${unitName}`;
}
