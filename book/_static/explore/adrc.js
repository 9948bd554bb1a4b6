/* Linear ADRC of order 1 in the browser: an NR-DOB with the model b0/s and the filter
   F = (1 + s(1/ωc + 2/ωo)) / ((s/ωc + 1)(s/ωo + 1)²). The sliders are the bandwidths. */
(() => {
  "use strict";

  const { add, arg, between, crossed, div, joined, late, minus, mul, plantOf, sorted, times, turning, value, abs } = nrdob.parts;

  const filter = ({ observer, controller }) => {
    const [lambda, slow] = [1 / observer, 1 / controller];
    const Df = times([slow, 1], [lambda, 1], [lambda, 1]);
    return { Nf: Df.slice(2), Df, E: [...Df.slice(0, 2), 0, 0] };
  };
  const loopOf = (at) => {
    const { b0 } = at.plant;
    const blocks = { Nm: [b0], Dm: [1, 0], Nc: [at.controller], Dc: [b0] };
    return { ...joined(plantOf(at), blocks, filter(at)), lambda: 1 / at.observer };
  };

  /* At s = jω p_B is a quadratic in λ = 1/ωo; where one of its roots becomes real, λ is critical. */
  const critical = function* (at, low, high) {
    const { N, D, theta } = plantOf(at);
    const slow = 1 / at.controller;
    const quadratic = (omega) => {
      const s = [0, omega];
      const own = mul([at.plant.b0, 0], mul(value(D, s), mul(s, s)));
      const back = mul(mul(value(N, s), s), late({ theta }, omega));
      const a = mul(own, add([1, 0], mul([slow, 0], s)));
      const b = add(mul([2 * slow, 0], own), mul([2, 0], mul(back, s)));
      return [a, b, mul(back, add([1, 0], mul([slow, 0], s)))];
    };
    // No root is larger than 2 max(|b/a|, √|c/a|), and none smaller than the same of the inverse.
    const worth = (omega) => {
      const [a, b, c] = quadratic(omega).map(abs);
      return 2 * Math.max(b / a, Math.sqrt(c / a)) > 1 / high && 2 * Math.max(b / c, Math.sqrt(a / c)) > low;
    };
    const solved = (omega) => {
      const [a, b, c] = quadratic(omega);
      const inside = minus(mul(b, b), mul([4, 0], mul(a, c)));
      const size = Math.sqrt(Math.hypot(...inside));
      const half = arg(inside) / 2;
      const root = [size * Math.cos(half), size * Math.sin(half)];
      const twice = mul([2, 0], a);
      return [minus(root, b), minus([-root[0], -root[1]], b)].map((top) => div(top, twice));
    };
    const omegas = turning(loopOf({ ...at, observer: Math.sqrt(low * high) }), worth);
    // A root that goes to the right as λ grows goes to the left as ωo does.
    const found = (yield* crossed(omegas, worth, solved)).map(({ x, right }) => ({ x: 1 / x, right: -right }));
    return sorted(found, low, high);
  };
  const stabilizing = function* (at, low, high) {
    return yield* between(yield* critical(at, low, high), low, high, (observer) => loopOf({ ...at, observer }));
  };

  nrdob.kinds.adrc = {
    loopOf,
    stabilizing,
    step: nrdob.step,
    curves: { L: "L" }, // F·H of a model that integrates begins at -1
    counted: "L",
    bar: "observer",
    said: "The loop is stable for these bandwidths ωo of the observer:",
  };
})();
