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
  clouds.previews(document.querySelectorAll("button.cloud"), (button) => {
    const { sample } = button.closest(".card").dataset;
    const cloud = clouds.decode(data.clouds[sample]);
    const { colors } = cloud.parts ? clouds.byPart(cloud) : clouds.byHeight(cloud);
    return { cloud, colors, detections: Object.values(data.detections[sample]).flat() };
  });
})();
