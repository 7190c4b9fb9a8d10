// Draws the plots; their colours by light or dark ground, legends, the time axis, values at the cursor, print.
(() => {
  "use strict";
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const toDark = JSON.parse(document.getElementById("colours").textContent);
  const toLight = Object.fromEntries(Object.entries(toDark).map(([light, other]) => [other, light]));
  const models = () => Bokeh.documents.flatMap((doc) => [...doc.all_models]);
  const views = () => [...Bokeh.index.roots].filter((view) => view.model.x_range); // there are menus too

  function recolour(isDark) {
    const map = isDark ? toDark : toLight;
    for (const model of models()) {
      for (const [name, value] of Object.entries(model.attributes)) {
        if (!name.endsWith("_color") || value === null) continue;
        const old = typeof value === "string" ? value : value.value;
        const found = map[old];
        if (found) model.setv({ [name]: typeof value === "string" ? found : { ...value, value: found } });
      }
    }
  }

  // Chips: every renderer of a curve, its band too, has the curve's key as its name.
  const renderers = new Map();
  function collect() {
    for (const model of models()) {
      if (!model.name || !model.glyph) continue;
      if (!renderers.has(model.name)) renderers.set(model.name, []);
      renderers.get(model.name).push(model);
    }
  }
  function toggle(chip) {
    const on = chip.getAttribute("aria-pressed") !== "true";
    chip.setAttribute("aria-pressed", String(on));
    for (const renderer of renderers.get(chip.dataset.curve) || []) renderer.visible = on;
  }

  // The axis that all plots of a result share.
  function axisOf(result) {
    const chip = document.querySelector(`[data-axis="${result}"] .plot`);
    const view = views().find((v) => chip && chip.contains(v.el));
    return view ? view.model.x_range : null;
  }
  function move(button) {
    const axis = axisOf(button.dataset.result);
    if (!axis) return;
    const [low, high] = axis.bounds;
    const span = axis.end - axis.start;
    const middle = (axis.start + axis.end) / 2;
    const factor = { in: 0.5, out: 2 }[button.dataset.move] || 1;
    const shift = { left: -0.5, right: 0.5 }[button.dataset.move] || 0;
    let width = Math.min(span * factor, high - low);
    let start = middle - width / 2 + shift * span;
    start = Math.max(low, Math.min(start, high - width));
    if (button.dataset.move === "reset") [start, width] = [low, high - low];
    axis.setv({ start, end: start + width });
  }

  // Values at the cursor, in the legends of all plots of the result: of the last point that is not later.
  function last(times, at) {
    let [low, high] = [0, times.length - 1];
    if (!times.length || at < times[0]) return -1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (times[middle] <= at) low = middle; else high = middle - 1;
    }
    return low;
  }
  function told(chip, at) {
    const curve = (renderers.get(chip.dataset.curve) || []).find((r) => "y" in r.glyph.attributes);
    const data = curve && curve.data_source.data;
    const row = data && at !== null ? last(data.x, at) : -1;
    chip.querySelector(".value").textContent = row < 0 ? "" : Number(data.y[row]).toPrecision(4);
  }
  function watch(view) {
    const stack = view.el.closest(".stack");
    if (!stack) return;
    const unit = (view.model.below[0].axis_label || "").replace("time / ", "");
    const place = document.querySelector(`[data-at="${stack.dataset.of}"]`);
    const tell = (at) => {
      if (place) place.textContent = at === null ? "" : `at ${at.toPrecision(5)} ${unit}`;
      stack.querySelectorAll("button[data-curve]").forEach((chip) => told(chip, at));
    };
    view.model.on_event("mousemove", (event) => tell(event.x));
    view.model.on_event("mouseleave", () => tell(null));
  }

  // Paper is white, and the browser does not wait for a plot that draws itself later: it gets a copy that is drawn now.
  let closed = [];
  function copy(view) {
    const place = view.el.closest(".plot");
    for (const renderer of view.model.renderers) view.renderer_views.get(renderer).set_visuals(); // the new colours, now
    view.repaint();
    const { canvas } = view.export("png", true);
    canvas.removeAttribute("style");
    canvas.className = "paper";
    place.append(canvas);
  }
  function toPaper() {
    closed = [...document.querySelectorAll("details:not([open])")];
    closed.forEach((item) => { item.open = true; });
    recolour(false);
    views().forEach(copy);
  }
  function fromPaper() {
    closed.forEach((item) => { item.open = false; });
    document.querySelectorAll(".paper").forEach((item) => item.remove());
    recolour(dark.matches);
  }

  // A finger that moves over a plot scrolls the page, as long as no tool is chosen that takes the gesture.
  function leaveTouch() {
    if (!matchMedia("(pointer: coarse)").matches) return;
    for (const model of models()) if (model.type === "BoxZoomTool") model.active = false;
  }

  function begin() {
    collect();
    leaveTouch();
    recolour(dark.matches);
    for (const view of views()) watch(view);
    dark.addEventListener("change", () => recolour(dark.matches));
    addEventListener("beforeprint", toPaper);
    addEventListener("afterprint", fromPaper);
    document.documentElement.dataset.drawn = "true";
  }
  document.addEventListener("click", (event) => {
    const chip = event.target.closest("button[data-curve]");
    const button = event.target.closest("button[data-move]");
    if (chip) toggle(chip);
    if (button) move(button);
  });
  const { document: drawn, places } = JSON.parse(document.getElementById("figures").textContent);
  if (drawn) Bokeh.embed.embed_items({ page: drawn }, [{ docid: "page", roots: places, root_ids: Object.keys(places) }]);
  const wanted = document.querySelectorAll(".plot").length;
  const wait = () => (views().length >= wanted ? begin() : setTimeout(wait, 20));
  addEventListener("load", wait);
})();
