(() => {
  const entryOf = (node) => clouds.data.cards[node.closest(".card").dataset.file][node.closest(".cloud").dataset.method];

  clouds.previewWhenVisible(document.querySelectorAll(".cloud canvas"), (canvas) => {
    const { cloud: encoded, channels, detections } = entryOf(canvas);
    const cloud = clouds.decode(encoded);
    const colors = channels ? clouds.channelColors(clouds.channelsOf({ channels })) : clouds.heightColors(cloud);
    return { cloud, colors, detections };
  });

  function open(button) {
    const entry = entryOf(button);
    const cloud = clouds.decode(entry.cloud);
    const points = entry.channels ? clouds.byChannels(cloud, clouds.channelsOf(entry)) : clouds.byHeight(cloud);
    const detections = entry.detections.map((detection) => clouds.detection(detection, detection.name));
    clouds.replaceByPlot(button.closest("figure"), [...points, clouds.camera(), ...detections]);
  }

  document.addEventListener("click", (event) => {
    const cloud = event.target.closest(".cloud");
    if (cloud) open(cloud);
    const selected = event.target.closest(".chips button");
    if (!selected) return;
    for (const chip of selected.parentElement.children) chip.setAttribute("aria-pressed", String(chip === selected));
    const { choice } = selected.dataset;
    for (const card of document.querySelectorAll(".card")) {
      card.hidden = choice !== "" && !JSON.parse(card.dataset.wrong).includes(choice);
    }
  });
})();
