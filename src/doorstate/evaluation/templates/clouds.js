"use strict";
// The clouds of a page: its data, decoding, and 3D by Plotly, which is made a script when the first cloud needs it.
const clouds = (() => {
  const data = JSON.parse(document.getElementById("page-data").textContent);
  const part = Object.fromEntries(data.parts.map((p) => [p.value, p]));
  const bytes = (text) => Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  const pick = (values, members) => members.map((i) => values[i]);
  const shapeColor = (name) => data.shape_colors[name] || data.shape_colors.edge;

  function decode({ points, parts }) {
    const raw = new DataView(bytes(points).buffer);
    const count = raw.byteLength / 6;
    const axis = (k) => Float32Array.from({ length: count }, (_, i) => raw.getInt16(6 * i + 2 * k, true) / 1000);
    return { count, x: axis(0), y: axis(1), z: axis(2), parts: parts && bytes(parts) };
  }

  const everyPoint = (cloud) => Array.from({ length: cloud.count }, (_, i) => i);

  // Some points of a cloud; the marker says how.
  const points = (cloud, members, name, marker, hover = "") => ({
    type: "scatter3d", mode: "markers", name, marker, hovertemplate: `x %{x:.2f}, y %{y:.2f}, z %{z:.2f} m${hover}`,
    x: pick(cloud.x, members), y: pick(cloud.y, members), z: pick(cloud.z, members),
  });

  const byHeight = (cloud) =>
    [points(cloud, everyPoint(cloud), "height", { size: 2, color: Array.from(cloud.z), colorscale: "Viridis" })];

  const byPart = (cloud) => [...new Set(cloud.parts)].sort((a, b) => a - b).map((value) => {
    const members = everyPoint(cloud).filter((i) => cloud.parts[i] === value);
    return points(cloud, members, part[value].name, { size: 2, color: part[value].color });
  });

  const camera = () => ({
    type: "scatter3d", mode: "markers", name: "camera", hovertemplate: "camera",
    x: [0], y: [0], z: [0], marker: { size: 5, symbol: "diamond", color: "#d62728" },
  });

  function shape({ name, points }, title) {
    const color = shapeColor(name);
    return {
      type: "scatter3d", mode: points.length === 1 ? "markers" : "lines", name: title, hovertemplate: title,
      x: points.map((p) => p[0]), y: points.map((p) => p[1]), z: points.map((p) => p[2]),
      line: { color, width: 5 }, marker: { size: 4, color },
    };
  }

  // What does not change from cloud to cloud, in the colours of the page: from behind and above the camera, as Figure 2.
  function layout() {
    const ink = getComputedStyle(document.body).color;
    const axis = (title) => ({ title: { text: title }, color: ink, gridcolor: "rgba(128,128,128,.3)", backgroundcolor: "rgba(0,0,0,0)" });
    const { azimuth: a, elevation: e } = data.view;
    const eye = { x: -2 * Math.cos(e) * Math.cos(a), y: -2 * Math.cos(e) * Math.sin(a), z: 2 * Math.sin(e) };
    return {
      margin: { l: 0, r: 0, t: 0, b: 0 }, paper_bgcolor: "rgba(0,0,0,0)", font: { color: ink },
      modebar: { bgcolor: "rgba(0,0,0,0)", color: ink },
      legend: { orientation: "h", itemsizing: "constant", y: 0.02 },
      scene: { aspectmode: "data", camera: { eye }, xaxis: axis("forward (m)"), yaxis: axis("left (m)"), zaxis: axis("up (m)") },
    };
  }

  function plotly() {
    if (!window.Plotly) {
      const script = document.createElement("script");
      script.textContent = document.getElementById("plotly").textContent;
      document.head.append(script);
    }
    return window.Plotly;
  }

  return {
    data, part, bytes, decode, points, everyPoint, byHeight, byPart, camera, shape, shapeColor, layout, plotly,
    config: { displaylogo: false, responsive: true },
  };
})();
