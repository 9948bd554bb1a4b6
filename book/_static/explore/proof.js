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

  Object.assign(nrdob, { followed, halfPlanes });
  nrdob.kinds.proof = { ...nrdob.kinds.lags, proof: true };
})();
