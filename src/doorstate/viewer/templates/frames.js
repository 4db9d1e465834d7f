(() => {
  const LIVE_AT_ONCE = 4; // browsers drop the oldest WebGL contexts at about eight
  const viewOf = (node) => clouds.data.cards[node.closest(".card").dataset.file][node.closest(".cloud").dataset.method];

  const whenSeen = new IntersectionObserver((entries) => {
    for (const { target } of entries.filter((each) => each.isIntersecting && each.target.clientWidth)) {
      whenSeen.unobserve(target);
      const view = viewOf(target);
      const cloud = clouds.decode(view.cloud);
      const colors = view.channels ? clouds.channelColors(clouds.channelsOf(view)) : clouds.heightColors(cloud);
      clouds.preview(target, cloud, colors, view.shapes);
    }
  }, { rootMargin: "300px" });
  document.querySelectorAll(".cloud canvas").forEach((canvas) => whenSeen.observe(canvas));

  const live = [];

  function close({ plot, button }) {
    window.Plotly.purge(plot);
    button.closest("figure").hidden = false;
    plot.remove();
  }

  function open(button) {
    const view = viewOf(button);
    const cloud = clouds.decode(view.cloud);
    const points = view.channels ? clouds.byChannels(cloud, clouds.channelsOf(view)) : clouds.byHeight(cloud);
    const found = view.shapes.map((shape) => clouds.shape(shape, shape.name));
    const plot = document.createElement("div");
    plot.className = "live";
    button.closest("figure").after(plot);
    button.closest("figure").hidden = true;
    clouds.plotly().newPlot(plot, [...points, clouds.camera(), ...found], clouds.layout(), clouds.config).then(() => {
      live.push({ plot, button });
      if (live.length > LIVE_AT_ONCE) close(live.shift());
    });
  }

  document.addEventListener("click", (event) => {
    const cloud = event.target.closest(".cloud");
    if (cloud) open(cloud);
    const chip = event.target.closest(".chips button");
    if (!chip) return;
    for (const each of chip.parentElement.children) each.setAttribute("aria-pressed", String(each === chip));
    for (const card of document.querySelectorAll(".card")) {
      card.hidden = chip.dataset.choice !== "" && !JSON.parse(card.dataset.wrong).includes(chip.dataset.choice);
    }
  });
})();
