/* Pictures that can be moved: a plot with its axes, the stability chart, and the step response. What
   is drawn in them is asked for in parts, by view.js and by each kind of loop. */
(() => {
  "use strict";

  const CONTROLS = {
    lambda: { label: "filter’s time constant λ", unit: "s", log: true },
    order: { label: "filter’s order n", integer: true },
    gain: { label: "plant’s gain over the model’s", log: true },
    lag: { label: "unknown lag", unit: "s" },
    zero: { label: "T of an unknown zero at 1/T", unit: "s" },
    delay: { label: "unknown dead time", unit: "s" },
    T: { label: "sampling time T", unit: "s", log: true },
    observer: { label: "observer’s bandwidth ωo", unit: "rad/s", log: true },
    controller: { label: "controller’s bandwidth ωc", unit: "rad/s", log: true },
    instant: { label: "the step comes at", unit: "s" },
  };
  // Where keys move the point of a chart, in shares of its width and height.
  const KEYS = {
    ArrowLeft: [-0.01, 0], ArrowRight: [0.01, 0], ArrowDown: [0, -0.01], ArrowUp: [0, 0.01],
    PageDown: [0, -0.1], PageUp: [0, 0.1], Home: [-1, 0], End: [1, 0],
  };
  const ROWS = 56; // bars in its stack
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

  nrdob.plots = { CONTROLS, LATEST, LINEAR, POWERS, SIZE, STEPS, Chart, Plot, Steps, held, named, plural, said, scaleOf, svg, whole, worked, written };
})();
