(() => {
  clouds.previews(document.querySelectorAll("button.cloud"), (button) => {
    const entry = clouds.data.cards[button.closest(".card").dataset.file][button.dataset.method];
    const cloud = clouds.decode(entry.cloud);
    const { colors, sizes } = entry.channels ? clouds.byChannels(clouds.channelsOf(entry)) : clouds.byHeight(cloud);
    return { cloud, colors, sizes, detections: entry.detections };
  });

  document.addEventListener("click", (event) => {
    const selected = event.target.closest(".chips button");
    if (!selected) return;
    for (const chip of selected.parentElement.children) chip.setAttribute("aria-pressed", String(chip === selected));
    const { choice } = selected.dataset;
    for (const card of document.querySelectorAll(".card")) {
      card.hidden = choice !== "" && !JSON.parse(card.dataset.wrong).includes(choice);
    }
  });
})();
