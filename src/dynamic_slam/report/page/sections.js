// The report: sections of several kinds, in the order of the data.

const data = JSON.parse(document.getElementById("data").textContent);
const STATES = { tracking: "good", initialising: "wait", lost: "bad" };
const EVENTS = { keyframe: ["c6", "keyframes"], start: ["good", "started or found again"], lost: ["bad", "lost"], reset: ["c4", "maps given up"],
                 loop: ["c1", "loops"], detector: ["c2", "detector late or failed"], skipped: ["c5", "images skipped"] };

const draw = {
  tiles(parent, section) {
    for (const tile of section.tiles) {
      const box = element("div", { class: "tile" }, parent);
      element("div", { class: "label" }, box, tile.label);
      element("div", { class: `value ${tile.tone || ""}` }, box, tile.value);
      if (tile.note) element("div", { class: "more" }, box, tile.note);
    }
  },

  paths(parent, section) {
    const entries = section.tracks.filter((t) => !t.e || !section.colour).map((t) => ({ name: t.name, colour: t.colour }));
    if (section.truth) entries.unshift({ name: "truth", colour: "truth" });
    if (section.points) entries.push({ name: "landmarks", colour: "c6" });
    legend(parent, entries, true);
    if (section.colour) colourBar(parent, section.colour);
    const views = element("div", { class: "views" }, parent);
    const height = Math.min(440, 0.75 * window.innerWidth);
    for (const view of section.views) pathView(views, section, view, height);
  },

  timeline(parent, section) {
    const kinds = Object.keys(EVENTS).filter((kind) => section.events.some((e) => e[1] === kind));
    const items = legend(parent, kinds.map((kind) => ({ name: `${section.events.filter((e) => e[1] === kind).length} ${EVENTS[kind][1]}`,
                                                        colour: EVENTS[kind][0] })), false);
    legend(parent, Object.keys(STATES).filter((state) => section.states.some((s) => s[2] === state))
      .map((state) => ({ name: state, colour: STATES[state] })), true);
    const said = element("div", { class: "legend", "aria-live": "polite" }, parent);
    const row = 20, height = 34 + row * kinds.length + 26, range = section.range;
    const figure = element("figure", { class: "plot" }, parent);
    const stateAt = (time) => (section.states.find((s) => time >= s[0] && time <= s[1]) || [0, 0, "no image"])[2];
    const svg = drawing(figure, "States and events over time", height, (svg, width) => {
      const right = width - MARGIN.right, bottom = height - MARGIN.bottom;
      const toX = (x) => MARGIN.left + ((x - range[0]) / (range[1] - range[0] || 1)) * (right - MARGIN.left);
      for (const x of ticks(range[0], range[1], (right - MARGIN.left) / 90)) {
        shape("path", { d: `M${toX(x)} ${MARGIN.top}V${bottom}`, stroke: colour("grid") }, svg);
        shape("text", { x: toX(x), y: bottom + 15, "text-anchor": "middle" }, svg, `${short(x)} s`);
      }
      for (const [from, to, state] of section.states) {
        const bar = shape("rect", { x: toX(from), y: 8, width: Math.max(1, toX(to) - toX(from)), height: 16, class: "state",
                                    fill: colour(STATES[state]), "fill-opacity": 0.75 }, svg);
        shape("title", {}, bar, `${state}, ${short(from)} to ${short(to)} s`);
      }
      kinds.forEach((kind, k) => {
        const y = 42 + k * row;
        for (const [time, , text] of section.events.filter((e) => e[1] === kind)) {
          const mark = shape("rect", { x: toX(time) - 1, y: y - 6, width: 2, height: 12, rx: 1, fill: colour(EVENTS[kind][0]), class: "event" }, svg);
          shape("title", {}, mark, `${short(time)} s: ${text}`);
        }
      });
      const plot = { toX, right, bottom };
      followCursor(svg, width, range, plot, cursor.times, [], []);
      const hair = svg.showCursor;
      svg.showCursor = (time) => {
        hair(time);
        if (time === null) { said.textContent = ""; return; }
        const near = section.events.filter((e) => e[1] !== "keyframe" && Math.abs(e[0] - time) < 0.01 * (range[1] - range[0]));
        said.textContent = `${short(time)} s: ${stateAt(time)}${near.length ? " · " + near.slice(0, 2).map((e) => e[2]).join(" · ") : ""}`;
      };
    });
    items.forEach((item) => item.value.remove());
    handleKeys(svg);
    cursor.watchers.push((time) => svg.showCursor && svg.showCursor(time));
  },

  charts(parent, section) {
    const box = section.charts.length === 2 ? element("div", { class: "pair" }, parent) : parent;
    for (const chart of section.charts) timeChart(box, chart, section.range);
  },

  lines(parent, section) {
    for (const chart of section.charts) lineChart(parent, chart);
  },

  bars(parent, section) {
    barChart(parent, section);
  },

  table(parent, section) {
    const table = element("table", {}, element("div", { class: "scroll", tabindex: "0" }, parent));
    const head = element("thead", {}, table);
    if (section.columns.some((c) => c.group)) {
      const row = element("tr", {}, head);
      for (let i = 0; i < section.columns.length;) {
        let span = 1;
        while (i + span < section.columns.length && section.columns[i + span].group === section.columns[i].group && section.columns[i].group) ++span;
        element("th", { colspan: span, class: section.columns[i].group ? "group" : "", scope: "colgroup" }, row, section.columns[i].group || "");
        i += span;
      }
    }
    const names = element("tr", {}, head);
    for (const c of section.columns) element("th", { scope: "col", class: c.text ? "text" : "" }, names, c.name);
    const body = element("tbody", {}, table);
    for (const cells of section.rows) {
      const row = element("tr", {}, body);
      cells.forEach((cell, i) => {
        const made = element("td", { class: section.columns[i].text ? "text" : "" }, row);
        if (cell && cell.href) element("a", { href: cell.href }, made, cell.text);
        else made.textContent = cell;
      });
    }
  },

  frames(parent, section) {
    const box = element("div", { class: "frames" }, parent);
    for (const frame of section.frames) {
      const figure = element("figure", {}, box);
      element("img", { src: frame.src, alt: frame.caption, width: frame.width, height: frame.height, style: "height:auto" }, figure);
      element("figcaption", {}, figure, frame.caption);
    }
  },

  config(parent, section) {
    if (section.changed.length > 0) {
      draw.table(parent, { columns: [{ name: "option" }, { name: "value" }, { name: "default" }], rows: section.changed });
    }
    const details = element("details", {}, parent);
    element("summary", {}, details, "All options, as in config.yaml");
    element("pre", {}, details, section.yaml);
  },
};

function showTheme(theme) {
  document.documentElement.dataset.theme = theme;
  document.getElementById("theme").textContent = theme === "dark" ? "☀" : "☾";
}

function followTheme() {
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  showTheme(dark.matches ? "dark" : "light");
  dark.addEventListener("change", () => showTheme(dark.matches ? "dark" : "light"));
  document.getElementById("theme").addEventListener("click", () =>
    showTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"));
  // Paper is white, and everything is on it.
  let before = null;
  window.addEventListener("beforeprint", () => {
    before = document.documentElement.dataset.theme;
    showTheme("light");
    document.querySelectorAll("details").forEach((d) => { d.open = true; });
  });
  window.addEventListener("afterprint", () => showTheme(before || "light"));
}

document.getElementById("title").textContent = data.title;
document.getElementById("subtitle").textContent = data.subtitle || "";
followTheme();
cursor.times = data.times || [];
const contents = document.getElementById("contents");
data.sections.forEach((section, i) => {
  const parent = element("section", { id: `section${i}`, "data-type": section.type, class: { config: "long", table: "long", tiles: "tiles" }[section.type] || "" },
                         document.getElementById("report"));
  if (section.title) {
    element("h2", {}, parent, section.title);
    element("a", { href: `#section${i}` }, contents, section.short || section.title);
  }
  if (section.note) element("p", { class: "note" }, parent, section.note);
  draw[section.type](parent, section);
});
