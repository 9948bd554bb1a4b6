/* A proof that p_B has as many roots in the right half plane as is said: pieces of the imaginary axis
   on which p_B keeps to a half plane, by Taylor's formula, as a certificate of the package has them.
   Here it is computed with rounding, so it is a picture; the package's checker takes fractions. */
(() => {
  "use strict";

  const { abs, arg, plus } = nrdob.parts;

  const MOST = 400; // pieces
  const derived = (p) => p.slice(0, -1).map((a, k) => a * (p.length - 1 - k));
  /* What stands beside exp(-θs) in the derivative of r exp(-θs). */
  const lateDerived = (r, theta) => plus(derived(r), r.map((a) => -theta * a));
  const size = (p, omega) => p.reduce((total, a) => total * omega + Math.abs(a), 0);

  /* The angle that is the same but for whole turns, and the nearest to the last one. */
  const followed = (last, angle) => last + Math.atan2(Math.sin(angle - last), Math.cos(angle - last));

  /* From ω to ω: { from, to, middle }, the half plane around the direction `middle`, in rad, followed
     from p_B(0); and the roots that they count. Or null where there is no proof. */
  const halfPlanes = (loop) => {
    const { q, r, theta } = loop;
    const [q1, r1] = [derived(q), lateDerived(r, theta)];
    const [q2, r2] = [derived(q1), lateDerived(r1, theta)];
    const n = q.length - 1;
    const rest = (omega) => size(q.slice(1), omega) + size(r, omega);
    let last = 1e-3;
    while (last < 1e9 && Math.abs(q[0]) * last ** n <= rest(last)) last *= 2;
    const f = (omega, p, d) => nrdob.characteristic({ ...loop, q: p, r: d }, omega);
    const start = f(0, q, r)[0];
    if (last >= 1e9 || !start) return null;
    const pieces = [];
    const waiting = [[0, last]];
    while (waiting.length) {
      const [a, b] = waiting.pop();
      const [m, half] = [(a + b) / 2, (b - a) / 2];
      const [x, y] = f(m, q, r);
      const [u, v] = f(m, q1, r1);
      const length = abs([x, y]);
      const slope = Math.abs(y * u - x * v) / (length || 1); // of Re(conj(direction) j f')
      if (length > half * slope + (half * half * (size(q2, b) + size(r2, b))) / 2) pieces.push({ from: a, to: b, angle: arg([x, y]) });
      else if (pieces.length + waiting.length > MOST || half < 1e-9 * last) return null;
      else waiting.push([m, b], [a, m]);
    }
    const of = (sign) => (sign < 0 ? Math.PI : 0);
    let turned = of(start);
    for (const piece of pieces) turned = piece.middle = followed(turned, piece.angle);
    const end = followed(turned, (n * Math.PI) / 2 + of(q[0]));
    return { pieces, roots: Math.round(n / 2 - (end - of(start)) / Math.PI) };
  };

  /* The phase of p_B, and the half planes to which pieces of the axis keep it. */
  const pictured = (loop) => {
    const found = halfPlanes(loop);
    if (!found) {
      const words = "no half planes: a root is on the axis, or too close";
      const told = "No proof: a root is on the imaginary axis, or too close to it.";
      return { xs: [-1, 1], ys: [-90, 90], parts: [{ draw: "words", at: [0, 0], words }], title: "", told };
    }
    const { pieces, roots } = found;
    const degrees = (x) => (180 * x) / Math.PI;
    const [low, high] = [Math.log10(pieces[0].to) - 0.5, Math.log10(pieces[pieces.length - 1].to)];
    const at = (omega) => Math.max(low, Math.log10(omega || 1e-300));
    const middles = pieces.map(({ middle }) => degrees(middle));
    const bands = pieces.map(({ from, to, middle }) => ({
      draw: "band",
      from: [at(from), degrees(middle) - 90],
      to: [at(to), degrees(middle) + 90],
      kind: "half-plane",
    }));
    let phase = pieces[0].middle;
    const points = Array.from({ length: 400 }, (_, k) => {
      const x = low + ((high - low) * k) / 399;
      phase = followed(phase, arg(nrdob.characteristic(loop, 10 ** x)));
      return [x, degrees(phase)];
    });
    const [of, so] = [`${pieces.length} piece${pieces.length === 1 ? "" : "s"}`, `${roots} root${roots === 1 ? "" : "s"}`];
    return {
      xs: [low, high],
      ys: [Math.min(...middles) - 100, Math.max(...middles) + 120],
      parts: [...bands, { draw: "line", points, kind: "curve" }],
      title: `${of}, so ${so} in Re s > 0`,
      told: `Phase of p_B on the imaginary axis: on each of ${of} it keeps to a half plane, so ${so} are in the right half plane.`,
    };
  };

  nrdob.halfPlanes = halfPlanes;
  const { lags } = nrdob.kinds;
  nrdob.kinds.proof = {
    ...lags,
    curves: { proof: "half planes of p_B", ...lags.curves },
    pictures: { proof: { names: ["ω in rad/s", "phase of p_B in degrees"], log: true, of: pictured } },
  };
})();
