/* What can be moved on the page: sliders, two plots, the bar of stabilising filters, the verdict.
   Numbers come from loop.js; without a script the still picture inside stays. A move is answered at
   once by verdict and plots; bar and chart follow in the background, a few milliseconds at a time. */
(() => {
  "use strict";

  const { CONTROLS, LATEST, LINEAR, POWERS, SIZE, STEPS, Chart, Plot, Steps, held, named, plural, said, scaleOf, svg, whole, worked, written } = nrdob.plots;

  const SIGNALS = { R: "of the reference R", d: "of d at the output", delta: "of δ at the input", eta: "of the noise η" };
  const UPWARDS = ["delay", "gain"]; // of a chart

  const html = (tag, properties = {}, ...children) => {
    const element = Object.assign(document.createElement(tag), properties);
    element.append(...children);
    return element;
  };

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

  const bounded = (y) => Math.max(-3, Math.min(3, y));

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
      Object.assign(this.first, { curve, signal: load ? "delta" : "d" });
      this.state = { ...this.first };
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
        html("div", { className: "explorable-controls explorable-choices" }, this.choice("Curve", "curve", this.kind.curves), this.choice("Step", "signal", SIGNALS), this.slider("instant", [0, LATEST * last]), ...this.upwards(), this.back()),
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
      const { last, load = 1, output = "y" } = this.given;
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
      // Of a stable loop all is seen; what grows is followed to where it leaves the picture.
      const seen = [...points.map(([, y]) => (stable ? y : bounded(y))), ...plain.map(([, y]) => bounded(y))];
      const [low, high] = load < 0 && signal === "delta" ? [Math.min(-1.1, ...seen), Math.max(0.3, ...seen)] : [Math.min(-0.1, ...seen), Math.max(1.1, ...seen)];
      const margin = 0.05 * (high - low);
      const followed = (curve) => {
        const leaves = curve.findIndex(([, y]) => y > high + margin || y < low - margin);
        return leaves < 0 ? curve : curve.slice(0, leaves + 1);
      };
      const end = points.length ? points[points.length - 1][1] : NaN;
      // Beside another curve each keeps its colour.
      const parts = [{ draw: "line", points: followed(points), kind: stable || plain.length ? "curve" : "curve lost" }];
      if (plain.length) {
        const ending = ([, y]) => Math.max(low + margin, Math.min(high - margin, y));
        const [mine, alone] = [points, plain].map((curve) => ending(followed(curve).at(-1)));
        // Each name stands over the end of its curve, or under it, where the other one is just above.
        const words = (text, at, other, kind) => {
          const under = at < other && at > other - 0.15 * (high - low);
          return { draw: "words", at: [last, at], by: [-6, under ? 14 : -6], words: text, kind, anchor: "end" };
        };
        parts.unshift({ draw: "line", points: followed(plain), kind: "plain" });
        parts.push(words("controller alone", alone, mine, "plain"), words("with the observer", mine, alone, "with"));
      }
      const what = size === 1 ? `a unit step ${SIGNALS[signal]}` : `a load of ${written(-size)} N m`;
      this.plots[1].instant = instant;
      this.plots[1].names[1] = signal === "R" || signal === "eta" ? "y" : output;
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
    if (slider) document.querySelector(".skip-link")?.append(html("a", { href: `#${slider.id}` }, "Skip to the sliders"));
  };
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", start);
  else start();
})();
