// Views of a frame in which doors are drawn, chosen and dragged: its picture, and the plan from above.
const labelViews = (() => {
  const HEIGHT_M = 2; // of the drawing of a door
  const [NEAR_PX, STEM_M, LEAST_M] = [9, 0.45, 0.3];
  const { state_colors: stateColors } = clouds.data;
  const radians = (degrees) => (degrees * Math.PI) / 180;

  // ---- places: x and y in metres, along is to the left as the camera sees it -----------------------------------
  const along = ({ yaw_deg }) => [Math.cos(radians(yaw_deg)), Math.sin(radians(yaw_deg))];
  const at = ({ x_m, y_m }, [c, s], shift, towards = 0) => [x_m + shift * c - towards * s, y_m + shift * s + towards * c];
  const ends = (place) => [1, -1].map((side) => at(place, along(place), (side * place.width_m) / 2));
  const shifted = (place, shift) => {
    const [x_m, y_m] = at(place, along(place), shift);
    return { ...place, x_m, y_m };
  };
  // The end at a side, 1 or -1, moved to a distance along the wall from the middle; the other end stays.
  const stretched = (place, side, reach) => {
    const width_m = Math.min(3, Math.max(0.4, side * reach + place.width_m / 2));
    return { ...shifted(place, (side * (width_m - place.width_m)) / 2), width_m };
  };
  const turned = (place, degrees) => ({ ...place, yaw_deg: place.yaw_deg + degrees });
  // A door between two points, with its wall seen from the camera.
  const between = ([ax, ay], [bx, by], floor_z_m) => {
    const middle = { x_m: (ax + bx) / 2, y_m: (ay + by) / 2 };
    const yaw = Math.atan2(by - ay, bx - ax);
    const faces = middle.x_m * Math.sin(yaw) - middle.y_m * Math.cos(yaw) > 0;
    return { ...middle, yaw_deg: (yaw * 180) / Math.PI + (faces ? 0 : 180), width_m: Math.hypot(bx - ax, by - ay), floor_z_m };
  };
  const corners = (place) => {
    const [left, right] = ends(place);
    return [[left, 0], [left, HEIGHT_M], [right, HEIGHT_M], [right, 0]].map(([[x, y], z]) => [x, y, place.floor_z_m + z]);
  };

  // ---- drawing ------------------------------------------------------------------------------------------------
  const shownState = (door) => door.state ?? door.proposed;
  const color = (door, otherwise) => stateColors[shownState(door)] ?? (door.state === "unknown" ? "#8a93a0" : otherwise);
  const words = (door) => (shownState(door) ? `${shownState(door).replace("_", "-")}${door.state ? "" : "?"}` : "");
  const text = (door) => `${door.number} ${words(door)}`.trim();

  // Context of a canvas in CSS pixels, cleared.
  function fresh(canvas) {
    const scale = window.devicePixelRatio || 1;
    const size = [canvas.clientWidth, canvas.clientHeight];
    [canvas.width, canvas.height] = size.map((side) => Math.round(side * scale));
    const pen = canvas.getContext("2d");
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    return { pen, width: size[0], height: size[1] };
  }

  function trace(pen, points, isClosed) {
    pen.beginPath();
    points.forEach(([u, v], k) => (k ? pen.lineTo(u, v) : pen.moveTo(u, v)));
    if (isClosed) pen.closePath();
  }

  // Stroke the path of a door; a dark edge keeps it legible over pictures.
  function stroke(pen, door, isSelected, ink) {
    pen.lineJoin = "round";
    if (!ink) {
      [pen.strokeStyle, pen.lineWidth] = ["rgb(0 0 0 / 65%)", isSelected ? 6 : 4.5];
      pen.stroke();
    }
    pen.setLineDash(door.kind === "unlikely" ? [4, 6] : door.proposed && !door.state ? [10, 7] : []);
    [pen.strokeStyle, pen.lineWidth] = [color(door, ink ?? "#ffffff"), isSelected ? 3.5 : 2.2];
    pen.stroke();
    pen.setLineDash([]);
  }

  function handle(pen, [u, v]) {
    pen.beginPath();
    pen.arc(u, v, 5, 0, 2 * Math.PI);
    [pen.fillStyle, pen.strokeStyle, pen.lineWidth] = ["#ffffff", "#1c2430", 1.5];
    pen.fill();
    pen.stroke();
  }

  function tag(pen, door, u, v, width, down = 0) {
    const label = text(door);
    if (!label) return;
    pen.font = "600 13px system-ui, sans-serif";
    const room = pen.measureText(label).width + 12;
    const left = Math.min(Math.max(u - room / 2, 2), width - room - 2);
    const top = Math.max(v - 22 + down, 2);
    pen.beginPath();
    pen.roundRect(left, top, room, 19, 5);
    pen.fillStyle = stateColors[shownState(door)] ?? "#1c2430";
    pen.fill();
    pen.fillStyle = "#ffffff";
    pen.fillText(label, left + 6, top + 14);
  }

  const distance = ([u, v], [a, b], [c, d]) => {
    const length = Math.hypot(c - a, d - b) || 1;
    const t = Math.min(1, Math.max(0, ((u - a) * (c - a) + (v - b) * (d - b)) / length ** 2));
    return Math.hypot(u - a - t * (c - a), v - b - t * (d - b));
  };
  // Doors to draw, the selected one last; unlikely ones only while they are selected.
  const shownDoors = (host) => host.doors().filter((door) => door.kind !== "unlikely" || door === host.selected())
    .sort((a, b) => (a === host.selected()) - (b === host.selected()));
  const isInside = ([u, v], polygon) => polygon.reduce((inside, [a, b], k) => {
    const [c, d] = polygon[(k + 1) % polygon.length];
    return (b > v) !== (d > v) && u < a + ((v - b) * (c - a)) / (d - b) ? !inside : inside;
  }, false);

  // Let a pointer drag what `grab(point)` returns: { move(point), end(point) }, or null.
  function draggable(canvas, grab) {
    let held = null;
    const point = (event) => [event.clientX - canvas.getBoundingClientRect().left, event.clientY - canvas.getBoundingClientRect().top];
    canvas.addEventListener("pointerdown", (event) => {
      held = event.button === 0 ? grab(point(event)) : null;
      if (held) canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => held?.move(point(event)));
    canvas.addEventListener("pointerup", (event) => {
      held?.end(point(event));
      held = null;
    });
    canvas.addEventListener("pointercancel", () => { held = null; });
  }

  // Drag of a door: `change(place, point)` returns its place for a point of the pointer.
  function doorDrag(host, door, change) {
    const start = door.place;
    let hasMoved = false;
    return {
      move(point) {
        hasMoved = true;
        door.place = change(start, point);
        host.redraw();
      },
      end: () => (hasMoved ? host.edited(door) : null),
    };
  }

  // ---- picture ------------------------------------------------------------------------------------------------
  // `host`: { doors(), selected(), select(door), edited(door), redraw(), newBox(box), newPlace(place) }.
  function picture(canvas, host) {
    let [frame, image, fit, box] = [null, null, null, null];
    const toPixel = ([x, y, z]) => {
      const m = frame.projection;
      const w = m[6] * x + m[7] * y + m[8] * z;
      return [(m[0] * x + m[1] * y + m[2] * z) / w, (m[3] * x + m[4] * y + m[5] * z) / w, w];
    };
    const onScreen = ([u, v]) => [fit.left + (u / frame.size[0]) * fit.width, fit.top + (v / frame.size[1]) * fit.height];
    const offScreen = ([u, v]) => [((u - fit.left) / fit.width) * frame.size[0], ((v - fit.top) / fit.height) * frame.size[1]];
    // Corners on the screen; null if a part of the door is behind the camera.
    function outline(door) {
      const pixels = corners(door.place).map(toPixel);
      return pixels.every(([, , w]) => w > 0.05) ? pixels.map(onScreen) : null;
    }
    // Distance along the wall of a door from its middle to the point of the wall under the pointer.
    function reach(place, point) {
      const [u, v] = offScreen(point);
      const [a, b, c, d, e, f, g, h, i] = frame.projection;
      const [A, B, C] = [e * i - f * h, c * h - b * i, b * f - c * e];
      const [D, E, F] = [f * g - d * i, a * i - c * g, c * d - a * f];
      const [x, y] = [A * u + B * v + C, D * u + E * v + F]; // of the ray, but for a factor
      const [cos, sin] = along(place);
      const t = (-sin * place.x_m + cos * place.y_m) / (-sin * x + cos * y || 1e-9);
      return (t * x - place.x_m) * cos + (t * y - place.y_m) * sin;
    }

    function draw() {
      if (!image?.complete || !canvas.clientWidth) return;
      const { pen, width, height } = fresh(canvas);
      const scale = Math.min(width / image.naturalWidth, height / image.naturalHeight);
      const [w, h] = [image.naturalWidth * scale, image.naturalHeight * scale];
      fit = { left: (width - w) / 2, top: (height - h) / 2, width: w, height: h };
      pen.drawImage(image, fit.left, fit.top, w, h);
      if (!isAligned()) return;
      pen.save();
      pen.beginPath();
      pen.rect(fit.left, fit.top, w, h);
      pen.clip();
      const shapes = shownDoors(host).map((door) => [door, outline(door)]).filter(([, shape]) => shape);
      for (const [door, shape] of shapes) {
        const isSelected = door === host.selected();
        trace(pen, shape, true);
        if (isSelected) [pen.fillStyle] = [`color-mix(in srgb, ${color(door, "#ffffff")} 18%, transparent)`], pen.fill();
        stroke(pen, door, isSelected);
        if (isSelected) [[0, 1], [2, 3]].forEach(([k, l]) => handle(pen, [(shape[k][0] + shape[l][0]) / 2, (shape[k][1] + shape[l][1]) / 2]));
      }
      for (const [door, shape] of shapes) tag(pen, door, (shape[1][0] + shape[2][0]) / 2, Math.min(shape[1][1], shape[2][1]), width);
      if (box) [pen.strokeStyle, pen.lineWidth] = ["#ffffff", 2], pen.setLineDash([5, 4]), pen.strokeRect(...box[0], box[1][0] - box[0][0], box[1][1] - box[0][1]);
      pen.restore();
    }

    const isAligned = () => frame?.projection && Math.abs(image.naturalWidth / image.naturalHeight / (frame.size[0] / frame.size[1]) - 1) < 0.02;

    draggable(canvas, (point) => {
      if (!fit || !isAligned()) return null;
      const chosen = host.selected();
      const shape = chosen && outline(chosen);
      if (shape) {
        const side = [[1, 0, 1], [-1, 2, 3]].find(([, k, l]) => distance(point, shape[k], shape[l]) < NEAR_PX);
        if (side) return doorDrag(host, chosen, (place, to) => stretched(place, side[0], reach(place, to)));
      }
      const hit = shownDoors(host).reverse().find((door) => { const polygon = outline(door); return polygon && isInside(point, polygon); });
      if (hit) {
        host.select(hit);
        const from = reach(hit.place, point);
        return doorDrag(host, hit, (place, to) => shifted(place, reach(place, to) - from));
      }
      return {
        move(to) { box = [point, to]; host.redraw(); },
        end(to) {
          box = null;
          const [[u0, v0], [u1, v1]] = [point, to].map(offScreen).map(([u, v]) => [Math.min(frame.size[0], Math.max(0, u)), Math.min(frame.size[1], Math.max(0, v))]);
          if (Math.abs(to[0] - point[0]) > 12 && Math.abs(to[1] - point[1]) > 12) host.newBox([u0, v0, u1, v1]);
          host.redraw();
        },
      };
    });
    new ResizeObserver(() => host.redraw()).observe(canvas);
    return {
      draw,
      show(next, source) {
        [frame, image] = [next, Object.assign(new Image(), { src: source })];
        image.onload = () => host.redraw();
      },
    };
  }

  // ---- plan ---------------------------------------------------------------------------------------------------
  function plan(canvas, host) {
    let [frame, points, fit, extent, line, ground] = [null, [], null, null, null, {}];
    const onScreen = ([x, y]) => [fit.left - fit.scale * y, fit.bottom - fit.scale * x];
    const offScreen = ([u, v]) => [(fit.bottom - v) / fit.scale, (fit.left - u) / fit.scale];
    const stem = (place) => at(place, along(place), 0, STEM_M);

    // What does not change while doors are dragged: arcs a metre apart, points, and the camera.
    function drawGround(ink, width, height, far) {
      const image = Object.assign(document.createElement("canvas"), { width: canvas.width, height: canvas.height });
      const pen = image.getContext("2d", { willReadFrequently: true }); // many small rectangles are slow on a GPU
      pen.scale(canvas.width / width, canvas.height / height);
      const style = getComputedStyle(canvas);
      [pen.strokeStyle, pen.fillStyle, pen.font] = [style.getPropertyValue("--line"), style.getPropertyValue("--soft"), "11px system-ui, sans-serif"];
      for (let metre = 1; metre <= far; metre += 1) {
        pen.beginPath();
        pen.arc(...onScreen([0, 0]), metre * fit.scale, 1.1 * Math.PI, 1.9 * Math.PI);
        pen.stroke();
        pen.fillText(`${metre} m`, ...onScreen([0.82 * metre, -0.57 * metre]).map((place, k) => place + 3 - 6 * k));
      }
      [pen.fillStyle, pen.globalAlpha] = [ink, 0.5];
      for (const point of points) pen.fillRect(...onScreen(point), 1.3, 1.3);
      pen.globalAlpha = 1;
      trace(pen, [[0.14, 0], [-0.08, 0.1], [-0.08, -0.1]].map(onScreen), true);
      pen.fill();
      return image;
    }

    function draw() {
      if (!frame || !canvas.clientWidth) return;
      const { pen, width, height } = fresh(canvas);
      const { far, left, right } = extent;
      const scale = Math.min((width - 16) / (left - right || 1), (height - 34) / (far || 1));
      fit = { scale, left: width / 2 + (scale * (left + right)) / 2, bottom: height - 20 };
      const ink = getComputedStyle(canvas).color;
      const key = [canvas.width, canvas.height, fit.scale, fit.left, ink].join();
      if (key !== ground.key) ground = { key, image: drawGround(ink, width, height, far) };
      pen.drawImage(ground.image, 0, 0, width, height);
      for (const door of shownDoors(host)) {
        const isSelected = door === host.selected();
        trace(pen, ends(door.place).map(onScreen));
        stroke(pen, door, isSelected, ink);
        if (!isSelected) continue;
        trace(pen, [[door.place.x_m, door.place.y_m], stem(door.place)].map(onScreen));
        [pen.strokeStyle, pen.lineWidth] = [ink, 1.5];
        pen.stroke();
        [...ends(door.place), stem(door.place)].forEach((place) => handle(pen, onScreen(place)));
      }
      for (const door of shownDoors(host)) tag(pen, door, ...onScreen(at(door.place, along(door.place), 0, -0.3)), width, 10);
      if (line) trace(pen, line), [pen.strokeStyle, pen.lineWidth] = [ink, 2], pen.stroke();
    }

    const isNear = (point, place) => Math.hypot(...onScreen(place).map((value, k) => value - point[k])) < NEAR_PX;
    draggable(canvas, (point) => {
      if (!fit) return null;
      const chosen = host.selected();
      if (chosen) {
        const side = ends(chosen.place).findIndex((end) => isNear(point, end));
        const reach = (place, to) => { const [[x, y], [c, s]] = [offScreen(to), along(place)]; return (x - place.x_m) * c + (y - place.y_m) * s; };
        if (side >= 0) return doorDrag(host, chosen, (place, to) => stretched(place, [1, -1][side], reach(place, to)));
        if (isNear(point, stem(chosen.place))) {
          return doorDrag(host, chosen, (place, to) => {
            const [x, y] = offScreen(to);
            return { ...place, yaw_deg: (Math.atan2(y - place.y_m, x - place.x_m) * 180) / Math.PI - 90 };
          });
        }
      }
      const hit = shownDoors(host).reverse().find((door) => distance(point, ...ends(door.place).map(onScreen)) < NEAR_PX);
      if (hit) {
        host.select(hit);
        const [x0, y0] = offScreen(point);
        return doorDrag(host, hit, (place, to) => {
          const [x, y] = offScreen(to);
          return { ...place, x_m: place.x_m + x - x0, y_m: place.y_m + y - y0 };
        });
      }
      return {
        move(to) { line = [point, to]; host.redraw(); },
        end(to) {
          line = null;
          const place = between(offScreen(point), offScreen(to), frame.floor_z_m);
          if (place.width_m >= LEAST_M) host.newPlace(place);
          host.redraw();
        },
      };
    });
    new ResizeObserver(() => host.redraw()).observe(canvas);
    return {
      draw,
      show(next, cloud) {
        [frame, points, ground] = [next, [], {}];
        for (let i = 0; i < cloud.count; i += 1) {
          const [x, y, z] = cloud.xyz.subarray(3 * i, 3 * i + 3);
          if (z > next.floor_z_m + 0.15 && z < next.floor_z_m + 2.1) points.push([x, y]);
        }
        const likely = next.candidates.filter(({ score }) => score > 0.5);
        const [forward, across] = [0, 1].map((axis) => points.map((point) => point[axis]));
        extent = {
          far: Math.max(0.5, clouds.quantile([...forward, ...next.candidates.map(({ x_m }) => x_m)], 0.95)),
          left: Math.max(0.5, clouds.quantile(across, 0.98), ...likely.map(({ y_m, width_m }) => y_m + width_m / 2)),
          right: Math.min(-0.5, clouds.quantile(across, 0.02), ...likely.map(({ y_m, width_m }) => y_m - width_m / 2)),
        };
      },
    };
  }

  // Lines of doors over the cloud in 3D.
  const lines = (host) => shownDoors(host).map((door) => {
    const shape = corners(door.place);
    const outline = [shape[2], shape[3], shape[0], shape[1], shape[2]];
    return { points: outline, color: color(door), width: door === host.selected() ? 4 : 2, label: text(door) };
  });

  return { picture, plan, lines, words, shifted, turned };
})();
