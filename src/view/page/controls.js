// Time: playing, the slider, the plot of energy, the keyboard.

const SPEEDS = [0.01, 0.02, 0.05, 0.1, 0.25, 0.5, 1, 2, 5, 10];
/** Something shorter than this is played slowly [s]. */
const SHORTEST = 2;

const element = (id) => document.getElementById(id);

/** Plays through the frames; `changed` is told when another is to be drawn. */
class Player {
  constructor(time, changed) {
    this.time = time;
    this.changed = changed;
    this.first = time[0];
    this.last = time[time.length - 1];
    this.t = this.first;
    this.playing = false;
    const duration = this.last - this.first;
    this.speed = Math.max(SPEEDS.findLastIndex((speed) => speed <= 1 && duration / speed >= SHORTEST), 0);
    this.loop = true;
  }

  /** Between frames while it plays; when it stands, a frame that was simulated. */
  frame() {
    const frame = frameOf(this.time, this.t);
    return this.playing ? frame : Math.round(frame);
  }

  play(playing) {
    this.playing = playing;
    if (playing && this.t >= this.last) this.t = this.first;
    if (!playing) this.t = this.time[this.frame()];
    this.changed();
  }

  /** To the frame nearest to a time. */
  seek(t) {
    this.t = clamp(t, this.first, this.last);
    if (!this.playing) this.t = this.time[this.frame()];
    this.changed();
  }

  step(by) {
    const frame = clamp(Math.round(frameOf(this.time, this.t)) + by, 0, this.time.length - 1);
    this.playing = false;
    this.t = this.time[frame];
    this.changed();
  }

  /** Lets `seconds` of the reader's time pass. */
  pass(seconds) {
    this.t += seconds * SPEEDS[this.speed];
    if (this.t < this.last) return;
    if (this.loop && this.last > this.first) {
      this.t = this.first + ((this.t - this.first) % (this.last - this.first));
    } else {
      this.t = this.last;
      this.playing = false;
    }
  }
}

/** The path of a curve over time in a box of 1000 by 100. */
function curvePath(time, values) {
  const [low, high] = range(values);
  const span = time[time.length - 1] - time[0] || 1;
  // what single precision cannot tell apart is no change
  const flat = high - low <= 1e-6 * Math.max(Math.abs(low), Math.abs(high));
  const height = (x) => (flat ? 50 : 96 - (92 * (x - low)) / (high - low));
  const point = (t, k) => `${((1000 * (t - time[0])) / span).toFixed(2)},${height(values[k]).toFixed(2)}`;
  return `M${Array.from(time, point).join("L")}`;
}

/** Connects a player with the controls of the page; returns what shows its state. */
function connect(player, energy) {
  const { time } = player;
  const [slider, plot] = [element("slider"), element("plot")];
  element("curve").setAttribute("d", curvePath(time, energy));
  // an end of the range that is only rounding beside the other is none
  const largest = Math.max(...range(energy).map(Math.abs));
  const [low, high] = range(energy).map((x) => (Math.abs(x) < 1e-7 * largest ? 0 : x));
  element("low").textContent = `energy ${quantity(low, "J")} … ${quantity(high, "J")}`;
  element("end").textContent = `${seconds(player.last)} s`;
  SPEEDS.forEach((speed, k) => element("speed").add(new Option(`${speed}×`, String(k))));
  const digits = Math.max(3, Math.ceil(-Math.log10((player.last - player.first) / time.length || 1)) + 1);

  element("play").addEventListener("click", () => player.play(!player.playing));
  slider.addEventListener("input", () => {
    player.playing = false;
    player.seek(player.first + Number(slider.value) * (player.last - player.first));
  });
  const point = (event) => {
    if (!(event.buttons & 1)) return;
    const box = plot.getBoundingClientRect();
    player.playing = false;
    player.seek(player.first + ((event.clientX - box.left) / box.width) * (player.last - player.first));
  };
  plot.addEventListener("pointerdown", (event) => {
    plot.setPointerCapture(event.pointerId);
    point(event);
  });
  plot.addEventListener("pointermove", point);
  element("speed").addEventListener("change", (event) => {
    player.speed = Number(event.target.value);
    player.changed();
  });
  element("loop").addEventListener("change", (event) => {
    player.loop = event.target.checked;
  });

  return () => {
    const frame = clamp(Math.round(player.frame()), 0, time.length - 1);
    const share = (player.t - player.first) / (player.last - player.first || 1);
    slider.value = String(share);
    slider.setAttribute("aria-valuetext", `${seconds(player.t)} seconds`);
    element("cursor").setAttribute("d", `M${1000 * share},0V100`);
    element("time").textContent = `t = ${player.t.toFixed(digits)} s`;
    element("energy").textContent = `E = ${quantity(energy[frame], "J")}`;
    element("play").textContent = player.playing ? "❚❚" : "▶";
    element("play").setAttribute("aria-label", player.playing ? "Pause" : "Play");
    element("speed").value = String(player.speed);
    element("loop").checked = player.loop;
  };
}

const seconds = (t) => String(Number(t.toPrecision(6)));

/** Keys of the whole page. */
function listen(player, fit) {
  const actions = {
    " ": () => player.play(!player.playing),
    ArrowLeft: (event) => player.step(event.shiftKey ? -10 : -1),
    ArrowRight: (event) => player.step(event.shiftKey ? 10 : 1),
    ArrowUp: () => { player.speed = Math.min(player.speed + 1, SPEEDS.length - 1); },
    ArrowDown: () => { player.speed = Math.max(player.speed - 1, 0); },
    Home: () => player.seek(player.first),
    End: () => player.seek(player.last),
    f: fit,
    l: () => { player.loop = !player.loop; },
  };
  document.addEventListener("keydown", (event) => {
    const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action || event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT") return;
    // a button that has the focus would be pressed as well
    event.preventDefault();
    action(event);
    player.changed();
  });
  document.addEventListener("keyup", (event) => {
    if (event.key === " " && event.target.tagName === "BUTTON") event.preventDefault();
  });
}
