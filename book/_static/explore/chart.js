/* The stability chart in the browser: the filter's λ across, and upwards the plant's dead time or its
   gain. On a border p_B has a root jω: with x = ωλ and R the plant over its model, without filter,

     E(x) = (1 + jx)^n - 1 = -k R(jω) exp(-jωθ).

   The roots z of (1 + z)^n = 1 are 0 and others on the left. So the angle of E, the sum of those of
   jx - z, grows with x for n > 1, and its size does for n < 7. At each ω the size gives x where θ is
   free, and the angle where k is: all borders are in closed form, but for one equation that rises. */
(() => {
  "use strict";

  const { abs, arg, logarithm, mul, overModel, phase, risen, turn, turning, zerosOf } = nrdob.parts;

  const POINTS = 1000; // frequencies of a chart
  const BESIDE = 2; // how far beside the chart λ is followed, as a factor
  const LONGEST = 0.01; // steps of a curve, against the chart
  const HALVINGS = 8;

  /* One after the other the curves of { lambda, up, omega } over a part of the plane, and null now and
     then, so that the page may answer; `upwards` is "delay" or "gain". */
  const borders = function* (at, upwards, [low, high], [bottom, top]) {
    const late = upwards === "delay";
    const loop = nrdob.loopOf({ ...at, lambda: Math.sqrt(low * high), ...(late ? { delay: 0 } : { gain: 1 }) });
    const zeros = zerosOf(at.order);
    const smooth = overModel(loop).ratio;
    const ratio = (omega) => mul(smooth(omega), turn(-phase(loop, omega)));
    const [least, most] = late ? [0, 0] : [bottom, top].map(Math.log);
    const sizes = new Map();
    const sizeOfR = (omega) => {
      if (!sizes.has(omega)) sizes.set(omega, Math.log(abs(ratio(omega))));
      return sizes.get(omega);
    };
    const ends = (omega) => [low / BESIDE, high * BESIDE].map((lambda) => Math.log(omega * lambda));
    const worth = (omega) => {
      const [first, last] = ends(omega).map((u) => logarithm(zeros, u).size - sizeOfR(omega));
      return first <= most + 1 && last >= least - 1;
    };
    /* What all curves have in common at a frequency: `psi`, the angle of -R, followed from `near`. */
    const placeAt = (omega, near) => {
      const R = ratio(omega);
      const psi = arg([-R[0], -R[1]]);
      const place = { omega, size: sizeOfR(omega), psi: psi + 2 * Math.PI * Math.round((near - psi) / (2 * Math.PI)) };
      const [first, last] = ends(omega);
      const edges = [logarithm(zeros, first), logarithm(zeros, last)];
      /* Where this is not on the chart, the place beside it where it leaves, with the side. */
      const solved = (name, slope, wanted) => {
        const side = edges[0][name] > wanted ? -1 : edges[1][name] < wanted ? 1 : 0;
        if (side) return { ...place, side, lambda: (side < 0 ? low / BESIDE : high * BESIDE), E: edges[(side + 1) / 2] };
        const rising = (u) => {
          const E = logarithm(zeros, u);
          return [E[name] - wanted, E[slope]];
        };
        const u = risen(rising, first, last);
        return { ...place, side, lambda: Math.exp(u) / omega, E: logarithm(zeros, u) };
      };
      const shared = late ? solved("size", "growth", place.size) : null;
      place.on = (m) => {
        const angle = place.psi + 2 * Math.PI * m;
        if (late) return { ...shared, up: (angle - shared.E.angle) / omega };
        const found = solved("angle", "turn", angle);
        return { ...found, up: Math.exp(found.E.size - place.size) };
      };
      return place;
    };
    const across = (p, q) => Math.log(q.lambda / p.lambda) / Math.log(high / low);
    const upward = (p, q) => (late ? (q.up - p.up) / (top - bottom) : Math.log(q.up / p.up) / Math.log(top / bottom));
    const apart = (p, q) => Math.hypot(across(p, q), upward(p, q));
    const height = (p) => upward({ up: bottom }, p);
    const seen = (p) => p.side === 0 && Math.abs(height(p) - 0.5) < 0.6;
    const beyond = (p, q) =>
      (p.side !== 0 && p.side === q.side) || Math.max(height(p), height(q)) < 0 || Math.min(height(p), height(q)) > 1;
    const between = (p, q, m, depth) => {
      if (depth === 0 || beyond(p, q) || apart(p, q) < LONGEST) return [q];
      const middle = placeAt(Math.sqrt(p.omega * q.omega), (p.psi + q.psi) / 2).on(m);
      return [...between(p, middle, m, depth - 1), ...between(middle, q, m, depth - 1)];
    };
    const runs = [];
    let psi = 0;
    let run = null;
    let looked = 0;
    for (const omega of turning({ ...loop, theta: loop.theta + (late ? top : 0) }, worth, POINTS)) {
      if (++looked % 100 === 0) yield null;
      if (!worth(omega)) {
        run = null;
        continue;
      }
      const place = placeAt(omega, psi);
      psi = place.psi;
      if (run) run.push(place);
      else runs.push((run = [place]));
    }
    for (const places of runs) {
      // Angles of E lie between 0 and nπ/2; a dead time takes ωθ from that of -R.
      const turns = places.map((p) => -p.psi / (2 * Math.PI));
      const reach = at.order / 4 + (late ? (top * places[places.length - 1].omega) / (2 * Math.PI) : 0);
      for (let m = Math.floor(Math.min(...turns)) - 1; m <= Math.max(...turns) + reach + 1; m++) {
        let last = null;
        let curve = null;
        const curves = [];
        for (const place of places) {
          if (++looked % 100 === 0) yield null;
          const here = place.on(m);
          for (const point of last ? between(last, here, m, HALVINGS) : [here]) {
            if (!seen(point)) curve = null;
            else if (!curve) curves.push((curve = [point]));
            else if (apart(curve[curve.length - 1], point) > LONGEST / 4) curve.push(point);
          }
          last = here;
        }
        yield* curves.filter((each) => each.length > 1);
      }
    }
  };

  nrdob.borders = borders;
})();
