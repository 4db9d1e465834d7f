// Labelling: the frame that is shown, its doors, and what keys do.
(() => {
  const { data } = clouds;
  const element = (id) => document.getElementById(id);
  const [MOVE_M, TURN_DEG, LIKELY, EDIT_MS] = [0.02, 2, 0.5, 400];
  let [frame, doors, selected, view] = [null, [], null, "colour"];
  let [isBusy, isRunning, pending, asked, lastName, editTimer] = [false, false, null, "", "", 0];

  const stateWords = (state) => state.replace("_", "-");
  const address = (path) => new URL(path, location.href);
  const make = (tag, properties, ...children) => {
    const made = Object.assign(document.createElement(tag), properties);
    made.append(...children);
    return made;
  };

  let messageTimer = 0;
  function say(text, isLasting) {
    clearTimeout(messageTimer);
    element("message").textContent = text;
    element("message").hidden = !text;
    if (text && !isLasting) messageTimer = setTimeout(say, 3500, "");
  }

  async function request(path, content) {
    const options = content && { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(content) };
    try {
      const response = await fetch(address(path), options);
      return { status: response.status, ...await response.json() };
    } catch {
      return { status: 0, error: "doorstate label does not answer: has it ended?" };
    }
  }

  // ---- doors of the frame ----------------------------------------------------------------------------------------
  const isAsked = (door) => door.kind !== "unlikely";
  const bearing = ({ place }) => Math.atan2(place.y_m, place.x_m);
  const isNear = (a, b) => Math.hypot(a.x_m - b.x_m, a.y_m - b.y_m) < 0.4;

  function order() {
    doors.sort((a, b) => isAsked(b) - isAsked(a) || bearing(b) - bearing(a));
    let number = 0;
    for (const door of doors) door.number = isAsked(door) ? (number += 1) : "";
  }

  function doorsOf(shown) {
    const given = shown.labels.length ? shown.labels : shown.proposed;
    const isProposed = !shown.labels.length;
    const known = given.filter(({ place }) => place).map(({ state, door, place }) =>
      ({ place, door, kind: isProposed ? "proposed" : "label", state: isProposed ? null : state, proposed: isProposed ? state : null }));
    const others = shown.candidates.filter((candidate) => !known.some(({ place }) => isNear(place, candidate)));
    const isDone = known.length > 0 || given.some(({ state }) => state === "no_door");
    const door = given.find(({ place }) => !place)?.door ?? "";
    return [...known, ...others.map(({ score, ...place }) =>
      ({ place, door, kind: isDone || score < LIKELY ? "unlikely" : "found", state: null, proposed: null }))];
  }

  function addDoor(place) {
    const door = { place, door: "", kind: "drawn", state: null, proposed: null };
    doors.push(door);
    select(door);
  }

  function select(door) {
    selected = door;
    order();
    redraw();
  }

  // ---- views --------------------------------------------------------------------------------------------------
  const host = {
    doors: () => doors,
    selected: () => selected,
    select,
    redraw: () => redraw(),
    edited: (door) => edited(door),
    newPlace: addDoor,
    async newBox(box) {
      const { status, error, ...place } = await request(`frames/${frame.number}/place`, { box });
      if (status === 200) addDoor(place);
      else say(error);
    },
  };
  const picture = labelViews.picture(element("picture"), host);
  const plan = labelViews.plan(element("plan"), host);
  const scene = clouds.view(element("cloud"), 0.3);
  scene.turnable();
  let [cloud, layer, isDue] = [null, null, false];

  function redraw() {
    if (isDue) return;
    isDue = true;
    requestAnimationFrame(() => {
      isDue = false;
      if (!frame || frame.error) return;
      if (view === "cloud") scene.show({ layers: [layer], lines: labelViews.lines(host), margin: 16, axes: true });
      else picture.draw();
      plan.draw();
      list();
    });
  }

  function setView(next) {
    view = next;
    element("picture").hidden = view === "cloud";
    element("cloud").hidden = view !== "cloud";
    for (const chip of document.querySelectorAll("[data-view]")) {
      chip.setAttribute("aria-pressed", String(chip.dataset.view === view));
      chip.hidden = chip.dataset.view !== "cloud" && !frame.pictures?.[chip.dataset.view];
    }
    if (view !== "cloud") picture.show(frame, frame.pictures[view]);
    redraw();
  }

  function list() {
    const place = ({ width_m, x_m, y_m }) => `${width_m.toFixed(2)} m wide, ${Math.hypot(x_m, y_m).toFixed(1)} m away`;
    const words = (door) => labelViews.words(door) || (isAsked(door) ? "?" : "unlikely");
    const rows = doors.map((door) => {
      const mark = make("i", { textContent: door.number });
      const shown = data.state_colors[door.state ?? door.proposed];
      if (shown) mark.style.setProperty("--c", shown);
      const button = make("button", { type: "button", onclick: () => select(door) }, mark,
        make("span", { textContent: door.door ? `${words(door)}, ${door.door}` : words(door) }), make("small", { textContent: place(door.place) }));
      button.setAttribute("aria-current", String(door === selected));
      return make("li", {}, button);
    });
    const whole = frame.labels.find((label) => !label.place);
    if (whole && !doors.some((door) => door.state)) rows.unshift(make("li", { className: "none", textContent: `This frame: ${stateWords(whole.state)}${whole.door ? `, ${whole.door}` : ""}` }));
    if (!rows.length) rows.push(make("li", { className: "none", textContent: "None was found: draw one, or press N." }));
    element("doors").replaceChildren(...rows);
    if (document.activeElement !== element("door")) element("door").value = selected?.door ?? "";
    element("door").disabled = !selected;
  }

  // ---- frames -------------------------------------------------------------------------------------------------
  async function load(number) {
    const shown = await request(`frames/${number}`);
    if (shown.status !== 200) return say(shown.error, true);
    [frame, pending, asked] = [shown, null, ""];
    element("place").textContent = `${shown.number + 1} / ${shown.count}`;
    element("labelled").textContent = `${shown.labelled} labelled`;
    element("share").style.width = `${(100 * shown.labelled) / shown.count}%`;
    element("known").replaceChildren(...shown.doors.map((value) => make("option", { value })));
    element("plot").classList.toggle("broken", Boolean(shown.error));
    for (const button of document.querySelectorAll(".accept")) button.hidden = !shown.proposed.length;
    const note = shown.error ?? (shown.note || (shown.proposed.length ? `hardly changed since ${shown.proposed_from}` : shown.labelled_before ? "labelled before" : ""));
    element("note").textContent = note;
    element("note").classList.toggle("warn", Boolean(shown.error || shown.note));
    history.replaceState(null, "", `#${number + 1}`);
    doors = shown.error ? [] : doorsOf(shown);
    selected = null;
    order();
    if (shown.error) {
      for (const id of ["picture", "cloud"]) element(id).hidden = true;
      element("doors").replaceChildren();
      element("name").textContent = shown.name;
      return say("This frame cannot be read. Go on with the right arrow.", true);
    }
    say("");
    cloud = clouds.decode(shown.cloud);
    layer = { cloud, size: 2, ...clouds.byHeight(cloud, shown.floor_z_m) };
    plan.show(shown, cloud);
    select(doors.find((door) => isAsked(door) && !door.state) ?? doors.find(isAsked) ?? null);
    setView(view === "cloud" || shown.pictures[view] ? view : Object.keys(shown.pictures)[0] ?? "cloud");
    list();
    element("name").textContent = shown.name;
    return null;
  }

  const go = (number) => (number < 0 || number >= frame.count ? say(number < 0 ? "This is the first frame." : "This is the last frame.") : load(number));
  const advance = () => (frame.number + 1 < frame.count ? load(frame.number + 1) : load(frame.number).then(() => { isRunning = false; say("This is the last frame."); }));

  // ---- labels -------------------------------------------------------------------------------------------------
  async function save(labels, then) {
    const { status, error } = await request(`frames/${frame.number}`, { labels, overwrite: pending === "confirmed" });
    pending = null;
    if (status === 409) {
      pending = () => { pending = "confirmed"; return save(labels, then); };
      const before = frame.labels.map(({ state }) => stateWords(state)).join(", ");
      return say(`Labelled before as ${before}. Enter changes it, Esc keeps it.`, true);
    }
    if (status !== 200) return say(`Not saved: ${error}`, true);
    return then?.();
  }

  const labelsOfDoors = () => doors.filter(({ state }) => state).map(({ state, door, place }) => ({ state, door, place }));
  const saveFrame = (state) => save([{ state, door: selected?.door ?? "", place: null }], advance);

  // Go on with the next door that has no state, or with the next frame.
  function goOn() {
    const next = doors.find((door) => isAsked(door) && !door.state);
    const labels = labelsOfDoors();
    if (!next) return labels.length ? save(labels, advance) : saveFrame("no_door");
    select(next);
    return labels.length ? save(labels) : null;
  }

  function setState(state) {
    if (!selected) {
      if (asked !== state) {
        asked = state;
        return say(`No door is chosen: choose one with Tab or draw one. The same key again labels the whole frame ${stateWords(state)}.`, true);
      }
      return saveFrame(state);
    }
    if (selected.kind === "unlikely") selected.kind = "found";
    selected.state = state;
    order();
    return goOn();
  }

  function noDoor() {
    if (selected) doors = doors.filter((door) => door !== selected);
    selected = null;
    order();
    return goOn();
  }

  const cannotTell = () => (labelsOfDoors().length && selected ? setState("unknown") : saveFrame("unknown"));

  function accept() {
    if (typeof pending === "function") return pending();
    if (!frame.proposed.length) return say("Nothing is proposed here.");
    for (const door of doors) if (door.kind === "proposed") door.state ??= door.proposed;
    const whole = frame.proposed.filter(({ place }) => !place);
    return save([...whole, ...labelsOfDoors()], advance);
  }

  // Accept until the view changes or a key is pressed.
  async function acceptAll() {
    isRunning = true;
    while (isRunning && frame.proposed.length && !pending) await accept();
    isRunning = false;
  }

  async function undo() {
    const { number, error } = await request("undo", {});
    return number === undefined || number === null ? say(error ?? "Nothing to undo.") : load(number);
  }

  function edited(door) {
    redraw();
    clearTimeout(editTimer);
    if (door.kind === "unlikely") door.kind = "drawn";
    order();
    if (door.state) return save(labelsOfDoors());
    return null;
  }

  function edit(change) {
    if (!selected) return;
    const door = selected;
    door.place = change(door.place);
    if (door.kind === "unlikely") door.kind = "drawn";
    redraw();
    clearTimeout(editTimer);
    if (door.state) editTimer = setTimeout(() => act(() => edited(door)), EDIT_MS);
  }

  // ---- keys ---------------------------------------------------------------------------------------------------
  function cycle(step) {
    if (doors.length) select(doors[(doors.indexOf(selected) + step + doors.length) % doors.length]);
  }

  function nextView() {
    const views = [...Object.keys(frame.pictures), "cloud"];
    setView(views[(views.indexOf(view) + 1) % views.length]);
  }

  const nameField = element("door");
  function editName() {
    if (!selected) return say("No door is chosen: choose one with Tab or draw one.");
    nameField.value = selected.door || lastName;
    nameField.focus();
    return nameField.select();
  }

  function setName() {
    const door = selected;
    const name = nameField.value.trim();
    if (!door || door.door === name) return null;
    [door.door, lastName] = [name, name || lastName];
    redraw();
    return door.state ? save(labelsOfDoors()) : null;
  }

  const actions = {
    c: () => setState("closed"), s: () => setState("semi_open"), o: () => setState("open"),
    n: noDoor, x: cannotTell, Enter: accept, "Shift+Enter": acceptAll, z: undo,
    Escape: () => (pending ? load(frame.number) : select(null)),
    ArrowLeft: () => go(frame.number - 1), ArrowRight: () => go(frame.number + 1),
    Home: () => go(0), End: () => go(frame.count - 1),
    Tab: () => cycle(1), "Shift+Tab": () => cycle(-1), v: nextView, d: editName,
    "Shift+ArrowLeft": () => edit((place) => labelViews.shifted(place, MOVE_M)),
    "Shift+ArrowRight": () => edit((place) => labelViews.shifted(place, -MOVE_M)),
    "Shift+ArrowUp": () => edit((place) => ({ ...place, width_m: Math.min(3, place.width_m + MOVE_M) })),
    "Shift+ArrowDown": () => edit((place) => ({ ...place, width_m: Math.max(0.4, place.width_m - MOVE_M) })),
    ",": () => edit((place) => labelViews.turned(place, TURN_DEG)),
    ".": () => edit((place) => labelViews.turned(place, -TURN_DEG)),
  };
  const ALWAYS = new Set(["ArrowLeft", "ArrowRight", "Home", "End", "z"]); // also in a frame that cannot be read

  // One thing after the other: keys that are pressed while a label is being saved do not get lost.
  let queue = Promise.resolve();
  function act(action) {
    queue = queue.then(action).catch((error) => say(String(error), true));
    return queue;
  }

  function press(key) {
    if (isRunning) { isRunning = false; return; }
    const action = actions[key];
    act(() => (action && frame && (!frame.error || ALWAYS.has(key)) ? action() : null));
  }

  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey && event.key.toLowerCase() === "z") {
      press("z");
      return;
    }
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target === nameField) {
      if (event.key === "Enter") nameField.blur();
      if (event.key === "Escape") nameField.value = selected?.door ?? "", nameField.blur();
      return;
    }
    const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const key = event.shiftKey && event.key.length > 1 ? `Shift+${name}` : name;
    if (!actions[key]) return;
    event.preventDefault();
    press(key);
  });
  nameField.addEventListener("blur", () => act(setName));
  document.addEventListener("click", (event) => {
    const button = event.target.closest("[data-key], [data-view]");
    if (!button) return;
    button.blur(); // Enter is a key of the page
    if (button.dataset.view) act(() => setView(button.dataset.view));
    else press(button.dataset.key);
  });
  for (const button of document.querySelectorAll("[data-state]")) button.style.setProperty("--c", data.state_colors[button.dataset.state]);

  const first = Number.parseInt(location.hash.slice(1), 10) - 1;
  act(() => load(Number.isNaN(first) ? data.start : first));
})();
