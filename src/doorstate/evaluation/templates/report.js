"use strict";
(() => {
  const { data } = clouds;
  const LIVE_AT_ONCE = 4; // browsers drop the oldest WebGL contexts at about eight

  // ---- method filters -------------------------------------------------------------------------------------
  for (const group of document.querySelectorAll(".chips")) {
    const target = document.getElementById(group.dataset.target);
    const choose = (method) => {
      for (const button of group.children) {
        button.setAttribute("aria-pressed", String(button.dataset.choice === method));
      }
      for (const item of target.querySelectorAll("tr[data-method], .card, .predictions li")) {
        item.hidden = method !== "" && !item.dataset.method.split(" ").includes(method);
      }
      target.classList.toggle("single", method !== "");
    };
    group.addEventListener("click", (event) => {
      const button = event.target.closest("button");
      if (button) choose(button.dataset.choice);
    });
    if (group.dataset.target === "strata") choose(group.children[1].dataset.choice);
  }

  // ---- clouds ----------------------------------------------------------------------------------------------
  const decode = (sample) => clouds.decode(data.clouds[sample]);

  // Detections of rules in a sample: [method, { name, points }] in the order of the predictions.
  const shapesOf = (sample) =>
    Object.entries(data.shapes[sample]).flatMap(([method, shapes]) => shapes.map((shape) => [method, shape]));

  const whenSeen = new IntersectionObserver((entries) => {
    for (const entry of entries.filter((e) => e.isIntersecting && e.target.clientWidth)) {
      whenSeen.unobserve(entry.target);
      const { sample } = entry.target.closest(".card").dataset;
      const cloud = decode(sample);
      const colors = cloud.parts ? clouds.partColors(cloud) : clouds.heightColors(cloud);
      clouds.preview(entry.target, cloud, colors, shapesOf(sample).map(([, shape]) => shape));
    }
  }, { rootMargin: "300px" });
  document.querySelectorAll(".cloud canvas").forEach((canvas) => whenSeen.observe(canvas));

  // ---- 3D, made on demand -----------------------------------------------------------------------------
  const live = [];

  function close(plot) {
    window.Plotly.purge(plot);
    plot.previousElementSibling.hidden = false;
    plot.remove();
  }

  function open(button) {
    const { sample } = button.closest(".card").dataset;
    const cloud = decode(sample);
    const detections = shapesOf(sample).map(([method, shape]) => clouds.shape(shape, `${method}: ${shape.name}`));
    const traces = [...(cloud.parts ? clouds.byPart(cloud) : clouds.byHeight(cloud)), clouds.camera(), ...detections];
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
