/* A proof that p_B has as many roots in the right half plane as is said: pieces of the imaginary axis
   on which p_B keeps to a half plane, by Taylor's formula, as a certificate of the package has them.
   Here it is computed with rounding, so it is a picture; the package's checker takes fractions. */
(() => {
  "use strict";

  const { abs, add, along, arg, late, mul } = nrdob.parts;

  const MOST = 400; // pieces
  const derived = (p) => p.slice(0, -1).map((a, k) => a * (p.length - 1 - k));
  const sum = (p, q, factor) => {
    const n = Math.max(p.length, q.length);
    const at = (r, k) => r[k - n + r.length] ?? 0;
    return Array.from({ length: n }, (_, k) => at(p, k) + factor * at(q, k));
  };
  const size = (p, omega) => p.reduce((total, a) => total * omega + Math.abs(a), 0);

  /* From ω to ω: { from, to, middle }, the half plane around the direction `middle`, in rad, followed
     from p_B(0); and the roots that they count. Or null where there is no proof. */
  const halfPlanes = (loop) => {
    const { q, r, theta } = loop;
    const [q1, r1] = [derived(q), sum(derived(r), r, -theta)];
    const [q2, r2] = [derived(q1), sum(derived(r1), r1, -theta)];
    const n = q.length - 1;
    const rest = (omega) => size(q.slice(1), omega) + size(r, omega);
    let last = 1e-3;
    while (last < 1e9 && Math.abs(q[0]) * last ** n <= rest(last)) last *= 2;
    const f = (omega, p, d) => add(along(p, omega), mul(along(d, omega), late(loop, omega)));
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
    let turned = start < 0 ? Math.PI : 0;
    const to = (angle) => (turned += Math.atan2(Math.sin(angle - turned), Math.cos(angle - turned)));
    for (const piece of pieces) piece.middle = to(piece.angle);
    const end = to((n * Math.PI) / 2 + (q[0] < 0 ? Math.PI : 0));
    return { pieces, roots: Math.round(n / 2 - (end - (start < 0 ? Math.PI : 0)) / Math.PI) };
  };

  nrdob.halfPlanes = halfPlanes;
  nrdob.kinds.proof = { ...nrdob.kinds.lags, proof: true };
})();
