"use strict";
(() => {
  const { data } = clouds;

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
  const detectionsOf = (sample) =>
    Object.entries(data.detections[sample]).flatMap(([method, detections]) => detections.map((detection) => [method, detection]));

  clouds.previewWhenVisible(document.querySelectorAll(".cloud canvas"), (canvas) => {
    const { sample } = canvas.closest(".card").dataset;
    const cloud = decode(sample);
    const colors = cloud.parts ? clouds.partColors(cloud) : clouds.heightColors(cloud);
    return { cloud, colors, detections: detectionsOf(sample).map(([, detection]) => detection) };
  });

  function open(button) {
    const { sample } = button.closest(".card").dataset;
    const cloud = decode(sample);
    const detections = detectionsOf(sample).map(([method, detection]) => clouds.detection(detection, `${method}: ${detection.name}`));
    const points = cloud.parts ? clouds.byPart(cloud) : clouds.byHeight(cloud);
    clouds.replaceByPlot(button, [...points, clouds.camera(), ...detections]);
  }

  document.addEventListener("click", (event) => {
    const button = event.target.closest(".cloud");
    if (button) open(button);
  });
})();
