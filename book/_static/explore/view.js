/* What can be moved on the page: sliders, two plots, the bar of stabilising filters, the verdict.
   Numbers come from loop.js; without a script the still picture inside stays. */
(() => {
  "use strict";

  const SIGNALS = { R: "of the reference R", d: "of d at the output", delta: "of δ at the input", eta: "of the noise η" };
  const CURVES = { FH: "F·H", H: "H", L: "L" };
  const CONTROLS = {
    lambda: { label: "filter’s time constant λ", unit: "s", log: true },
    order: { label: "filter’s order n", integer: true },
    gain: { label: "plant’s gain, times", log: true },
    lag: { label: "unknown lag", unit: "s" },
    zero: { label: "unknown zero at 1/T, T", unit: "s" },
    delay: { label: "unknown dead time", unit: "s" },
    T: { label: "sampling time T", unit: "s", log: true },
    observer: { label: "observer’s bandwidth ωo", unit: "rad/s", log: true },
    controller: { label: "controller’s bandwidth ωc", unit: "rad/s", log: true },
  };
  const SIZE = { width: 340, height: 270, left: 42, right: 10, top: 12, bottom: 34 };

  const svg = (tag, attributes = {}, ...children) => {
    const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.append(...children);
    return element;
  };
  const html = (tag, properties = {}, ...children) => {
    const element = Object.assign(document.createElement(tag), properties);
    element.append(...children);
    return element;
  };
  const written = (x) => (Number.isFinite(x) ? String(Number(x.toPrecision(3))).replace("-", "−") : "∞");

  /* Round numbers across a range, some five of them. */
  const ticks = (low, high) => {
    const raw = (high - low) / 5;
    const unit = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].find((m) => m * unit >= raw) * unit;
    const found = [];
    for (let x = Math.ceil(low / step) * step; x <= high + 1e-9 * step; x += step) found.push(Math.abs(x) < step / 1e6 ? 0 : x);
    return found;
  };

  class Plot {
    constructor(title, xName, yName) {
      this.clip = `clip-${Math.random().toString(36).slice(2)}`;
      const { width, height, left, right, top, bottom } = SIZE;
      this.frame = svg("g", { class: "frame" });
      this.data = svg("g", { "clip-path": `url(#${this.clip})` });
      this.names = [xName, yName];
      this.title = title;
      this.element = svg(
        "svg",
        { viewBox: `0 0 ${width} ${height}`, role: "img" },
        svg("defs", {}, svg("clipPath", { id: this.clip }, svg("rect", { x: left, y: top, width: width - left - right, height: height - top - bottom }))),
        this.frame,
        this.data,
      );
    }

    draw([x0, x1], [y0, y1], parts, said) {
      const { width, height, left, right, top, bottom } = SIZE;
      const X = (x) => left + ((x - x0) / (x1 - x0)) * (width - left - right);
      const Y = (y) => height - bottom - ((y - y0) / (y1 - y0)) * (height - top - bottom);
      const frame = [];
      for (const x of ticks(x0, x1)) {
        frame.push(svg("line", { x1: X(x), x2: X(x), y1: top, y2: height - bottom }));
        frame.push(svg("text", { x: X(x), y: height - bottom + 13, "text-anchor": "middle" }, written(x)));
      }
      for (const y of ticks(y0, y1)) {
        frame.push(svg("line", { x1: left, x2: width - right, y1: Y(y), y2: Y(y) }));
        frame.push(svg("text", { x: left - 5, y: Y(y) + 4, "text-anchor": "end" }, written(y)));
      }
      frame.push(svg("text", { x: (left + width - right) / 2, y: height - 4, "text-anchor": "middle" }, this.names[0]));
      frame.push(svg("text", { x: 11, y: height / 2, "text-anchor": "middle", transform: `rotate(-90 11 ${height / 2})` }, this.names[1]));
      this.frame.replaceChildren(...frame);
      this.data.replaceChildren(
        ...parts.map(({ points, at, kind }) =>
          points
            ? svg("polyline", { class: kind, points: points.map(([x, y]) => `${X(x).toFixed(1)},${Y(y).toFixed(1)}`).join(" ") })
            : svg("path", { class: kind, d: `M${X(at[0]) - 5} ${Y(at[1]) - 5}l10 10m0 -10l-10 10` }),
        ),
      );
      this.element.setAttribute("aria-label", said);
    }
  }

  class Explorable {
    constructor(figure) {
      this.given = JSON.parse(figure.dataset.explorable);
      this.kind = nrdob.kinds[this.given.kind];
      this.plots = [new Plot("Nyquist", "real part", "imaginary part"), new Plot("Step", "time in s", "y")];
      this.bar = svg("svg", { viewBox: "0 0 480 50", role: "img", class: "bar" });
      this.verdict = html("p", { className: "explorable-verdict" });
      this.verdict.setAttribute("role", "status");
      this.state = { ...this.given.start, curve: this.kind.counted, signal: "d" };
      const still = figure.querySelector(".explorable-still");
      const board = html(
        "div",
        { className: "explorable-board" },
        this.verdict,
        html("div", { className: "explorable-plots" }, ...this.plots.map((plot) => plot.element)),
        html("p", { className: "explorable-bar-name" }, this.kind.said),
        this.bar,
        html("div", { className: "explorable-controls" }, ...Object.entries(this.given.range).map((each) => this.slider(...each))),
        html("div", { className: "explorable-controls" }, this.choice("Curve", "curve", this.kind.counted === "L" ? { L: "L" } : CURVES), this.choice("Unit step", "signal", SIGNALS), this.back()),
      );
      still.replaceWith(board);
      this.show();
    }

    slider(name, [low, high]) {
      const { label, unit = "", log, integer } = CONTROLS[name];
      const inner = log ? Math.log10 : (x) => x;
      const outer = log ? (x) => 10 ** x : (x) => x;
      const input = html("input", { type: "range", min: inner(low), max: inner(high), step: integer ? 1 : (inner(high) - inner(low)) / 400 });
      const shown = html("output");
      const put = () => {
        input.value = inner(this.state[name]);
        shown.value = `${written(this.state[name])} ${unit}`;
        input.setAttribute("aria-valuetext", shown.value);
      };
      input.addEventListener("input", () => {
        this.state[name] = integer ? Math.round(input.valueAsNumber) : outer(input.valueAsNumber);
        this.show();
      });
      (this.refresh ??= []).push(put);
      return html("label", {}, html("span", {}, label, " ", shown), input);
    }

    choice(label, name, choices) {
      const select = html("select", {}, ...Object.entries(choices).map(([value, text]) => html("option", { value, selected: value === this.state[name] }, text)));
      select.addEventListener("change", () => {
        this.state[name] = select.value;
        this.show();
      });
      this.refresh.push(() => (select.value = this.state[name]));
      return html("label", {}, html("span", {}, label), select);
    }

    back() {
      const button = html("button", { type: "button" }, "As at first");
      button.addEventListener("click", () => {
        Object.assign(this.state, this.given.start);
        this.show();
      });
      return button;
    }

    show() {
      const started = performance.now();
      for (const put of this.refresh) put();
      const parameters = { ...this.state, plant: this.given.plant };
      const loop = this.kind.loopOf(parameters);
      const found = nrdob.judge(loop);
      this.tell(found);
      this.nyquist(loop, found);
      this.step(loop, found);
      this.filters(parameters);
      this.last = { found, set: this.set, time: performance.now() - started };
    }

    tell({ N, P, Z, Ms, stable, modelStable }) {
      const word = stable ? "stable" : Number.isNaN(Z) ? "undecided" : "unstable";
      this.verdict.className = `explorable-verdict ${word}`;
      const why = modelStable ? "" : "; the model's own loop is unstable";
      const peak = stable ? `, largest sensitivity Ms = ${written(Ms)}` : "";
      this.verdict.replaceChildren(html("strong", {}, word), `: N = ${written(N)}, P = ${P}, Z = N + P = ${written(Z)}${peak}${why}`);
    }

    nyquist(loop, { N, P, Z }) {
      const { curve } = this.state;
      const map = nrdob[curve];
      const points = [];
      for (const omega of nrdob.frequencies(loop, 700)) {
        const at = map(loop, omega);
        if (Math.hypot(...at) < 1e3) points.push(at);
      }
      const near = points.filter((z) => Math.hypot(...z) < 6);
      const reach = Math.min(4, Math.max(1.4, ...near.map((z) => Math.hypot(...z)))) * 1.1;
      const ratio = (SIZE.width - SIZE.left - SIZE.right) / (SIZE.height - SIZE.top - SIZE.bottom);
      this.plots[0].draw(
        [-reach * ratio, reach * ratio],
        [-reach, reach],
        [
          { points: points.map(([x, y]) => [x, -y]), kind: "mirror" },
          { points, kind: "curve" },
          { at: [-1, 0], kind: "minus-one" },
        ],
        `Nyquist plot of ${CURVES[curve]}: N = ${written(N)} clockwise turns of ${CURVES[this.kind.counted]} around −1, P = ${P}, Z = ${written(Z)}.`,
      );
    }

    step(loop, { stable }) {
      const { signal } = this.state;
      const last = this.given.last;
      const found = this.kind.step(loop, signal, last);
      const points = found ? found.time.map((t, k) => [t, found.y[k]]).filter(([, y]) => Number.isFinite(y)) : [];
      const seen = points.map(([, y]) => Math.max(-3, Math.min(3, y)));
      const [low, high] = [Math.min(-0.1, ...seen), Math.max(1.1, ...seen)];
      const end = points.length ? points[points.length - 1][1] : NaN;
      this.plots[1].draw(
        [0, last],
        [low - 0.05 * (high - low), high + 0.05 * (high - low)],
        [{ points: points.map(([t, y]) => [t, Math.max(-1e3, Math.min(1e3, y))]), kind: stable ? "curve" : "curve lost" }],
        `Output y after a unit step ${SIGNALS[signal]}: ${stable ? `${written(end)} after ${written(last)} seconds` : "it grows, the loop is unstable"}.`,
      );
    }

    filters(parameters) {
      const { bar } = this.kind;
      const [low, high] = this.given.range[bar];
      const { unit } = CONTROLS[bar];
      const { [bar]: present, ...rest } = parameters;
      const key = JSON.stringify(rest);
      if (key !== this.key) {
        this.key = key;
        const modelStable = nrdob.judge(this.kind.loopOf(parameters)).modelStable;
        this.set = modelStable ? this.kind.stabilizing(parameters, low, high) : [];
      }
      const X = (x) => 8 + (464 * Math.log(x / low)) / Math.log(high / low);
      const parts = [svg("rect", { class: "ground", x: 8, y: 8, width: 464, height: 12, rx: 3 })];
      for (const [from, to] of this.set) parts.push(svg("rect", { class: "works", x: X(from), y: 8, width: Math.max(1, X(to) - X(from)), height: 12, rx: 3 }));
      for (let x = 10 ** Math.ceil(Math.log10(low) - 1e-9); x <= high * 1.001; x *= 10) {
        parts.push(svg("line", { class: "tick", x1: X(x), x2: X(x), y1: 20, y2: 25 }));
        parts.push(svg("text", { x: X(x), y: 43, "text-anchor": X(x) > 460 ? "end" : "middle" }, `${written(x)} ${unit}`));
      }
      const at = Math.max(8, Math.min(472, X(present)));
      parts.push(svg("path", { class: "present", d: `M${at} 2v24m-5 -24h10` }));
      const said = this.set.length
        ? this.set.map(([a, b]) => `from ${a <= low * 1.0001 ? "the left end" : `${written(a)} ${unit}`} to ${b >= high * 0.9999 ? "the right end" : `${written(b)} ${unit}`}`).join(" and ")
        : "nowhere in this range";
      this.bar.setAttribute("aria-label", `${this.kind.said} ${said}. The present one is ${written(present)} ${unit}.`);
      this.bar.replaceChildren(...parts);
    }
  }

  const start = () => {
    nrdob.explorables = [...document.querySelectorAll("[data-explorable]")].map((figure) => new Explorable(figure));
  };
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", start);
  else start();
})();
