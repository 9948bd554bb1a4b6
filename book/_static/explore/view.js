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
    zero: { label: "T of an unknown zero at 1/T", unit: "s" },
    delay: { label: "unknown dead time", unit: "s" },
    T: { label: "sampling time T", unit: "s", log: true },
    observer: { label: "observer’s bandwidth ωo", unit: "rad/s", log: true },
    controller: { label: "controller’s bandwidth ωc", unit: "rad/s", log: true },
  };
  const UPWARDS = ["delay", "gain"]; // of a chart
  const ROWS = 56; // bars in the stack of a chart
  const PATIENCE = 10; // ms of work in the background before the page may answer
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

  /* The same where a scale is of powers of ten, over their exponents. */
  const powers = (low, high) => {
    const found = [];
    for (let k = Math.floor(low); k <= high; k++) {
      for (const m of high - low < 2 ? [1, 2, 5] : [1]) found.push(k + Math.log10(m));
    }
    return found.filter((x) => x > low - 1e-9 && x < high + 1e-9);
  };
  /* From what a slider moves to its place on the scale, and back. */
  const LINEAR = { inner: (x) => x, outer: (x) => x, marks: ticks };
  const POWERS = { inner: Math.log10, outer: (x) => 10 ** x, marks: powers };
  const scaleOf = (name) => (CONTROLS[name].log ? POWERS : LINEAR);
  const named = (name, x) => `${CONTROLS[name].label} ${written(x)} ${CONTROLS[name].unit ?? ""}`.trim();

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

    /* What lies between two values on each axis, and where a value is in the picture. */
    frameFor([x0, x1], [y0, y1], { marks: across } = LINEAR, { marks: upwards } = LINEAR) {
      const { width, height, left, right, top, bottom } = SIZE;
      const X = (x) => left + ((x - x0) / (x1 - x0)) * (width - left - right);
      const Y = (y) => height - bottom - ((y - y0) / (y1 - y0)) * (height - top - bottom);
      const shown = (x, marks) => written(marks === powers ? 10 ** x : x);
      const frame = [];
      for (const x of across(x0, x1)) {
        frame.push(svg("line", { x1: X(x), x2: X(x), y1: top, y2: height - bottom }));
        frame.push(svg("text", { x: X(x), y: height - bottom + 13, "text-anchor": "middle" }, shown(x, across)));
      }
      for (const y of upwards(y0, y1)) {
        frame.push(svg("line", { x1: left, x2: width - right, y1: Y(y), y2: Y(y) }));
        frame.push(svg("text", { x: left - 5, y: Y(y) + 4, "text-anchor": "end" }, shown(y, upwards)));
      }
      frame.push(svg("text", { x: (left + width - right) / 2, y: height - 4, "text-anchor": "middle" }, this.names[0]));
      frame.push(svg("text", { x: 11, y: height / 2, "text-anchor": "middle", transform: `rotate(-90 11 ${height / 2})` }, this.names[1]));
      this.frame.replaceChildren(...frame);
      return { X, Y };
    }

    line(points, kind, { X, Y }) {
      return svg("polyline", { class: kind, points: points.map(([x, y]) => `${X(x).toFixed(1)},${Y(y).toFixed(1)}`).join(" ") });
    }

    draw(xs, ys, parts, said) {
      const places = this.frameFor(xs, ys);
      const { X, Y } = places;
      this.data.replaceChildren(
        ...parts.map(({ points, at, kind, words }) => {
          if (points) return this.line(points, kind, places);
          if (!words) return svg("path", { class: kind, d: `M${X(at[0]) - 5} ${Y(at[1]) - 5}l10 10m0 -10l-10 10` });
          const dot = svg("circle", { class: kind, cx: X(at[0]), cy: Y(at[1]), r: 5 });
          return svg("g", {}, dot, svg("text", { x: X(at[0]), y: Y(at[1]) - 12, "text-anchor": "middle" }, words));
        }),
      );
      this.element.setAttribute("aria-label", said);
    }
  }

  /* The stability chart, with a point that is moved by mouse, finger and arrow keys. It is a stack of
     bars: the stable filters at each height, which are found in the background, as the borders are. */
  class Chart extends Plot {
    constructor(range, move) {
      super("Chart", "filter’s time constant λ in s", "");
      this.range = range;
      this.move = move;
      this.height = svg("line", { class: "height", x1: SIZE.left, x2: SIZE.width - SIZE.right, "pointer-events": "none" });
      this.handle = svg("circle", { class: "handle", r: 22 });
      this.here = svg("circle", { class: "here", r: 6, "pointer-events": "none" });
      this.element.append(this.height, this.handle, this.here);
      for (const [name, value] of Object.entries({ role: "slider", tabindex: 0, class: "chart" })) this.element.setAttribute(name, value);
      this.element.addEventListener("pointerdown", (event) => {
        if (event.pointerType !== "mouse" && event.target !== this.handle) return;
        this.element.setPointerCapture(event.pointerId);
        this.held = true;
        this.follow(event);
      });
      this.element.addEventListener("lostpointercapture", () => (this.held = false));
      // A finger on the point moves it, elsewhere the page.
      this.handle.addEventListener("touchstart", (event) => event.preventDefault(), { passive: false });
      this.element.addEventListener("pointermove", (event) => {
        if (this.held) this.follow(event);
      });
      this.element.addEventListener("click", (event) => this.follow(event));
      this.element.addEventListener("keydown", (event) => {
        const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] }[event.key];
        if (!way) return;
        event.preventDefault();
        const step = event.shiftKey ? 0.1 : 0.01;
        this.to(this.shares.map((share, k) => share + step * way[k]));
      });
    }

    get axes() {
      return ["lambda", this.upwards].map((name) => ({ name, ...scaleOf(name), ends: this.range[name].map(scaleOf(name).inner) }));
    }

    follow(event) {
      const { width, height, left, right, top, bottom } = SIZE;
      const box = this.element.getBoundingClientRect();
      const x = ((event.clientX - box.left) * width) / box.width;
      const y = ((event.clientY - box.top) * height) / box.height;
      this.to([(x - left) / (width - left - right), (height - bottom - y) / (height - top - bottom)]);
    }

    to(shares) {
      const within = shares.map((share) => Math.max(0, Math.min(1, share)));
      this.move(Object.fromEntries(this.axes.map(({ name, outer, ends: [a, b] }, k) => [name, outer(a + within[k] * (b - a))])));
    }

    show(parameters, { Z }, setAt) {
      const { upwards, lambda, [upwards]: up, ...rest } = parameters;
      const key = JSON.stringify([upwards, rest]);
      if (key !== this.key) {
        this.key = key;
        this.upwards = upwards;
        this.names[1] = `${CONTROLS[upwards].label}${CONTROLS[upwards].unit ? ` in ${CONTROLS[upwards].unit}` : ""}`;
        this.element.setAttribute("aria-label", `Stability chart: the filter’s λ across, ${CONTROLS[upwards].label} upwards. Arrow keys move the point.`);
        const [across, above] = this.axes;
        this.places = this.frameFor(across.ends, above.ends, across, above);
        this.data.replaceChildren();
        this.rest = this.pieces(parameters, setAt);
        this.work(this.rest);
      }
      const [x, y] = [lambda, up].map((value, k) => this.axes[k].inner(value));
      this.shares = [x, y].map((value, k) => {
        const [a, b] = this.axes[k].ends;
        return (value - a) / (b - a);
      });
      const { X, Y } = this.places;
      for (const end of ["y1", "y2"]) this.height.setAttribute(end, Y(y));
      for (const circle of [this.handle, this.here]) {
        circle.setAttribute("cx", X(x));
        circle.setAttribute("cy", Y(y));
      }
      const [low, high] = this.range.lambda;
      const said = `${named("lambda", lambda)}, ${named(upwards, up)}: ${Z === 1 ? "1 root" : `${written(Z)} roots`} on the right`;
      for (const [name, value] of Object.entries({ valuemin: low, valuemax: high, valuenow: lambda, valuetext: said })) this.element.setAttribute(`aria-${name}`, value);
    }

    /* What is to be drawn, piece by piece. */
    *pieces(parameters, setAt) {
      const { X, Y } = this.places;
      const [{ inner }, above] = this.axes;
      const [low, high] = this.range.lambda;
      for (const curve of nrdob.borders(parameters, this.upwards, this.range.lambda, this.range[this.upwards])) {
        yield this.line(curve.map(({ lambda, up }) => [inner(lambda), above.inner(up)]), "border", this.places);
      }
      const [bottom, top] = above.ends;
      const tall = (top - bottom) / ROWS;
      for (let row = 0; row < ROWS; row++) {
        const foot = bottom + row * tall;
        yield svg("g");
        for (const [from, to] of setAt({ ...parameters, [this.upwards]: above.outer(foot + tall / 2) }, low, high)) {
          const [left, right] = [X(inner(from)), X(inner(to))];
          yield svg("rect", { class: "works", x: left, y: Y(foot + tall), width: right - left, height: Y(foot) - Y(foot + tall) });
        }
      }
    }

    /* Draw them a few at a time, until there are no more, or others are to be drawn. */
    work(pieces) {
      this.done = false;
      setTimeout(() => {
        const until = performance.now() + PATIENCE;
        while (pieces === this.rest && performance.now() < until) {
          const { value, done } = pieces.next();
          this.done = done;
          if (done) return;
          this.data.append(value);
        }
        if (pieces === this.rest) this.work(pieces);
      });
    }
  }

  class Explorable {
    constructor(figure) {
      this.given = JSON.parse(figure.dataset.explorable);
      this.kind = nrdob.kinds[this.given.kind];
      this.plots = [new Plot("Nyquist", "real part", "imaginary part"), new Plot("Step", "time in s", "y")];
      const { range, start } = this.given;
      if (start.upwards) this.chart = new Chart(range, (moved) => this.to(moved));
      this.bar = svg("svg", { viewBox: "0 0 480 50", role: "img", class: "bar" });
      this.verdict = html("p", { className: "explorable-verdict" });
      this.verdict.setAttribute("role", "status");
      this.words = html("p", { className: "explorable-set" });
      this.words.setAttribute("role", "status");
      this.state = { ...this.given.start, curve: this.kind.counted, signal: "d" };
      const still = figure.querySelector(".explorable-still");
      const plots = this.plots.map((plot) => plot.element);
      const filters = [html("p", { className: "explorable-bar-name" }, this.kind.said), this.bar];
      if (this.chart) {
        plots.unshift(this.chart.element);
        plots.push(html("div", {}, ...filters.splice(0), this.words));
      }
      const board = html(
        "div",
        { className: "explorable-board" },
        this.verdict,
        html("div", { className: "explorable-plots" }, ...plots),
        ...filters,
        html("div", { className: "explorable-controls" }, ...Object.entries(this.given.range).map((each) => this.slider(...each))),
        html("div", { className: "explorable-controls" }, this.choice("Curve", "curve", this.kind.counted === "L" ? { L: "L" } : CURVES), this.choice("Unit step", "signal", SIGNALS), ...this.upwards(), this.back()),
      );
      still.replaceWith(board);
      this.show();
    }

    slider(name, [low, high]) {
      const { label, unit = "", integer } = CONTROLS[name];
      const { inner, outer } = scaleOf(name);
      const input = html("input", { type: "range", min: inner(low), max: inner(high), step: integer ? 1 : (inner(high) - inner(low)) / 400 });
      const shown = html("output");
      const put = () => {
        input.value = inner(this.state[name]);
        shown.value = `${written(this.state[name])} ${unit}`;
        input.setAttribute("aria-valuetext", shown.value);
      };
      input.addEventListener("input", () => {
        this.to({ [name]: integer ? Math.round(input.valueAsNumber) : outer(input.valueAsNumber) });
      });
      (this.refresh ??= []).push(put);
      return html("label", {}, html("span", {}, label, " ", shown), input);
    }

    choice(label, name, choices) {
      const select = html("select", {}, ...Object.entries(choices).map(([value, text]) => html("option", { value, selected: value === this.state[name] }, text)));
      select.addEventListener("change", () => this.to({ [name]: select.value }));
      this.refresh.push(() => (select.value = this.state[name]));
      return html("label", {}, html("span", {}, label), select);
    }

    /* What of the plant the chart has upwards. */
    upwards() {
      if (!this.chart) return [];
      const choices = UPWARDS.filter((name) => name in this.given.range).map((name) => [name, CONTROLS[name].label]);
      return [this.choice("Upwards", "upwards", Object.fromEntries(choices))];
    }

    to(moved) {
      Object.assign(this.state, moved);
      this.show();
    }

    back() {
      const button = html("button", { type: "button" }, "As at first");
      button.addEventListener("click", () => this.to(this.given.start));
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
      this.chart?.show(parameters, found, this.setAt.bind(this));
      this.last = { found, set: this.set, time: performance.now() - started };
    }

    tell({ N, P, Z, Ms, stable, modelStable }) {
      const word = stable ? "stable" : Number.isNaN(Z) ? "undecided" : "unstable";
      this.verdict.className = `explorable-verdict ${word}`;
      const why = modelStable ? "" : "; the model's own loop is unstable";
      const facts = [`N = ${written(N)}`, `P = ${P}`, `Z = N + P = ${written(Z)}`, ...(stable ? [`largest sensitivity Ms = ${written(Ms)}`] : [])];
      const told = facts.flatMap((fact, k) => [k ? ", " : ": ", html("span", { className: "explorable-fact" }, fact)]);
      this.verdict.replaceChildren(html("strong", {}, word), ...told, why);
    }

    nyquist(loop, { N, P, Z }) {
      const { curve } = this.state;
      const map = nrdob[curve];
      const points = [];
      for (const omega of nrdob.frequencies(loop, 700)) {
        const at = map(loop, omega);
        if (Math.hypot(...at) < 1e3) points.push(at);
      }
      const [first] = points;
      const isPoint = points.length > 0 && points.every((z) => Math.hypot(z[0] - first[0], z[1] - first[1]) < 1e-9);
      const drawn = isPoint
        ? [{ at: first, kind: "point", words: `${CURVES[curve]} is the point ${written(Math.abs(first[0]) < 1e-9 ? 0 : first[0])}` }]
        : [{ points: points.map(([x, y]) => [x, -y]), kind: "mirror" }, { points, kind: "curve" }];
      const near = points.filter((z) => Math.hypot(...z) < 6);
      const farthest = isPoint ? Math.hypot(...first) : Math.min(4, Math.max(0, ...near.map((z) => Math.hypot(...z))));
      const reach = Math.max(1.4, farthest) * 1.1;
      const ratio = (SIZE.width - SIZE.left - SIZE.right) / (SIZE.height - SIZE.top - SIZE.bottom);
      this.plots[0].draw(
        [-reach * ratio, reach * ratio],
        [-reach, reach],
        [...drawn, { at: [-1, 0], kind: "minus-one" }],
        `Nyquist plot of ${CURVES[curve]}: ${isPoint ? `${drawn[0].words}. ` : ""}N = ${written(N)} clockwise encirclements of −1 by ${CURVES[this.kind.counted]}, P = ${P}, Z = ${written(Z)}.`,
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

    setAt(parameters, low, high) {
      const { modelStable } = nrdob.judge(this.kind.loopOf(parameters));
      return modelStable ? this.kind.stabilizing(parameters, low, high) : [];
    }

    filters(parameters) {
      const { bar } = this.kind;
      const [low, high] = this.given.range[bar];
      const { unit } = CONTROLS[bar];
      const { [bar]: present, ...rest } = parameters;
      const key = JSON.stringify(rest);
      if (key !== this.key) {
        this.key = key;
        this.set = this.setAt(parameters, low, high);
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
      const { upwards } = this.state;
      const words = upwards && `${named(upwards, this.state[upwards])}: stable for λ ${said}.`;
      if (words && words !== this.words.textContent) this.words.textContent = words;
    }
  }

  const start = () => {
    nrdob.explorables = [...document.querySelectorAll("[data-explorable]")].map((figure) => new Explorable(figure));
  };
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", start);
  else start();
})();
