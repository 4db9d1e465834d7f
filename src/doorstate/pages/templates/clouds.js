"use strict";
// Clouds of a page: decoding, colours, and a parallel view on a canvas that can be turned.
const clouds = (() => {
  const data = JSON.parse(document.getElementById("page-data").textContent);
  const part = Object.fromEntries(data.parts.map((p) => [p.value, p]));
  const bytes = (text) => Uint8Array.from(atob(text), (character) => character.charCodeAt(0));

  // ---- decoding --------------------------------------------------------------------------------------------
  // Cloud as { count, xyz: coordinates in metres, point after point, parts }.
  function decode({ points, parts }) {
    const raw = new DataView(bytes(points).buffer);
    const xyz = Float32Array.from({ length: raw.byteLength / 2 }, (_, k) => raw.getInt16(2 * k, true) / 1000);
    return { count: xyz.length / 3, xyz, parts: parts && bytes(parts) };
  }

  function channelsOf(entry) {
    const raw = new DataView(bytes(entry.channels).buffer);
    return Float32Array.from({ length: raw.byteLength / 2 }, (_, i) => raw.getUint16(2 * i, true) / data.channel_steps);
  }

  // ---- colours: one [r, g, b] a point ------------------------------------------------------------------------
  const HEAT = [[0, "#9aa3ae"], [0.3, "#f2b632"], [0.65, "#ee6a1f"], [1, "#d3114f"]];
  const VIRIDIS = [[0, "#440154"], [0.25, "#3b528b"], [0.5, "#21918c"], [0.75, "#5ec962"], [1, "#fde725"]];
  const rgb = (hex) => [1, 3, 5].map((k) => Number.parseInt(hex.slice(k, k + 2), 16));
  const gradient = (stops) => `linear-gradient(to right, ${stops.map(([at, color]) => `${color} ${100 * at}%`).join(", ")})`;

  function ramp(stops) {
    const exact = stops.map(([at, color]) => [at, rgb(color)]);
    return (share) => {
      const k = Math.max(1, exact.findIndex(([at]) => share <= at));
      const [[from, low], [to, high]] = [exact[k - 1], exact[k]];
      return low.map((v, i) => Math.round(v + ((high[i] - v) * (share - from)) / (to - from)));
    };
  }
  const [heat, viridis] = [ramp(HEAT), ramp(VIRIDIS)];
  const clamp = (value) => Math.min(1, Math.max(0, value));

  // Value below which a share of the values lies.
  function quantile(values, share) {
    const sorted = Float32Array.from(values).sort();
    return sorted[Math.round(share * (sorted.length - 1))] ?? 0;
  }

  const heights = (cloud) => Float32Array.from({ length: cloud.count }, (_, i) => cloud.xyz[3 * i + 2]);

  // Lowest and highest height, without the outermost hundredth, in which outliers lie.
  function heightRange(cloud) {
    const z = heights(cloud);
    return [quantile(z, 0.01), quantile(z, 0.99)];
  }

  const metresAbove = (floor, z) => (Math.round(10 * (z - floor)) / 10 || 0).toFixed(1); // without a minus before 0.0

  function byHeight(cloud, floor = 0) {
    const [low, high] = heightRange(cloud);
    return {
      colors: Array.from(heights(cloud), (z) => viridis(clamp((z - low) / (high - low || 1)))),
      legend: [{ name: "height above the floor", gradient: gradient(VIRIDIS), low: metresAbove(floor, low), high: `${metresAbove(floor, high)} m` }],
    };
  }

  function byPart(cloud) {
    const present = [...new Set(cloud.parts)].sort((a, b) => a - b).map((value) => part[value]);
    return {
      colors: Array.from(cloud.parts, (value) => rgb(part[value].color)),
      legend: present.map(({ name, color }) => ({ name, color })),
    };
  }

  function byChannels(channels) {
    const high = quantile(channels.filter((value) => value > 0), 0.98) || 1;
    return {
      colors: Array.from(channels, (value) => heat(clamp(value / high))),
      sizes: Array.from(channels, (value) => 1 + 0.7 * Math.sqrt(clamp(value / high))),
      legend: [{ name: "channels of the global feature", gradient: gradient(HEAT), low: "0", high: `${high.toFixed(0)} or more` }],
    };
  }

  const detectionColor = (name) => data.detection_colors[name] || data.detection_colors.edge;

  // ---- view --------------------------------------------------------------------------------------------------
  // Directions on the screen for an eye that is turned by `turn` to the left of the x axis and raised by `rise`.
  function axes({ turn, rise }) {
    const [c, s, up, level] = [Math.cos(turn), Math.sin(turn), Math.sin(rise), Math.cos(rise)];
    return { right: [s, -c, 0], up: [up * c, up * s, level], away: [level * c, level * s, -up] };
  }
  const dot = (p, d) => p[0] * d[0] + p[1] * d[1] + p[2] * d[2];

  // Width and height on the screen of what is to be seen, and the point in its middle, about which the view turns.
  // Outliers do not make the door small.
  function extent({ layers, lines }, { right, up, away }) {
    const [across, upwards, deep] = [right, up, away].map((direction) => {
      const values = layers.flatMap(({ cloud: { xyz, count } }) => Array.from({ length: count }, (_, i) =>
        xyz[3 * i] * direction[0] + xyz[3 * i + 1] * direction[1] + xyz[3 * i + 2] * direction[2]));
      const corners = lines.flatMap(({ points }) => points.map((p) => dot(p, direction)));
      const ends = values.length ? [0.005, 0.995].map((share) => quantile(values, share)) : [];
      const slack = 0.25 * (ends[1] - ends[0]);
      if (values.length) ends.push(Math.max(quantile(values, 0), ends[0] - slack), Math.min(quantile(values, 1), ends[1] + slack));
      const [low, high] = [Math.min(...ends, ...corners), Math.max(...ends, ...corners)];
      return { middle: (low + high) / 2, size: high - low || 1 };
    });
    const pivot = [0, 1, 2].map((k) => across.middle * right[k] + upwards.middle * up[k] + deep.middle * away[k]);
    return { width: across.size, height: upwards.size, pivot };
  }

  // Draw points into an image, the nearest on top.
  function drawPoints(pen, layers, project, scale) {
    const { width, height } = pen.canvas;
    const image = pen.createImageData(width, height);
    const pixels = new Uint32Array(image.data.buffer);
    const nearest = new Float32Array(width * height).fill(Infinity);
    for (const { cloud: { xyz, count }, colors, sizes, size, opacity = 1 } of layers) {
      const alpha = Math.round(255 * opacity) << 24;
      for (let i = 0; i < count; i += 1) {
        const [u, v, depth] = project(xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2]);
        const side = Math.max(1, Math.round(size * scale * (sizes ? sizes[i] : 1)));
        const [left, top] = [Math.round(u - side / 2), Math.round(v - side / 2)];
        const [r, g, b] = colors[i];
        const color = alpha | (b << 16) | (g << 8) | r;
        for (let y = Math.max(0, top); y < Math.min(height, top + side); y += 1) {
          for (let x = Math.max(0, left); x < Math.min(width, left + side); x += 1) {
            const at = y * width + x;
            if (depth < nearest[at]) [nearest[at], pixels[at]] = [depth, color];
          }
        }
      }
    }
    pen.putImageData(image, 0, 0);
  }

  function drawLines(pen, lines, project, scale) {
    const { ink, card } = { ink: getComputedStyle(pen.canvas).color, card: getComputedStyle(document.documentElement).getPropertyValue("--card") };
    pen.font = `600 ${12 * scale}px system-ui, sans-serif`;
    pen.lineJoin = pen.lineCap = "round";
    for (const { points, color = ink, width = 2, label, side = 1, faint } of lines) {
      const places = points.map((p) => project(...p));
      const path = new Path2D();
      if (places.length === 1) path.arc(places[0][0], places[0][1], 2.5 * scale, 0, 2 * Math.PI);
      else places.forEach(([u, v], k) => (k ? path.lineTo(u, v) : path.moveTo(u, v)));
      pen.globalAlpha = faint ? 0.45 : 1;
      if (!faint) { // a pale edge keeps lines legible over points
        [pen.strokeStyle, pen.lineWidth] = [card, (width + 2) * scale];
        pen.stroke(path);
      }
      [pen.strokeStyle, pen.fillStyle, pen.lineWidth] = [color, color, width * scale];
      if (places.length === 1) pen.fill(path);
      else pen.stroke(path);
      pen.globalAlpha = 1;
      if (!label) continue;
      const [u, v] = places[places.length - 1];
      [pen.strokeStyle, pen.lineWidth, pen.fillStyle] = [card, 3 * scale, color];
      pen.textAlign = side > 0 ? "start" : "end";
      const [room, at] = [pen.measureText(label).width + 3 * scale, u + side * 7 * scale];
      const isSeen = u >= 0 && u <= pen.canvas.width; // what lies outside has no label at the edge
      const inside = side > 0 ? Math.min(at, pen.canvas.width - room) : Math.max(at, room);
      for (const write of ["strokeText", "fillText"]) pen[write](label, isSeen ? inside : at, v + 4 * scale);
    }
  }

  // The three axes in a corner, where nothing clips them: x forward, y left, z up, in the colours of ROS.
  function drawAxes(pen, { right, up, away }, scale) {
    const [length, u0, v0] = [26 * scale, 44 * scale, pen.canvas.height - 36 * scale];
    const arms = [["x", "#d62728"], ["y", "#2ca02c"], ["z", "#1f77b4"]].map(([name, color], k) => ({ name, color, k }));
    [pen.lineWidth, pen.font, pen.textAlign, pen.textBaseline] = [2.5 * scale, `600 ${11 * scale}px system-ui, sans-serif`, "center", "middle"];
    for (const { name, color, k } of arms.sort((a, b) => away[b.k] - away[a.k])) {
      const [du, dv] = [length * right[k], -length * up[k]];
      pen.strokeStyle = pen.fillStyle = color;
      pen.beginPath();
      pen.moveTo(u0, v0);
      pen.lineTo(u0 + du, v0 + dv);
      pen.stroke();
      pen.fillText(name, u0 + 1.4 * du, v0 + 1.4 * dv);
    }
    pen.textBaseline = "alphabetic";
  }

  const HOME = (turn) => ({ turn, rise: data.elevation, zoom: 1, shift: [0, 0] });

  // View of a scene on a canvas: { show(scene), turnable(), pointAt(x, y), redraw() }; the eye starts right behind the
  // camera, or beside it by `turn`. A scene is { layers, lines }: layers of points
  // { cloud, colors, size, sizes, opacity } and lines { points, color, width, label, side, faint }, with a margin in pixels.
  function view(canvas, turn = 0) {
    const pen = canvas.getContext("2d");
    let [scene, eye, project, fit, isDue] = [null, HOME(turn), null, null, false];

    function draw() {
      isDue = false;
      const scale = window.devicePixelRatio || 1;
      const [width, height] = [Math.round(canvas.clientWidth * scale), Math.round(canvas.clientHeight * scale)];
      if (!scene || !width || !height) return;
      if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
      pen.clearRect(0, 0, width, height);
      fit ??= extent(scene, axes(HOME(turn)));
      const directions = axes(eye);
      const margin = scene.margin * scale;
      const zoom = eye.zoom * Math.min((width - 2 * margin) / fit.width, (height - 2 * margin) / fit.height);
      const { right: r, up: u, away: a } = directions;
      const u0 = width / 2 + eye.shift[0] * scale - zoom * dot(fit.pivot, r);
      const v0 = height / 2 + eye.shift[1] * scale + zoom * dot(fit.pivot, u);
      project = (x, y, z) => [
        u0 + zoom * (x * r[0] + y * r[1] + z * r[2]),
        v0 - zoom * (x * u[0] + y * u[1] + z * u[2]),
        x * a[0] + y * a[1] + z * a[2],
      ];
      drawPoints(pen, scene.layers, project, scale * Math.max(1, Math.min(width, height) / (450 * scale)));
      drawLines(pen, scene.lines, project, scale);
      if (scene.axes) drawAxes(pen, directions, scale);
    }

    const schedule = () => {
      if (isDue) return;
      isDue = true;
      requestAnimationFrame(draw);
    };

    function turnable() {
      canvas.style.touchAction = "none";
      canvas.classList.add("turnable");
      const pointers = new Map();
      const spread = () => {
        const [p, q] = [...pointers.values()];
        return Math.hypot(p.x - q.x, p.y - q.y);
      };
      const zoomBy = (factor) => { eye.zoom = Math.min(40, Math.max(0.3, eye.zoom * factor)); };
      canvas.addEventListener("pointerdown", (event) => {
        canvas.setPointerCapture(event.pointerId);
        pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      });
      canvas.addEventListener("pointermove", (event) => {
        const last = pointers.get(event.pointerId);
        if (!last) return;
        const [dx, dy] = [event.clientX - last.x, event.clientY - last.y];
        const before = pointers.size === 2 ? spread() : 0;
        pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
        if (pointers.size === 2) {
          zoomBy(spread() / (before || 1));
          eye.shift = [eye.shift[0] + dx / 2, eye.shift[1] + dy / 2];
        } else if (event.shiftKey || event.buttons & 6) {
          eye.shift = [eye.shift[0] + dx, eye.shift[1] + dy];
        } else {
          eye.turn += dx / 180;
          eye.rise = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, eye.rise + dy / 180));
        }
        schedule();
      });
      for (const kind of ["pointerup", "pointercancel"]) {
        canvas.addEventListener(kind, (event) => pointers.delete(event.pointerId));
      }
      canvas.addEventListener("wheel", (event) => {
        event.preventDefault();
        zoomBy(Math.exp(-event.deltaY / 600));
        schedule();
      }, { passive: false });
      canvas.addEventListener("contextmenu", (event) => event.preventDefault());
      canvas.addEventListener("dblclick", () => { eye = HOME(turn); schedule(); });
    }

    // Point under the pointer, within a few pixels: { x, y, z, u, v }, or null.
    function pointAt(clientX, clientY, reach = 8) {
      if (!project) return null;
      const { left, top } = canvas.getBoundingClientRect();
      const scale = window.devicePixelRatio || 1;
      let [best, found] = [reach * scale, null];
      for (const { cloud: { xyz, count } } of scene.layers) {
        for (let i = 0; i < count; i += 1) {
          const [x, y, z] = xyz.subarray(3 * i, 3 * i + 3);
          const [u, v] = project(x, y, z);
          const gap = Math.hypot(u - (clientX - left) * scale, v - (clientY - top) * scale);
          if (gap < best) [best, found] = [gap, { x, y, z, u: u / scale, v: v / scale }];
        }
      }
      return found;
    }

    new ResizeObserver(schedule).observe(canvas);
    const show = (next) => { [scene, fit] = [next, null]; schedule(); };
    return { show, turnable, pointAt, redraw: schedule };
  }

  // ---- previews that can be opened -------------------------------------------------------------------------
  const WIDTHS = { hinge: 4, swing: 1.5, refused: 1.5 };
  const detectionLines = (detections) =>
    detections.map(({ name, points, label }) => ({ name, points, label, color: detectionColor(name), width: WIDTHS[name] ?? 2 }));

  // Draw the canvases in buttons when they come into view; `input(button)` returns { cloud, colors, sizes, detections }.
  // A click replaces the button by a large view that can be turned.
  function previews(buttons, input) {
    const views = new Map();
    const draw = (button) => {
      const canvas = button.querySelector("canvas");
      const { cloud, colors, sizes, detections } = input(button);
      views.set(button, view(canvas));
      views.get(button).show({ layers: [{ cloud, colors, sizes, size: 2 }], lines: detectionLines(detections), margin: 8 });
    };
    const observer = new IntersectionObserver((changes) => {
      for (const { target } of changes.filter((change) => change.isIntersecting && change.target.clientWidth)) {
        observer.unobserve(target);
        draw(target);
      }
    }, { rootMargin: "300px" });
    for (const button of buttons) {
      observer.observe(button);
      button.addEventListener("click", () => {
        if (!views.has(button)) draw(button);
        const large = document.createElement("div");
        large.className = "cloud large";
        large.append(button.querySelector("canvas"));
        button.replaceWith(large);
        views.get(button).turnable();
      });
    }
  }

  return { data, decode, channelsOf, byHeight, byPart, byChannels, heights, quantile, detectionLines, view, previews };
})();
