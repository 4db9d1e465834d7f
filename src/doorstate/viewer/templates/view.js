(() => {
  const { data } = clouds;
  const entries = [];
  const MAX_ENTRIES = 300; // of a stream; older ones are dropped
  const colors = ["part", "height", "channels"];
  const TURN = 0.3; // of the eye to the right of the camera, so that the three axes differ
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const element = (id) => document.getElementById(id);
  const [plot, list, follow] = [element("plot"), element("list"), element("follow")];
  const view = clouds.view(plot.querySelector("canvas"), TURN);
  view.turnable();
  let current = -1;
  let dropped = 0; // entries at the start of the stream
  let selectedColor = null;

  const make = (tag, properties = {}, ...children) => {
    const made = Object.assign(document.createElement(tag), properties);
    made.append(...children);
    return made;
  };
  const stateName = (state) => state.replace("_", "-");
  const tinted = (node, state) => (node.style.setProperty("--c", data.state_colors[state]), node);
  const dot = (state) => (state ? tinted(make("i"), state) : make("i"));
  const result = ({ prediction, error }) => (error ? "error" : prediction.state ? stateName(prediction.state) : "abstained");
  const isWrong = ({ truth, prediction }) => truth !== "" && prediction && prediction.state !== null && prediction.state !== truth;

  // ---- colours ---------------------------------------------------------------------------------------------
  const hasColor = (entry, color) =>
    color === "height" || Boolean(color === "part" ? entry.cloud.parts : entry.channels);

  function colored(entry, cloud, color) {
    if (color === "part") return clouds.byPart(cloud);
    return color === "channels" ? clouds.byChannels(clouds.channelsOf(entry)) : clouds.byHeight(cloud, entry.floor_z_m);
  }

  // ---- rulers ----------------------------------------------------------------------------------------------
  // Height above the floor, at the left of the cloud, with a mark every half metre.
  function heightRuler(whole, floor) {
    const [dx, dy] = [Math.sin(TURN), -Math.cos(TURN)]; // to the right on the screen
    const across = Float32Array.from({ length: whole.count }, (_, i) => whole.xyz[3 * i] * dx + whole.xyz[3 * i + 1] * dy);
    const leftmost = clouds.quantile(across, 0.005);
    const edge = across.findIndex((value) => value <= leftmost);
    const [x, y] = [whole.xyz[3 * edge] - 0.15 * dx, whole.xyz[3 * edge + 1] - 0.15 * dy];
    const top = Math.max(0.5, Math.floor((clouds.quantile(clouds.heights(whole), 0.99) - floor) * 2) / 2);
    const marks = Array.from({ length: 2 * top + 1 }, (_, k) => k / 2);
    return [{ points: [[x, y, floor], [x, y, floor + top]], width: 1.5 }, ...marks.map((height) => ({
      points: [[x, y, floor + height], [x - (height % 1 ? 0.04 : 0.08) * dx, y - (height % 1 ? 0.04 : 0.08) * dy, floor + height]], width: 1.5, side: -1,
      label: height % 1 ? "" : `${height} m`,
    }))];
  }

  // Arcs on the floor, a metre apart, for the distance from the camera.
  function distanceArcs(whole, floor) {
    const near = Array.from({ length: whole.count }, (_, i) => whole.xyz.subarray(3 * i, 3 * i + 3)).filter(([, , z]) => z < floor + 0.1);
    const distances = near.map(([x, y]) => Math.hypot(x, y));
    const turns = near.map(([x, y]) => Math.atan2(y, x));
    const [first, last] = [Math.ceil(clouds.quantile(distances, 0.02)), Math.floor(clouds.quantile(distances, 0.98))];
    const [right, left] = [clouds.quantile(turns, 0.05), clouds.quantile(turns, 0.95)];
    return Array.from({ length: Math.max(0, last - first + 1) }, (_, k) => first + k).map((distance) => ({
      points: Array.from({ length: 25 }, (_, k) => right + ((left - right) * (24 - k)) / 24)
        .map((turn) => [distance * Math.cos(turn), distance * Math.sin(turn), floor]),
      width: 1.5, faint: true, label: `${distance} m`,
    }));
  }

  // ---- one cloud -------------------------------------------------------------------------------------------
  const PALE = 0.3; // opacity of the whole cloud under the points that were used

  function draw() {
    const entry = entries[current];
    plot.hidden = !entry?.cloud;
    const color = entry?.cloud && ([selectedColor, ...colors].find((name) => name && hasColor(entry, name)));
    for (const chip of document.querySelectorAll("[data-color]")) {
      chip.hidden = !entries.some((other) => other.cloud && hasColor(other, chip.dataset.color));
      chip.setAttribute("aria-pressed", String(chip.dataset.color === color));
    }
    if (!color) return element("legend").replaceChildren();
    const [cloud, whole] = [clouds.decode(entry.cloud), clouds.decode(entry.whole)];
    const { legend, ...style } = colored(entry, cloud, color);
    const door = clouds.detectionLines(entry.detections);
    view.show({
      layers: [{ cloud: whole, ...clouds.byHeight(whole), size: 1.6, opacity: PALE }, { cloud, ...style, size: 2.6 }],
      lines: [...distanceArcs(whole, entry.floor_z_m), ...heightRuler(whole, entry.floor_z_m), ...door],
      margin: 40, axes: true,
    });
    const drawn = new Map(door.map((line) => [line.name, line]));
    element("legend").replaceChildren(...legend.map(swatch), ...[...drawn.values()].map(swatch));
  }

  function swatch({ name, color, gradient, low, high }) {
    const sample = make("i", { className: gradient ? "ramp" : "" });
    sample.style.background = gradient || color;
    return make("li", {}, ...(gradient ? [`${name} `, low, sample, high] : [sample, name]));
  }

  function hover(event) {
    const point = event.buttons ? null : view.pointAt(event.clientX, event.clientY);
    const tip = element("hover");
    tip.hidden = !point;
    if (!point) return;
    tip.textContent = `x ${point.x.toFixed(2)}, y ${point.y.toFixed(2)}, z ${point.z.toFixed(2)} m`;
    tip.style.left = `${Math.min(point.u + 12, plot.clientWidth - tip.offsetWidth - 4)}px`;
    tip.style.top = `${Math.max(4, point.v - 28)}px`;
  }

  const metres = (value) => (value === undefined ? "" : `${value.toFixed(2)} m`);
  const degrees = (value) => (value === undefined ? "" : `${value.toFixed(0)}°`);

  const axes = (pose) => pose && `${pose.axes} (${pose.axes_from})`;

  function tilt(pose) {
    if (!pose) return "";
    const [pitch, roll] = [Math.round(pose.pitch_deg), Math.round(pose.roll_deg)];
    const turns = [
      pitch && `${Math.abs(pitch)}° ${pitch > 0 ? "down" : "up"}`,
      roll && `${Math.abs(roll)}° ${roll > 0 ? "clockwise" : "counter-clockwise"}`,
    ];
    return `${turns.filter(Boolean).join(", ") || "level"} (${pose.tilt_from})`;
  }

  function distance({ doors = [], door_x_m, door_y_m }) {
    if (doors.length) return metres(doors[0].distance_m);
    return door_x_m === undefined ? "" : metres(Math.hypot(door_x_m, door_y_m));
  }

  const facts = (prediction) => [
    ["angle", degrees(prediction.opening_angle_deg)],
    ["passable", metres(prediction.passable_width_m)],
    ["distance", distance(prediction)],
    ["hinge", prediction.hinge],
    ["points", prediction.points.toLocaleString("en")],
    ["time", `${prediction.milliseconds.toFixed(0)} ms`],
    ["axes", axes(prediction.sensor_pose), "wide"],
    ["camera", tilt(prediction.tilt ?? prediction.sensor_pose), "wide"],
    ...others(prediction),
  ];

  // Doors besides the one that the prediction is about, by their numbers in the picture.
  const others = ({ doors = [] }) => doors.slice(1).map((door, k) => [
    `door ${k + 2}`,
    [door.state ? stateName(door.state) : door.reason, metres(door.distance_m), side(door.bearing_deg)].join(", "),
    "wide",
  ]);
  const side = (bearing) => (Math.round(bearing) ? `${degrees(Math.abs(bearing))} ${bearing > 0 ? "left" : "right"}` : "ahead");

  function describe(entry) {
    const { prediction } = entry;
    element("name").textContent = document.title = entry.name;
    const state = element("state");
    state.replaceChildren(dot(prediction?.state), result(entry));
    if (entry.truth) {
      state.append(make("span", { className: isWrong(entry) ? "badge warn" : "badge" }, `truth: ${stateName(entry.truth)}`));
    }
    element("probabilities").replaceChildren(...(prediction?.probabilities ? data.states : []).flatMap(
      (name) => {
        const p = prediction.probabilities?.[name];
        if (p === undefined) return [];
        const filled = tinted(make("i"), name);
        filled.style.width = `${100 * p}%`;
        return [make("dt", {}, stateName(name)), make("dd", { className: "bar" }, filled),
          make("dd", { className: "number" }, `${(100 * p).toFixed(1)} %`)];
      }));
    element("reason").textContent = entry.error || prediction?.reason || "";
    const plan = element("plan");
    plan.hidden = !entry.plan;
    if (entry.plan) plan.src = `data:image/svg+xml,${encodeURIComponent(entry.plan)}`;
    const all = [...(prediction ? facts(prediction) : []), ...(entry.facts ?? []).map((fact) => [...fact, "wide"])];
    element("facts").replaceChildren(...all.filter(([, value]) => value).flatMap(
      ([name, value, className = ""]) => [make("dt", { className }, name), make("dd", { className }, value)]));
  }

  function show(index) {
    if (index < 0 || index >= entries.length) return;
    list.children[current]?.firstChild.removeAttribute("aria-current");
    current = index;
    const chosen = list.children[current].firstChild;
    chosen.setAttribute("aria-current", "true");
    const top = chosen.offsetTop - list.offsetTop; // scroll the list, never the page
    if (top < list.scrollTop || top + chosen.offsetHeight > list.scrollTop + list.clientHeight) {
      list.scrollTop = top - list.clientHeight / 2;
    }
    place();
    describe(entries[current]);
    if (!data.live) history.replaceState(null, "", `#${current + 1}`);
    draw();
  }

  function place() {
    element("place").textContent = entries.length ? `${dropped + current + 1} / ${dropped + entries.length}` : "";
    element("previous").disabled = current <= 0;
    element("next").disabled = current >= entries.length - 1;
  }

  // ---- all clouds ------------------------------------------------------------------------------------------
  function add(entry) {
    entries.push(entry);
    const state = make("span", { className: isWrong(entry) || entry.error ? "wrong" : "" }, dot(entry.prediction?.state), result(entry));
    list.append(make("li", {}, make("button", { type: "button" }, make("b", {}, entry.name), state)));
  }

  const step = (by) => {
    setFollow(false);
    show(current + by);
  };
  const setFollow = (isOn) => follow?.setAttribute("aria-pressed", String(isOn));
  const isFollowing = () => follow?.getAttribute("aria-pressed") === "true";

  element("previous").addEventListener("click", () => step(-1));
  element("next").addEventListener("click", () => step(1));
  follow?.addEventListener("click", () => {
    setFollow(!isFollowing());
    if (isFollowing()) show(entries.length - 1);
  });
  list.addEventListener("click", (event) => {
    const item = event.target.closest("li");
    if (item) step([...list.children].indexOf(item) - current);
  });
  document.addEventListener("keydown", (event) => {
    if (event.altKey || event.ctrlKey || event.metaKey || event.shiftKey) return;
    if (event.key === "ArrowLeft") step(-1);
    else if (event.key === "ArrowRight") step(1);
    else return;
    event.preventDefault();
  });
  document.querySelector(".chips").addEventListener("click", (event) => {
    const { color } = event.target.closest("button")?.dataset ?? {};
    if (!color) return;
    selectedColor = color;
    draw();
  });
  dark.addEventListener("change", view.redraw);
  plot.addEventListener("pointermove", hover);
  plot.addEventListener("pointerleave", () => { element("hover").hidden = true; });

  data.entries.forEach(add);
  show(Math.min(Math.max(1, Number.parseInt(location.hash.slice(1), 10) || 1), entries.length) - 1);

  // ---- a stream --------------------------------------------------------------------------------------------
  if (!data.live) return;
  let isDue = false;
  place();
  draw();

  function receive(event) {
    add(JSON.parse(event.data));
    if (entries.length > MAX_ENTRIES && current !== 0) {
      entries.shift();
      list.firstChild.remove();
      [current, dropped] = [current - 1, dropped + 1];
    }
    place();
    if (isDue || !(isFollowing() || current < 0)) return;
    isDue = true; // of several clouds within one frame only the last is drawn
    requestAnimationFrame(() => {
      isDue = false;
      show(entries.length - 1);
    });
  }

  const badge = element("connection");
  const source = new EventSource("events");
  source.addEventListener("open", () => { badge.textContent = "live"; });
  source.addEventListener("error", () => { badge.textContent = "not connected"; });
  source.addEventListener("cloud", receive);
  source.addEventListener("end", () => { badge.textContent = "ended"; source.close(); });
})();
