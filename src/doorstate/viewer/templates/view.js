(() => {
  const { data } = clouds;
  const entries = [];
  const MAX_ENTRIES = 300; // of a stream; older ones are dropped
  const colors = ["part", "height", "channels"];
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const element = (id) => document.getElementById(id);
  const [plot, list, follow] = [element("plot"), element("list"), element("follow")];
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

  function traces(entry, color) {
    const cloud = clouds.decode(entry.cloud);
    const points = color === "part" ? clouds.byPart(cloud)
      : color === "channels" ? clouds.byChannels(cloud, clouds.channelsOf(entry)) : clouds.byHeight(cloud);
    return [...points, clouds.camera(), ...entry.detections.map((detection) => clouds.detection(detection, detection.name))];
  }

  const NOTES = {
    part: "Parts of the simulated scene.",
    height: "",
    channels: "Number of channels of the network's global feature that come from each point (critical points).",
  };

  // ---- one cloud -------------------------------------------------------------------------------------------
  function draw() {
    const entry = entries[current];
    plot.hidden = !entry?.cloud;
    const color = entry?.cloud && ([selectedColor, ...colors].find((name) => name && hasColor(entry, name)));
    for (const chip of document.querySelectorAll("[data-color]")) {
      chip.hidden = !entries.some((other) => other.cloud && hasColor(other, chip.dataset.color));
      chip.setAttribute("aria-pressed", String(chip.dataset.color === color));
    }
    element("note").textContent = color ? NOTES[color] : "";
    if (!color) return;
    const layout = clouds.layout();
    layout.uirevision = layout.scene.uirevision = "keep"; // keep the view that the user chose
    clouds.plotly().react(plot, traces(entry, color), layout, clouds.config);
  }

  function describe(entry) {
    const { prediction } = entry;
    element("name").textContent = document.title = entry.name;
    const state = element("state");
    state.replaceChildren(dot(prediction?.state), result(entry));
    if (entry.truth) {
      state.append(make("span", { className: isWrong(entry) ? "badge warn" : "badge" }, `truth: ${stateName(entry.truth)}`));
    }
    element("probabilities").replaceChildren(...(prediction?.state ? data.states : []).flatMap(
      (name) => {
        const p = prediction.probabilities[name];
        const filled = tinted(make("i"), name);
        filled.style.width = `${100 * p}%`;
        return [make("dt", {}, stateName(name)), make("dd", { className: "bar" }, filled),
          make("dd", { className: "number" }, `${(100 * p).toFixed(1)} %`)];
      }));
    element("reason").textContent = entry.error || prediction?.reason || "";
    element("facts").textContent = prediction ? [
      prediction.opening_angle_deg === undefined ? "" : `opened ${prediction.opening_angle_deg.toFixed(0)}°`,
      `${prediction.points.toLocaleString("en")} points`, `${prediction.milliseconds.toFixed(0)} ms`,
    ].filter(Boolean).join(", ") : "";
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
  dark.addEventListener("change", draw);
  new ResizeObserver(() => { if (plot.data && !plot.hidden) window.Plotly.Plots.resize(plot); }).observe(plot);

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
