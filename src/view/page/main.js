// Puts it together.

/** Says in the page why nothing is drawn. */
function refuse(text) {
  element("message").hidden = false;
  element("message").textContent = text;
}

/** `#t=0.5&from=-60,20&zoom=2&colour=strain&play`: time [s], where the eye is [degrees], and how much nearer than to fit. */
function wishes() {
  return new URLSearchParams(location.hash.slice(1));
}

/** The axes of the world, as the camera sees them. */
function drawAxes(camera) {
  const [right, up, back] = [camera.right(), camera.up(), camera.back()];
  const parts = [["x", "#d2461e"], ["y", "#2f9a4f"], ["z", "#2f6fd1"]].map(([name, colour], k) => {
    const [x, y] = [22 * right[k], -22 * up[k]];
    const text = `<text x="${1.36 * x}" y="${1.36 * y}" fill="${colour}">${name}</text>`;
    return { depth: back[k], svg: `<line x1="0" y1="0" x2="${x}" y2="${y}" stroke="${colour}"/>${text}` };
  });
  element("axes").innerHTML = parts.sort((a, b) => a.depth - b.depth).map((part) => part.svg).join("");
}

/** The bar that says what colours mean. */
function showLegend(stage) {
  const { scale } = stage.header;
  const legend = element("legend");
  legend.hidden = !(stage.byScale && scale);
  if (legend.hidden) return;
  const stops = Array.from({ length: 11 }, (_, k) => `rgb(${diverging(k / 5 - 1).map((c) => Math.round(255 * c)).join()})`);
  const value = (x) => (scale.unit === "-" ? `${Number((100 * x).toPrecision(2))} %` : quantity(x, scale.unit));
  const ends = [`−${value(scale.most)}`, "0", `+${value(scale.most)}`];
  legend.innerHTML = `<div class="what"></div><div class="bar"></div><div class="ends">${ends.map((end) => `<span>${end}</span>`).join("")}</div>`;
  legend.querySelector(".what").textContent = scale.name;
  legend.querySelector(".bar").style.background = `linear-gradient(to right, ${stops.join()})`;
}

function metres(x) {
  const [scale, name] = x >= 1000 ? [1e-3, "km"] : x >= 1 ? [1, "m"] : x >= 0.01 ? [100, "cm"] : x >= 1e-3 ? [1e3, "mm"] : [1e6, "µm"];
  return `${Number((x * scale).toPrecision(3))} ${name}`;
}

function start() {
  const canvas = element("canvas");
  const gl = canvas.getContext("webgl2", { antialias: true, stencil: true, alpha: false });
  if (!gl) {
    refuse("This view needs WebGL 2, and this browser does not offer it: it may be switched off, or the graphics driver refused. Another browser may show it.");
    for (const id of ["fit", "axes", "grid", "controls"]) element(id).style.display = "none";
    return;
  }
  const data = readData();
  const stage = new Stage(gl, data);
  const camera = new Camera();
  let [dirty, last] = [true, null];
  const changed = () => { dirty = true; };
  const player = new Player(data.slice(data.header.time), changed);
  const show = connect(player, data.slice(data.header.energy));

  // until someone steers, the view follows the window
  let steered = false;
  const fit = () => {
    steered = false;
    camera.fit(stage.points, stage.thickest);
    changed();
  };
  const resize = () => {
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const [width, height] = [Math.max(1, Math.round(canvas.clientWidth * ratio)), Math.max(1, Math.round(canvas.clientHeight * ratio))];
    [canvas.width, canvas.height] = [width, height];
    camera.aspect = width / height;
    gl.viewport(0, 0, width, height);
    if (!steered) fit();
    changed();
  };
  const colourBy = (scaled) => {
    stage.byScale = scaled;
    element("colour").value = scaled ? "scale" : "object";
    showLegend(stage);
    changed();
  };
  const obey = () => {
    const wish = wishes();
    const number = (name) => Number.parseFloat(wish.get(name));
    if (Number.isFinite(number("t"))) {
      player.playing = false;
      player.seek(number("t"));
    }
    const [azimuth, elevation] = (wish.get("from") ?? "").split(",").map((x) => (Number.parseFloat(x) * Math.PI) / 180);
    if (Number.isFinite(azimuth)) camera.azimuth = azimuth;
    if (Number.isFinite(elevation)) camera.elevation = clamp(elevation, -STEEPEST, STEEPEST);
    if (wish.has("from")) fit();
    if (number("zoom") > 0) {
      fit();
      camera.distance /= number("zoom");
      steered = true;
    }
    if (wish.has("colour")) colourBy(wish.get("colour") !== "object" && data.header.scale !== null);
    if (wish.has("play")) player.play(true);
  };

  if (data.header.scale) {
    element("colour").add(new Option("object", "object"));
    element("colour").add(new Option(data.header.scale.name, "scale"));
    element("colour").addEventListener("change", (event) => colourBy(event.target.value === "scale"));
  } else {
    element("colours").hidden = true;
  }
  element("note").textContent = data.header.note ? `${data.header.note}.` : "";
  element("grid").textContent = `grid ${metres(stage.spacing)}`;
  element("fit").addEventListener("click", fit);
  camera.azimuth = startAzimuth(stage.points);
  resize();
  steer(canvas, camera, { smallest: 0.02 * stage.size, largest: 30 * stage.size }, () => {
    steered = true;
    changed();
  });
  listen(player, fit);
  obey();
  addEventListener("hashchange", obey);
  new ResizeObserver(resize).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    stage.colours = pageColours();
    changed();
  });
  canvas.addEventListener("webglcontextlost", () => refuse("The graphics driver gave up. Load the page again."));

  const tick = (now) => {
    if (player.playing) {
      if (last !== null) player.pass(Math.min((now - last) / 1000, 0.1));
      dirty = true;
    }
    last = now;
    if (dirty) {
      dirty = false;
      stage.draw(player.frame(), camera, canvas.clientHeight || 1);
      drawAxes(camera);
      show();
    }
    requestAnimationFrame(tick);
  };
  requestAnimationFrame(tick);
}

/** From where the points are widest across, a little from the side. */
function startAzimuth(points) {
  let [sxx, sxy, syy] = [0, 0, 0];
  const mean = times(points.reduce(add, [0, 0, 0]), 1 / Math.max(points.length, 1));
  for (const p of points) {
    const [x, y] = minus(p, mean);
    sxx += x * x;
    sxy += x * y;
    syy += y * y;
  }
  const widest = 0.5 * Math.atan2(2 * sxy, sxx - syy);
  return widest - Math.PI / 2 + 0.4;
}

try {
  start();
} catch (error) {
  refuse(`The view could not be drawn: ${error.message}`);
  throw error;
}
