"use strict";
(() => {
  const { data, part, shapeColor } = clouds;
  const LIVE_AT_ONCE = 4; // browsers drop the oldest WebGL contexts at about eight

  // ---- network filters -------------------------------------------------------------------------------------
  for (const group of document.querySelectorAll(".chips")) {
    const target = document.getElementById(group.dataset.target);
    const choose = (network) => {
      for (const button of group.children) {
        button.setAttribute("aria-pressed", String(button.dataset.choice === network));
      }
      for (const item of target.querySelectorAll("tr[data-network], .card, .answers li")) {
        item.hidden = network !== "" && !item.dataset.network.split(" ").includes(network);
      }
      target.classList.toggle("single", network !== "");
    };
    group.addEventListener("click", (event) => {
      const button = event.target.closest("button");
      if (button) choose(button.dataset.choice);
    });
    if (group.dataset.target === "strata") choose(group.children[1].dataset.choice);
  }

  // ---- clouds ----------------------------------------------------------------------------------------------
  const decode = (sample) => clouds.decode(data.clouds[sample]);

  function heightColors(z) {
    let low = Infinity, high = -Infinity;
    for (const value of z) { low = Math.min(low, value); high = Math.max(high, value); }
    return Array.from(z, (value) => `hsl(${260 - (200 * (value - low)) / (high - low || 1)} 70% 42%)`);
  }

  // What rules found in a sample: [method, { name, points }] in the order of the answers.
  const shapesOf = (sample) =>
    Object.entries(data.shapes[sample]).flatMap(([method, shapes]) => shapes.map((shape) => [method, shape]));

  // The same oblique view as Figure 2: from behind and above the camera, near points last.
  function preview(canvas, cloud, shapes) {
    const { azimuth: a, elevation: e } = data.view;
    const forward = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), -Math.sin(e)];
    const right = [Math.sin(a), -Math.cos(a), 0];
    const up = [Math.sin(e) * Math.cos(a), Math.sin(e) * Math.sin(a), Math.cos(e)];
    const along = (d) => Float32Array.from(cloud.x, (x, i) => x * d[0] + cloud.y[i] * d[1] + cloud.z[i] * d[2]);
    const [u, v, depth] = [along(right), along(up), along(forward)];
    const colors = cloud.parts ? Array.from(cloud.parts, (value) => part[value].color) : heightColors(cloud.z);
    const scale = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth * scale, canvas.clientHeight * scale];
    [canvas.width, canvas.height] = [width, height];
    const span = (values) => [Math.min(...values), Math.max(...values)];
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
    for (const [, { name, points }] of shapes) {
      pen.strokeStyle = pen.fillStyle = shapeColor(name);
      pen.beginPath();
      if (points.length === 1) pen.arc(...place(points[0]), 2.5 * scale, 0, 2 * Math.PI), pen.fill();
      else points.forEach((p, k) => (k ? pen.lineTo(...place(p)) : pen.moveTo(...place(p)))), pen.stroke();
    }
  }

  const whenSeen = new IntersectionObserver((entries) => {
    for (const entry of entries.filter((e) => e.isIntersecting && e.target.clientWidth)) {
      whenSeen.unobserve(entry.target);
      const { sample } = entry.target.closest(".card").dataset;
      preview(entry.target, decode(sample), shapesOf(sample));
    }
  }, { rootMargin: "300px" });
  document.querySelectorAll(".cloud canvas").forEach((canvas) => whenSeen.observe(canvas));

  // ---- 3D, made when asked for -----------------------------------------------------------------------------
  const live = [];

  function close(plot) {
    window.Plotly.purge(plot);
    plot.previousElementSibling.hidden = false;
    plot.remove();
  }

  function open(button) {
    const { sample } = button.closest(".card").dataset;
    const cloud = decode(sample);
    const found = shapesOf(sample).map(([method, shape]) => clouds.shape(shape, `${method}: ${shape.name}`));
    const traces = [...(cloud.parts ? clouds.byPart(cloud) : clouds.byHeight(cloud)), clouds.camera(), ...found];
    const plot = document.createElement("div");
    plot.className = "live";
    button.after(plot);
    button.hidden = true;
    clouds.plotly().newPlot(plot, traces, clouds.layout(), clouds.config).then(() => {
      live.push(plot);
      if (live.length > LIVE_AT_ONCE) close(live.shift());
    });
  }

  document.addEventListener("click", (event) => {
    const button = event.target.closest(".cloud");
    if (button) open(button);
  });
})();
