"use strict";
// Clouds of a page: data, decoding, and plots by Plotly, whose text becomes a script when the first cloud needs it.
const clouds = (() => {
  const data = JSON.parse(document.getElementById("page-data").textContent);
  const part = Object.fromEntries(data.parts.map((p) => [p.value, p]));
  const bytes = (text) => Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  const EYE = 1.55; // distance of the eye from the middle, in Plotly's units; the cloud fills the plot
  const MUTED = "rgba(128,128,128,.45)";
  const HEAT = [[0, "#9aa3ae"], [0.3, "#f2b632"], [0.65, "#ee6a1f"], [1, "#d3114f"]];
  const pick = (values, members) => members.map((i) => values[i]);
  const detectionColor = (name) => data.detection_colors[name] || data.detection_colors.edge;

  function decode({ points, parts }) {
    const raw = new DataView(bytes(points).buffer);
    const count = raw.byteLength / 6;
    const axis = (k) => Float32Array.from({ length: count }, (_, i) => raw.getInt16(6 * i + 2 * k, true) / 1000);
    return { count, x: axis(0), y: axis(1), z: axis(2), parts: parts && bytes(parts) };
  }

  const allIndices = (cloud) => Array.from({ length: cloud.count }, (_, i) => i);

  // Trace of some points of a cloud.
  const points = (cloud, members, name, marker, hover = "") => ({
    type: "scatter3d", mode: "markers", name, marker, hovertemplate: `x %{x:.2f}, y %{y:.2f}, z %{z:.2f} m${hover}`,
    x: pick(cloud.x, members), y: pick(cloud.y, members), z: pick(cloud.z, members),
  });

  const byHeight = (cloud) =>
    [points(cloud, allIndices(cloud), "height", { size: 2, color: Array.from(cloud.z), colorscale: "Viridis" })];

  const byPart = (cloud) => [...new Set(cloud.parts)].sort((a, b) => a - b).map((value) => {
    const members = allIndices(cloud).filter((i) => cloud.parts[i] === value);
    return points(cloud, members, part[value].name, { size: 2, color: part[value].color });
  });

  function channelsOf(entry) {
    const raw = new DataView(bytes(entry.channels).buffer);
    return Float32Array.from({ length: raw.byteLength / 2 }, (_, i) => raw.getUint16(2 * i, true) / data.channel_steps);
  }

  function mostChannels(channels) {
    const seen = Array.from(channels).filter((value) => value > 0).sort((a, b) => a - b);
    return seen[Math.floor(0.98 * seen.length)] || 1;
  }

  function byChannels(cloud, channels) {
    const all = allIndices(cloud);
    const [winners, rest] = [all.filter((i) => channels[i] > 0), all.filter((i) => !(channels[i] > 0))];
    const values = winners.map((i) => channels[i]);
    const high = mostChannels(channels);
    const used = points(cloud, winners, "used", {
      size: values.map((value) => 2.5 + 4 * Math.sqrt(Math.min(1, value / high))), line: { width: 0 },
      color: values, colorscale: HEAT, cmin: 0, cmax: high, showscale: true,
      colorbar: { title: { text: "channels", side: "top" }, thickness: 10, len: 0.6, outlinewidth: 0 },
    }, "<br>%{marker.color:.1f} channels");
    return [points(cloud, rest, "not used", { size: 1.5, color: MUTED }), used];
  }

  // Axes of the camera, one metre long, in the colours of ROS: red forward, green left, blue up.
  const camera = () => ({
    type: "scatter3d", mode: "lines+text", name: "camera", showlegend: false, hovertemplate: "camera",
    x: [0, 1, null, 0, 0, null, 0, 0], y: [0, 0, null, 0, 1, null, 0, 0], z: [0, 0, null, 0, 0, null, 0, 1],
    text: ["camera", "", "", "", "1 m"], textposition: "bottom center",
    line: { width: 5, color: ["#d62728", "#d62728", 0, "#2ca02c", "#2ca02c", 0, "#1f77b4", "#1f77b4"] },
  });

  function detection({ name, points }, title) {
    const color = detectionColor(name);
    return {
      type: "scatter3d", mode: points.length === 1 ? "markers" : "lines", name: title, hovertemplate: title,
      x: points.map((p) => p[0]), y: points.map((p) => p[1]), z: points.map((p) => p[2]),
      line: { color, width: 5 }, marker: { size: 4, color },
    };
  }

  // Layout in the colours of the page; the eye is behind and above the camera, as in Figure 2.
  function layout() {
    const ink = getComputedStyle(document.body).color;
    const hidden = { visible: false };
    const eye = { x: -EYE * Math.cos(data.elevation), y: 0, z: EYE * Math.sin(data.elevation) };
    return {
      margin: { l: 0, r: 0, t: 0, b: 0 }, paper_bgcolor: "rgba(0,0,0,0)", font: { color: ink },
      modebar: { bgcolor: "rgba(0,0,0,0)", color: ink },
      legend: { orientation: "h", itemsizing: "constant", y: 0.02 },
      scene: { aspectmode: "data", camera: { eye }, xaxis: hidden, yaxis: hidden, zaxis: hidden },
    };
  }

  const partColors = (cloud) => Array.from(cloud.parts, (value) => part[value].color);

  function channelColors(channels) {
    const high = mostChannels(channels);
    const rgb = (hex) => [1, 3, 5].map((k) => Number.parseInt(hex.slice(k, k + 2), 16));
    return Array.from(channels, (value) => {
      if (!(value > 0)) return MUTED;
      const share = Math.min(1, value / high);
      const k = Math.max(1, HEAT.findIndex(([stop]) => share <= stop));
      const [[from, low], [to, top]] = [HEAT[k - 1], HEAT[k]];
      const [a, b] = [rgb(low), rgb(top)];
      return `rgb(${a.map((v, i) => Math.round(v + ((b[i] - v) * (share - from)) / (to - from)))})`;
    });
  }

  function heightColors({ z }) {
    let low = Infinity, high = -Infinity;
    for (const value of z) { low = Math.min(low, value); high = Math.max(high, value); }
    return Array.from(z, (value) => `hsl(${260 - (200 * (value - low)) / (high - low || 1)} 70% 42%)`);
  }

  // Draw a cloud on a canvas in the same oblique view, near points last.
  function preview(canvas, cloud, colors, detections) {
    const [down, level] = [Math.sin(data.elevation), Math.cos(data.elevation)];
    const [forward, right, up] = [[level, 0, -down], [0, -1, 0], [down, 0, level]];
    const along = (d) => Float32Array.from(cloud.x, (x, i) => x * d[0] + cloud.y[i] * d[1] + cloud.z[i] * d[2]);
    const [u, v, depth] = [along(right), along(up), along(forward)];
    const scale = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth * scale, canvas.clientHeight * scale];
    [canvas.width, canvas.height] = [width, height];
    // Far outliers must not make the door small.
    const span = (values) => {
      const sorted = values.slice().sort();
      const [low, high] = [0.05, 0.95].map((share) => sorted[Math.round(share * (sorted.length - 1))]);
      const margin = 0.2 * (high - low);
      return [Math.max(sorted[0], low - margin), Math.min(sorted[sorted.length - 1], high + margin)];
    };
    const [[left, rightmost], [bottom, top]] = [span(u), span(v)];
    const zoom = 0.92 * Math.min(width / (rightmost - left || 1), height / (top - bottom || 1));
    const pen = canvas.getContext("2d");
    const size = Math.max(1.5 * scale, width / 260);
    for (const i of Array.from(depth.keys()).sort((p, q) => depth[q] - depth[p])) {
      pen.fillStyle = colors[i];
      pen.fillRect(
        width / 2 + zoom * (u[i] - (left + rightmost) / 2), height / 2 - zoom * (v[i] - (bottom + top) / 2), size, size,
      );
    }
    const dot = (p, d) => p[0] * d[0] + p[1] * d[1] + p[2] * d[2];
    const place = (p) => [
      width / 2 + zoom * (dot(p, right) - (left + rightmost) / 2), height / 2 - zoom * (dot(p, up) - (bottom + top) / 2),
    ];
    pen.lineWidth = 1.5 * scale;
    for (const { name, points } of detections) {
      pen.strokeStyle = pen.fillStyle = detectionColor(name);
      pen.beginPath();
      if (points.length === 1) pen.arc(...place(points[0]), 2.5 * scale, 0, 2 * Math.PI), pen.fill();
      else points.forEach((p, k) => (k ? pen.lineTo(...place(p)) : pen.moveTo(...place(p)))), pen.stroke();
    }
  }

  function plotly() {
    if (!window.Plotly) {
      const script = document.createElement("script");
      script.textContent = document.getElementById("plotly").textContent;
      document.head.append(script);
    }
    return window.Plotly;
  }

  // Draw canvases when they come into view; `input(canvas)` returns { cloud, colors, detections }.
  function previewWhenVisible(canvases, input) {
    const observer = new IntersectionObserver((changes) => {
      for (const { target } of changes.filter((change) => change.isIntersecting && change.target.clientWidth)) {
        observer.unobserve(target);
        const { cloud, colors, detections } = input(target);
        preview(target, cloud, colors, detections);
      }
    }, { rootMargin: "300px" });
    canvases.forEach((canvas) => observer.observe(canvas));
  }

  const MAX_PLOTS = 4; // browsers drop the oldest WebGL contexts at about eight
  const open = [];

  function close({ element, plot }) {
    window.Plotly.purge(plot);
    element.hidden = false;
    plot.remove();
  }

  // Replace an element by a 3D plot; the oldest of too many plots is closed.
  function replaceByPlot(element, traces) {
    const plot = document.createElement("div");
    plot.className = "live";
    element.after(plot);
    element.hidden = true;
    plotly().newPlot(plot, traces, layout(), config).then(() => {
      open.push({ element, plot });
      if (open.length > MAX_PLOTS) close(open.shift());
    });
  }

  const config = { displaylogo: false, responsive: true };
  return {
    data, decode, byHeight, byPart, channelsOf, byChannels, partColors, heightColors, channelColors, camera, detection,
    previewWhenVisible, replaceByPlot, layout, plotly, config,
  };
})();
