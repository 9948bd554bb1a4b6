/* What can be moved on the page: sliders, two plots, the bar of stabilising filters, the verdict.
   Numbers come from loop.js; without a script the still picture inside stays. A move is answered at
   once by verdict and plots; bar and chart follow in the background, a few milliseconds at a time. */
(() => {
  "use strict";

  const SIGNALS = { R: "of the reference R", d: "of d at the output", delta: "of δ at the input", eta: "of the noise η" };
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
    instant: { label: "the step comes at", unit: "s" },
  };
  const UPWARDS = ["delay", "gain"]; // of a chart
  // The way of its point, as shares of width and height.
  const KEYS = {
    ArrowLeft: [-0.01, 0], ArrowRight: [0.01, 0], ArrowDown: [0, -0.01], ArrowUp: [0, 0.01],
    PageDown: [0, -0.1], PageUp: [0, 0.1], Home: [-1, 0], End: [1, 0],
  };
  const ROWS = 56; // bars in the stack of a chart
  const PATIENCE = 8; // ms of work in the background before the page may answer
  const STEPS = 400; // of a slider, from end to end
  const LATEST = 0.5; // of the time that is shown, for the step
  const SIZE = { width: 340, height: 270, right: 10, top: 12, bottom: 34 };
  const LETTER = 7.6; // px, the widest digit of the fonts that a reader may have

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
  const whole = (x) => (Number.isFinite(x) ? String(Math.round(x)).replace("-", "−") : "∞");
  const written = (x) => (Number.isFinite(x) ? String(Number(x.toPrecision(3))).replace("-", "−") : "∞");

  const plural = (n, one, many) => `${whole(n)} ${n === 1 ? one : many}`;
  /* A time as one says it. */
  const said = (t) => (t < 0.1 ? `${written(1000 * t)} ms` : `${written(t)} s`);

  /* Work that may take long, a few milliseconds at a time until it is done or `wanted` no more. */
  const worked = (work, wanted, took, ready) => {
    const started = performance.now();
    let step = { done: false };
    while (wanted() && !step.done && performance.now() < started + PATIENCE) {
      step = work.next();
      if (!step.done) took(step.value);
    }
    if (!wanted()) return;
    if (step.done) ready(step.value);
    else setTimeout(() => worked(work, wanted, took, ready));
  };

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
  const shown = (x, marks) => written(marks === powers ? 10 ** x : x);
  const named = (name, x) => `${CONTROLS[name].label} ${written(x)} ${CONTROLS[name].unit ?? ""}`.trim();

  /* Of many points the least and the greatest of each of 500 pieces. */
  const thinned = (points) => {
    const each = Math.ceil(points.length / 500);
    if (each < 3) return points;
    const found = [];
    for (let k = 0; k < points.length; k += each) {
      const piece = points.slice(k, k + each);
      const by = (better) => piece.reduce((a, b) => (better(b[1], a[1]) ? b : a));
      found.push(...[by((a, b) => a < b), by((a, b) => a > b)].sort((a, b) => a[0] - b[0]));
    }
    return [points[0], ...found, points[points.length - 1]];
  };

  /* What a hand has taken hold of follows it until it lets go. */
  const held = (element, follow, takes = () => true) => {
    let on = false;
    element.addEventListener("pointerdown", (event) => {
      if (!takes(event)) return;
      element.setPointerCapture(event.pointerId);
      on = true;
      follow(event);
    });
    element.addEventListener("pointermove", (event) => on && follow(event));
    element.addEventListener("lostpointercapture", () => (on = false));
  };
  /* A finger on it moves it, elsewhere the page. */
  const grip = (attributes) => {
    const found = svg("circle", { class: "grip", r: 22, ...attributes });
    found.addEventListener("touchstart", (event) => event.preventDefault(), { passive: false });
    return found;
  };

  class Plot {
    constructor(kind, xName, yName) {
      const { width, height, right, top, bottom } = SIZE;
      const clip = `clip-${Math.random().toString(36).slice(2)}`;
      this.left = 42;
      this.inside = svg("rect", { y: top, height: height - top - bottom });
      this.frame = svg("g", { class: "frame" });
      this.data = svg("g", { "clip-path": `url(#${clip})` });
      this.names = [xName, yName];
      this.title = svg("text", { class: "title", y: top + 14 });
      this.element = svg(
        "svg",
        { viewBox: `0 0 ${width} ${height}`, role: "img", class: kind.toLowerCase() },
        svg("defs", {}, svg("clipPath", { id: clip }, this.inside)),
        this.frame,
        this.data,
        this.title,
      );
    }

    /* The width of the frame, which leaves room for the axis' name and the longest number beside it. It
       is not given back where the numbers are shorter: a frame that widens and narrows is not at rest. */
    wide([y0, y1], marks = ticks) {
      const longest = Math.max(...marks(y0, y1).map((y) => shown(y, marks).length));
      this.left = Math.max(this.left, 24 + LETTER * longest);
      return SIZE.width - this.left - SIZE.right;
    }

    /* What lies between two values on each axis, and where a value is in the picture. */
    frameFor([x0, x1], [y0, y1], { marks: across } = LINEAR, { marks: upwards } = LINEAR) {
      const { width, height, right, top, bottom } = SIZE;
      const wide = this.wide([y0, y1], upwards);
      const { left } = this;
      const X = (x) => left + ((x - x0) / (x1 - x0)) * wide;
      const Y = (y) => height - bottom - ((y - y0) / (y1 - y0)) * (height - top - bottom);
      this.inside.setAttribute("x", left);
      this.inside.setAttribute("width", wide);
      this.title.setAttribute("x", left + 6);
      const frame = [];
      for (const x of across(x0, x1)) {
        frame.push(svg("line", { x1: X(x), x2: X(x), y1: top, y2: height - bottom }));
        const words = shown(x, across);
        const last = width - (LETTER * words.length) / 2; // no number goes over the edge
        frame.push(svg("text", { x: Math.min(X(x), last), y: height - bottom + 13, "text-anchor": "middle" }, words));
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

    /* Where a pointer is, as shares of the frame. */
    pointed(event) {
      const { width, height, right, top, bottom } = SIZE;
      const box = this.element.getBoundingClientRect();
      const x = ((event.clientX - box.left) * width) / box.width;
      const y = ((event.clientY - box.top) * height) / box.height;
      return [(x - this.left) / (width - this.left - right), (height - bottom - y) / (height - top - bottom)];
    }

    line(points, kind, { X, Y }) {
      return svg("polyline", { class: kind, points: points.map(([x, y]) => `${X(x).toFixed(1)},${Y(y).toFixed(1)}`).join(" ") });
    }

    draw(xs, ys, parts, title, told, across = LINEAR) {
      const places = this.frameFor(xs, ys, across);
      const { X, Y } = places;
      const scale = X(1) - X(0);
      const drawn = {
        line: ({ points, kind }) => this.line(points, kind, places),
        cross: ({ at: [x, y], kind }) => svg("path", { class: kind, d: `M${X(x) - 5} ${Y(y) - 5}l10 10m0 -10l-10 10` }),
        circle: ({ at: [x, y], radius, kind }) => svg("circle", { class: kind, cx: X(x), cy: Y(y), r: radius * scale }),
        discs: ({ discs, kind }) => {
          const round = ([[x, y], radius]) => {
            const r = radius * scale;
            return `M${X(x) - r} ${Y(y)}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0`;
          };
          return svg("path", { class: kind, d: discs.map(round).join("") });
        },
        arrow: ({ from, to, kind }) => {
          const angle = (Math.atan2(Y(to[1]) - Y(from[1]), X(to[0]) - X(from[0])) * 180) / Math.PI;
          return svg("path", { class: kind, d: "M4 0l-8 -4.5v9z", transform: `translate(${X(to[0])} ${Y(to[1])}) rotate(${angle})` });
        },
        band: ({ from: [x0, y0], to: [x1, y1], kind }) => svg("rect", { class: kind, x: X(x0), y: Y(y1), width: X(x1) - X(x0), height: Y(y0) - Y(y1) }),
        dot: ({ at: [x, y], kind }) => svg("circle", { class: kind, cx: X(x), cy: Y(y), r: 5 }),
        words: ({ at: [x, y], by = [0, 0], words, kind = "", anchor = "middle" }) =>
          svg("text", { class: kind, x: X(x) + by[0], y: Y(y) + by[1], "text-anchor": anchor }, words),
      };
      this.data.replaceChildren(...parts.map((part) => drawn[part.draw](part)));
      this.title.textContent = title;
      this.element.setAttribute("aria-label", told);
    }
  }

  /* The stability chart, with a point that is moved by mouse, finger and arrow keys. It is a stack of
     bars: the stable filters at each height, which are found in the background, as the borders are. */
  class Chart extends Plot {
    constructor(range, move) {
      super("Chart", "filter’s time constant λ in s", "");
      this.range = range;
      this.move = move;
      this.height = svg("line", { class: "height", x2: SIZE.width - SIZE.right, "pointer-events": "none" });
      this.handle = grip();
      this.here = svg("circle", { class: "here", r: 6, "pointer-events": "none" });
      this.element.append(this.height, this.handle, this.here);
      for (const [name, value] of Object.entries({ role: "slider", tabindex: 0, class: "chart" })) this.element.setAttribute(name, value);
      held(this.element, (event) => this.follow(event), (event) => event.pointerType === "mouse" || event.target === this.handle);
      this.element.addEventListener("click", (event) => this.follow(event));
      this.element.addEventListener("keydown", (event) => {
        const way = KEYS[event.key];
        if (!way) return;
        event.preventDefault();
        this.to(this.shares.map((share, k) => share + (event.shiftKey ? 10 : 1) * way[k]));
      });
    }

    get axes() {
      return ["lambda", this.upwards].map((name) => ({ name, ...scaleOf(name), ends: this.range[name].map(scaleOf(name).inner) }));
    }

    follow(event) {
      this.to(this.pointed(event));
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
        this.done = false;
        const wanted = () => key === this.key;
        const took = (piece) => piece && this.data.append(piece);
        setTimeout(() => worked(this.pieces(parameters, setAt), wanted, took, () => (this.done = true)));
      }
      const [x, y] = [lambda, up].map((value, k) => this.axes[k].inner(value));
      this.shares = [x, y].map((value, k) => {
        const [a, b] = this.axes[k].ends;
        return (value - a) / (b - a);
      });
      const { X, Y } = this.places;
      for (const [end, value] of Object.entries({ x1: this.left, y1: Y(y), y2: Y(y) })) this.height.setAttribute(end, value);
      for (const circle of [this.handle, this.here]) {
        circle.setAttribute("cx", X(x));
        circle.setAttribute("cy", Y(y));
      }
      const [low, high] = this.range.lambda;
      const told = `${named("lambda", lambda)}, ${named(upwards, up)}: ${plural(Z, "root", "roots")} in the right half plane`;
      for (const [name, value] of Object.entries({ valuemin: low, valuemax: high, valuenow: lambda, valuetext: told })) this.element.setAttribute(`aria-${name}`, value);
    }

    /* What is to be drawn, piece by piece. */
    *pieces(parameters, setAt) {
      const { X, Y } = this.places;
      const [{ inner }, above] = this.axes;
      const [low, high] = this.range.lambda;
      for (const curve of nrdob.borders(parameters, this.upwards, this.range.lambda, this.range[this.upwards])) {
        yield curve && this.line(curve.map(({ lambda, up }) => [inner(lambda), above.inner(up)]), "border", this.places);
      }
      const [bottom, top] = above.ends;
      const tall = (top - bottom) / ROWS;
      for (let row = 0; row < ROWS; row++) {
        const foot = bottom + row * tall;
        for (const [from, to] of yield* setAt({ ...parameters, [this.upwards]: above.outer(foot + tall / 2) }, low, high)) {
          const [left, right] = [X(inner(from)), X(inner(to))];
          yield svg("rect", { class: "works", x: left, y: Y(foot + tall), width: right - left, height: Y(foot) - Y(foot + tall) });
        }
      }
    }
  }

  /* The step response, with a mark at the step that is moved along by mouse and finger. */
  class Steps extends Plot {
    constructor(output, last, move) {
      super("Step", "time in s", output);
      const { top, height, bottom } = SIZE;
      this.mark = svg("g", { class: "instant" }, svg("path", { d: `M0 ${top}V${height - bottom}M-6 1h12l-6 ${top - 1}z` }), grip({ cy: top }));
      this.element.append(this.mark);
      // In whole steps, as by the slider.
      const share = (event) => Math.round(STEPS * this.pointed(event)[0]) / STEPS;
      held(this.mark, (event) => move(Math.max(0, Math.min(LATEST, share(event))) * last));
    }

    frameFor(...how) {
      const places = super.frameFor(...how);
      this.mark.setAttribute("transform", `translate(${places.X(this.instant)})`);
      return places;
    }
  }

  class Explorable {
    constructor(figure) {
      this.given = JSON.parse(figure.dataset.explorable);
      this.kind = nrdob.kinds[this.given.kind];
      const { range, start, load, last, output = "y" } = this.given;
      this.first = { ...start, instant: 0 };
      this.plots = [new Plot("Nyquist", "real part", "imaginary part"), new Steps(output, last, (instant) => this.to({ instant }))];
      if (start.upwards) this.chart = new Chart(range, (moved) => this.to(moved));
      this.bar = svg("svg", { viewBox: "0 0 480 50", role: "img", class: "bar" });
      this.verdict = html("p", { className: "explorable-verdict" });
      this.facts = html("p", { className: "explorable-facts" });
      this.words = html("p", { className: "explorable-set" });
      // What is heard: one sentence, when the hand rests.
      this.live = html("p", { className: "visually-hidden" });
      this.live.setAttribute("role", "status");
      const [curve] = Object.keys(this.kind.curves);
      this.state = { ...this.first, curve, signal: load ? "delta" : "d" };
      const still = figure.querySelector(".explorable-still");
      const plots = this.plots.map((plot) => plot.element);
      if (load) plots.reverse();
      const filters = [html("p", { className: "explorable-bar-name" }, this.kind.said), this.bar];
      if (this.chart) {
        plots.unshift(this.chart.element);
        plots.push(html("div", {}, ...filters.splice(0), this.words));
      }
      this.board = html(
        "div",
        { className: "explorable-board" },
        html("div", { className: "explorable-sight" }, this.verdict, this.tabs(), html("div", { className: "explorable-plots" }, ...plots)),
        ...filters,
        html("div", { className: "explorable-controls" }, ...Object.entries(range).map((each) => this.slider(...each))),
        this.facts,
        html("div", { className: "explorable-controls explorable-choices" }, this.choice("Curve", "curve", this.kind.curves), this.choice("Unit step", "signal", SIGNALS), this.slider("instant", [0, LATEST * last]), ...this.upwards(), this.back()),
        this.live,
      );
      this.see(this.chart ? "chart" : load ? "step" : "nyquist");
      this.hold();
      still.replaceWith(this.board);
      this.show();
    }

    /* On a phone one plot is seen at a time, so that it stands beside its sliders. */
    tabs() {
      const names = { ...(this.chart ? { chart: "Chart" } : {}), nyquist: "Nyquist curve", step: "Step response" };
      this.choices = Object.entries(names).map(([name, text]) => {
        const button = html("button", { type: "button", value: name }, text);
        button.addEventListener("click", () => this.see(name));
        return button;
      });
      const row = html("div", { className: "explorable-tabs" }, ...this.choices);
      row.setAttribute("role", "group");
      row.setAttribute("aria-label", "Plot that is shown");
      return row;
    }

    see(name) {
      this.board.dataset.seen = name;
      for (const button of this.choices) button.setAttribute("aria-pressed", button.value === name);
    }

    /* The mark on the bar is dragged, or set by a click: the slider for the keyboard is below. */
    hold() {
      const { bar } = this.kind;
      const [low, high] = this.given.range[bar];
      const follow = (event) => {
        const box = this.bar.getBoundingClientRect();
        const share = (((event.clientX - box.left) * 480) / box.width - 8) / 464;
        this.to({ [bar]: low * (high / low) ** Math.max(0, Math.min(1, share)) });
      };
      held(this.bar, follow);
    }

    slider(name, [low, high]) {
      const { label, unit = "", integer } = CONTROLS[name];
      const { inner, outer } = scaleOf(name);
      const id = `explorable-${name}-${Math.random().toString(36).slice(2, 8)}`;
      const input = html("input", { id, type: "range", min: inner(low), max: inner(high), step: integer ? 1 : (inner(high) - inner(low)) / STEPS });
      const shown = html("span", { className: "explorable-value" });
      shown.setAttribute("aria-hidden", "true"); // the slider says it
      const put = () => {
        input.value = inner(this.state[name]);
        shown.textContent = `${integer ? whole(this.state[name]) : written(this.state[name])} ${unit}`.trim();
        input.setAttribute("aria-valuetext", shown.textContent);
      };
      input.addEventListener("input", () => {
        this.to({ [name]: integer ? Math.round(input.valueAsNumber) : outer(input.valueAsNumber) });
      });
      (this.refresh ??= []).push(put);
      return html("div", { className: "explorable-slider" }, html("label", { htmlFor: id }, label), shown, input);
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
      const button = html("button", { type: "button" }, "Reset");
      button.addEventListener("click", () => this.to(this.first));
      return button;
    }

    show() {
      const started = performance.now();
      for (const put of this.refresh) put();
      const { curve, signal, instant, ...moved } = this.state; // the loop is the same for all of these
      const parameters = { ...moved, plant: this.given.plant };
      const loop = this.kind.loopOf(parameters);
      const found = nrdob.judge(loop);
      this.tell(found);
      this.nyquist(loop, found);
      this.step(loop, found);
      this.filters(parameters);
      this.chart?.show(parameters, found, this.setAt.bind(this));
      this.last = { ...this.last, found, set: this.set, time: performance.now() - started };
    }

    /* First in words, then in numbers. */
    tell({ N, P, Z, Ms, stable, modelStable, delayMargin }) {
      const word = stable ? "stable" : Number.isNaN(Z) ? "undecided" : "unstable";
      this.verdict.className = `explorable-verdict ${word}`;
      const more = this.state.delay || this.given.plant.delay ? "more dead time" : "of dead time";
      const why = stable
        ? Number.isFinite(delayMargin) ? `: tolerates ${said(delayMargin)} ${more}` : delayMargin === Infinity ? ": tolerates any dead time" : ""
        : Number.isNaN(Z) ? ": on the border" : Z === Infinity ? ": infinitely many roots in the right half plane"
        : Z > 0 ? `: ${plural(Z, "root", "roots")} in the right half plane` : ": the model’s own loop is";
      this.verdict.replaceChildren(html("strong", {}, word[0].toUpperCase() + word.slice(1)), why);
      const facts = [`N = ${whole(N)}`, `P = ${whole(P)}`, `Z = N + P = ${whole(Z)}`, ...(stable ? [`largest sensitivity Ms = ${written(Ms)}`] : [])];
      if (!modelStable && Z > 0) facts.push("the model’s own loop is unstable");
      this.facts.replaceChildren(...facts.flatMap((fact, k) => [k ? ", " : "", html("span", { className: "explorable-fact" }, fact)]));
      clearTimeout(this.speaking);
      const heard = `${this.verdict.textContent}. ${this.facts.textContent}.`;
      if (this.live.textContent || this.last) this.speaking = setTimeout(() => (this.live.textContent = heard), 600);
    }

    nyquist(loop, { N, P, Z }) {
      const { curve } = this.state;
      const [plot] = this.plots;
      const own = this.kind.pictures?.[curve];
      plot.names = own?.names ?? ["real part", "imaginary part"];
      if (own) {
        const { xs, ys, parts, title, told } = own.of(loop);
        return plot.draw(xs, ys, parts, title, told, own.log ? POWERS : LINEAR);
      }
      const map = nrdob[curve];
      const name = this.kind.curves[curve];
      const half = (SIZE.height - SIZE.top - SIZE.bottom) / 2;
      const coarse = nrdob.frequencies(loop, 200).map((omega) => map(loop, omega)).filter((z) => Math.hypot(...z) < 1e3);
      const [first] = coarse;
      const isPoint = coarse.length > 0 && coarse.every((z) => Math.hypot(z[0] - first[0], z[1] - first[1]) < 1e-9);
      const sizes = coarse.map((z) => Math.hypot(...z)).filter((size) => size < 6);
      const farthest = isPoint ? Math.hypot(...first) : Math.min(4, Math.max(0, ...sizes));
      const reach = Math.max(1.4, farthest) * 1.1;
      const ratio = plot.wide([-reach, reach]) / (2 * half);
      const parts = [{ draw: "circle", at: [0, 0], radius: 1, kind: "unit" }];
      let point = "";
      if (isPoint) {
        point = `${name} is the point ${written(Math.abs(first[0]) < 1e-9 ? 0 : first[0])}`;
        parts.push({ draw: "dot", at: first, kind: "point" }, { draw: "words", at: first, by: [0, -12], words: point });
      } else {
        const { runs, discs, hollow } = nrdob.traced(loop, map, curve, 1.3 * reach * Math.hypot(1, ratio), half / reach);
        const mirrored = discs.map(([[x, y], radius]) => [[x, -y], radius]);
        if (discs.length) parts.push({ draw: "discs", discs: [...discs, ...mirrored], kind: hollow ? "ring" : "filled" });
        for (const points of runs) parts.push({ draw: "line", points: points.map(([x, y]) => [x, -y]), kind: "mirror" });
        for (const points of runs) parts.push({ draw: "line", points, kind: "curve" });
        parts.push(...this.arrows(runs, reach, ratio), ...this.distance(runs));
      }
      plot.draw(
        [-reach * ratio, reach * ratio],
        [-reach, reach],
        [...parts, { draw: "cross", at: [-1, 0], kind: "minus-one" }, { draw: "words", at: [-1, 0], by: [-7, 15], words: "−1", kind: "minus-one" }],
        `Nyquist curve of ${name}`,
        `Nyquist plot of ${name}: ${point ? `${point}. ` : ""}N = ${whole(N)} clockwise encirclements of −1 by ${this.kind.curves[this.kind.counted]}, P = ${whole(P)}, Z = ${whole(Z)}.`,
      );
    }

    /* The way of growing ω, at a third and two thirds of what is seen. */
    arrows(runs, reach, ratio) {
      const seen = ([x, y]) => Math.abs(x) < 0.95 * reach * ratio && Math.abs(y) < 0.95 * reach && Math.hypot(x, y) > 0.12 * reach;
      const pieces = runs.flatMap((points) => points.slice(1).map((to, k) => ({ from: points[k], to })).filter(({ to }) => seen(to)));
      const lengths = pieces.map(({ from, to }) => Math.hypot(to[0] - from[0], to[1] - from[1]));
      const total = lengths.reduce((sum, x) => sum + x, 0);
      if (total < 0.2 * reach) return [];
      const arrows = [];
      let way = 0;
      pieces.forEach((piece, k) => {
        const before = way;
        way += lengths[k];
        for (const share of [0.3, 0.7]) if (before <= share * total && way > share * total) arrows.push({ draw: "arrow", ...piece, kind: "arrow" });
      });
      return arrows;
    }

    /* How near the curve comes to −1. */
    distance(runs) {
      let nearest = null;
      for (const points of runs) {
        for (const z of points) {
          const away = Math.hypot(z[0] + 1, z[1]);
          if (!nearest || away < nearest.away) nearest = { z, away };
        }
      }
      if (!nearest || nearest.away > 1.2 || nearest.away < 0.02) return [];
      return [{ draw: "line", points: [[-1, 0], nearest.z], kind: "distance" }];
    }

    step(loop, { stable }) {
      const { signal, instant } = this.state;
      const { last, load = 1 } = this.given;
      const before = instant ? [[0, 0], [instant, 0]] : [];
      const size = signal === "delta" ? load : 1;
      const answer = (of) => {
        const found = this.kind.step(of, signal, last);
        if (!found) return [];
        const after = Array.from(found.time, (t, k) => [instant + t, size * found.y[k]]);
        return [...before, ...thinned(after.filter(([t, y]) => t < last * (1 + 1e-9) && Number.isFinite(y)))];
      };
      const points = answer(loop);
      const plain = load !== 1 && (signal === "delta" || signal === "d") ? answer(nrdob.plain(loop, this.given.plant)) : [];
      const seen = [...points, ...plain].map(([, y]) => Math.max(-3, Math.min(3, y)));
      const [low, high] = load < 0 && signal === "delta" ? [Math.min(-1.1, ...seen), Math.max(0.3, ...seen)] : [Math.min(-0.1, ...seen), Math.max(1.1, ...seen)];
      const margin = 0.05 * (high - low);
      // What grows is followed to where it leaves the picture.
      const leaves = stable ? -1 : points.findIndex(([, y]) => y > high + margin || y < low - margin);
      const shown = leaves < 0 ? points : points.slice(0, leaves + 1);
      const end = points.length ? points[points.length - 1][1] : NaN;
      const parts = [{ draw: "line", points: shown, kind: stable ? "curve" : "curve lost" }];
      if (plain.length) {
        const [, alone] = plain[plain.length - 1];
        // Each name stands over the end of its curve, or under it, where the other one is just above.
        const words = (text, y, other, kind) => {
          const under = y < other && y > other - 0.15 * (high - low);
          const at = Math.max(low + margin, Math.min(high - margin, y));
          return { draw: "words", at: [last, at], by: [-6, under ? 14 : -6], words: text, kind, anchor: "end" };
        };
        parts.unshift({ draw: "line", points: plain, kind: "plain" });
        parts.push(words("without the observer", alone, stable ? end : NaN, "plain"));
        if (stable) parts.push(words("with it", end, alone, "with"));
      }
      const what = size === 1 ? `a unit step ${SIGNALS[signal]}` : `a load of ${written(-size)} N m`;
      this.plots[1].instant = instant;
      this.plots[1].draw(
        [0, last],
        [low - margin, high + margin],
        parts,
        size === 1 ? `y after a step ${SIGNALS[signal]}` : "",
        `Output y after ${what}${instant ? ` at ${said(instant)}` : ""}: ${stable ? `${written(end)} after ${written(last)} seconds` : "it grows, the loop is unstable"}.${plain.length ? ` Without the observer ${written(plain[plain.length - 1][1])}.` : ""}`,
      );
    }

    *setAt(parameters, low, high) {
      const { model } = this.kind.loopOf(parameters);
      return nrdob.onTheRight(model) ? [] : yield* this.kind.stabilizing(parameters, low, high);
    }

    filters(parameters) {
      const { bar } = this.kind;
      const [low, high] = this.given.range[bar];
      const { [bar]: present, ...rest } = parameters;
      const key = JSON.stringify(rest);
      if (key !== this.key) {
        this.key = key;
        this.ready = false;
        const done = (set) => {
          [this.set, this.ready] = [set, true];
          this.last.set = set;
          this.drawBar();
        };
        // The first part at once, so that what is quick does not lag behind.
        this.last ??= {};
        worked(this.setAt(parameters, low, high), () => key === this.key, () => {}, done);
      }
      this.drawBar();
    }

    drawBar() {
      const { bar } = this.kind;
      const [low, high] = this.given.range[bar];
      const { unit } = CONTROLS[bar];
      const present = this.state[bar];
      this.set ??= [];
      this.bar.classList.toggle("pending", !this.ready);
      const X = (x) => 8 + (464 * Math.log(x / low)) / Math.log(high / low);
      const parts = [svg("rect", { class: "ground", x: 8, y: 8, width: 464, height: 12, rx: 3 })];
      for (const [from, to] of this.set) parts.push(svg("rect", { class: "works", x: X(from), y: 8, width: Math.max(1, X(to) - X(from)), height: 12, rx: 3 }));
      for (let x = 10 ** Math.ceil(Math.log10(low) - 1e-9); x <= high * 1.001; x *= 10) {
        parts.push(svg("line", { class: "tick", x1: X(x), x2: X(x), y1: 20, y2: 25 }));
        parts.push(svg("text", { x: X(x), y: 43, "text-anchor": X(x) > 460 ? "end" : "middle" }, `${written(x)} ${unit}`));
      }
      const at = Math.max(8, Math.min(472, X(present)));
      parts.push(svg("path", { class: "present", d: `M${at} 2v24m-5 -24h10` }));
      const told = this.set.length
        ? this.set.map(([a, b]) => `from ${a <= low * 1.0001 ? "the left end" : `${written(a)} ${unit}`} to ${b >= high * 0.9999 ? "the right end" : `${written(b)} ${unit}`}`).join(" and ")
        : "nowhere in this range";
      this.bar.setAttribute("aria-label", `${this.kind.said} ${told}. The present one is ${written(present)} ${unit}.`);
      this.bar.replaceChildren(...parts);
      const { upwards } = this.state;
      const words = upwards && `${named(upwards, this.state[upwards])}: stable for λ ${told}.`;
      if (words && words !== this.words.textContent) this.words.textContent = words;
    }
  }

  const start = () => {
    nrdob.explorables = [...document.querySelectorAll("[data-explorable]")].map((figure) => new Explorable(figure));
    // Those who move by the Tab key need not pass all the links before.
    const slider = document.querySelector(".explorable-slider input");
    if (slider) document.querySelector(".skip-link")?.append(" · ", html("a", { href: `#${slider.id}` }, "Skip to the sliders"));
  };
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", start);
  else start();
})();
