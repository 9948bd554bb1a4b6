/* The loop on a processor, in the browser. Behind its hold the process is a fraction in z, and in the
   plane of w = (2/T)(z - 1)/(z + 1) Tustin's blocks are what they were in s: the formulas of loop.js
   hold with the held process in the place of the plant, and with the unit circle as their axis. Times
   are counted in halves of T, so that z = (1 + w)/(1 - w). */
(() => {
  "use strict";

  const { between, criticalTimeConstants, expm, joined, lags, plantOf, plus, product, times } = nrdob.parts;

  /* States of N/D without direct path: x' = A x + B u, y = C x. */
  const realised = (N, D) => {
    const n = D.length - 1;
    const full = [...new Array(Math.max(0, n - N.length)).fill(0), ...N].map((a) => a / D[0]);
    const A = Array.from({ length: n }, (_, i) =>
      Array.from({ length: n }, (_, k) => (i === 0 ? -D[k + 1] / D[0] : +(k === i - 1))),
    );
    return { A, B: Array.from({ length: n }, (_, i) => [+(i === 0)]), C: [full] };
  };
  /* exp(A t), and what an input held for a time t leaves behind. */
  const held = ({ A, B }, t) => {
    const n = A.length;
    const whole = expm([...A.map((row, i) => [...row, B[i][0]].map((a) => a * t)), new Array(n + 1).fill(0)]);
    return { Phi: whole.slice(0, n).map((row) => row.slice(0, n)), Gamma: whole.slice(0, n).map((row) => [row[n]]) };
  };
  /* One sample with a dead time of k + f samples: what came in k + 1 samples ago acts for f T first. */
  const sampledPlant = ({ N, D, theta }, T) => {
    const states = realised(N, D);
    const k = Math.floor(theta / T + 1e-9);
    const f = Math.max(0, theta / T - k);
    const { Phi } = held(states, T);
    const late = held(states, (1 - f) * T);
    const early = product(late.Phi, held(states, f * T).Gamma);
    return { ...states, Phi, late: late.Gamma, early, k, f };
  };
  /* C adj(zI - Phi) Gamma and det(zI - Phi), by Faddeev and LeVerrier. */
  const fraction = ({ Phi, C }, gammas) => {
    const n = Phi.length;
    let M = Phi.map((_, i) => Phi.map((_, k) => +(i === k)));
    const den = [1];
    const nums = gammas.map(() => []);
    for (let i = 1; i <= n; i++) {
      gammas.forEach((Gamma, g) => nums[g].push(product(C, product(M, Gamma))[0][0]));
      const next = product(Phi, M);
      const c = -next.reduce((sum, row, k) => sum + row[k], 0) / i;
      den.push(c);
      M = next.map((row, r) => row.map((x, k) => x + (r === k ? c : 0)));
    }
    return { nums, den };
  };
  /* A polynomial in x where x = (a + b y)/(c + d y), times (c + d y)^n. */
  const mapped = (p, n, above, below) => {
    const power = (q, k) => (k ? times(...new Array(k).fill(q)) : [1]);
    return p
      .map((a, i) => times([a], power(above, p.length - 1 - i), power(below, n - p.length + 1 + i)))
      .reduce(plus, [0]);
  };

  const loopOf = (at) => {
    const { T } = at;
    const process = sampledPlant(plantOf(at), T);
    const { nums, den } = fraction(process, [process.late, process.early]);
    const num = process.f > 1e-9 ? plus([...nums[0], 0], nums[1]) : nums[0];
    const behind = [...den, ...(process.f > 1e-9 ? [0] : [])];
    const n = behind.length - 1;
    // Whole samples of dead time are 1/z^k, which only turns.
    const plant = { N: mapped(num, n, [1, 1], [-1, 1]), D: mapped(behind, n, [1, 1], [-1, 1]), theta: 0, held: process.k };
    const inHalves = (p) => p.map((a, i) => a * (2 / T) ** (p.length - 1 - i));
    const blocks = Object.fromEntries(["Nm", "Dm", "Nc", "Dc"].map((name) => [name, inHalves(at.plant[name])]));
    const lambda = (2 * at.lambda) / T;
    const filter = lags({ ...at, lambda });
    return { ...joined(plant, blocks, filter), at, process, lambda, order: at.order };
  };

  const stabilizing = function* (given, low, high) {
    const half = given.T / 2;
    const loopAt = (lambda) => loopOf({ ...given, lambda });
    const found = yield* criticalTimeConstants(loopAt(low), low / half, high / half);
    return yield* between(found.map(({ x, right }) => ({ x: x * half, right })), low, high, loopAt);
  };

  const MOST_SAMPLES = 4000;
  const WITHIN = 400;

  /* y after a unit step, between the samples as well: a u = b R - c (y + η), sample by sample. */
  const step = (loop, input, last) => {
    const { at, process } = loop;
    const { T, plant } = at;
    const samples = Math.ceil(last / T);
    if (samples > MOST_SAMPLES) return null;
    const { Df, E } = lags(at);
    const { Nm, Dm, Nc, Dc } = plant;
    const model = plus(times(Dm, Dc), times(Nm, Nc));
    const back = [times(model, Nm, E), times(Nc, Dm, Nm, Df), times(Dm, model)];
    const n = Math.max(...back.map((p) => p.length)) - 1;
    // w = 2(z - 1)/(T(z + 1)); a, b and c in descending powers of z.
    const [a, b, c] = back.map((p) => mapped(p, n, [2 / T, -2 / T], [1, 1]));
    const full = (p) => [...new Array(n + 1 - p.length).fill(0), ...p];
    const [fa, fb, fc] = [a, b, c].map(full);
    const on = (name) => +(input === name);
    const fine = Math.max(1, Math.ceil(WITHIN / samples));
    const part = Array.from({ length: fine }, (_, i) => i / fine);
    const u = [];
    const heard = [];
    const time = [];
    const y = [];
    let x = process.A.map(() => [0]);
    const sent = (k) => (k < 0 ? 0 : u[k] + on("delta"));
    const out = (state) => product(process.C, state)[0][0];
    // δ = 1 from t = 0 on is what the processor would have sent all the same.
    for (let k = 0; k <= samples; k++) {
      heard.push(out(x) + on("d") + on("eta"));
      let sum = 0;
      for (let i = 0; i <= n && i <= k; i++) {
        if (i) sum -= fa[i] * u[k - i];
        sum += fb[i] * on("R") - fc[i] * heard[k - i];
      }
      u.push(sum / fa[0]);
      const [now, before] = [sent(k - process.k), sent(k - process.k - 1)];
      for (const share of part) {
        const t = share * T;
        const first = Math.min(t, process.f * T);
        let state = advance(process, x, before, first);
        if (t > first) state = advance(process, state, now, t - first);
        time.push((k + share) * T);
        y.push(out(state) + on("d"));
      }
      x = add(product(process.Phi, x), add(scaled(process.late, now), scaled(process.early, before)));
    }
    const kept = time.findIndex((t) => t > last * (1 + 1e-9));
    return kept < 0 ? { time, y } : { time: time.slice(0, kept), y: y.slice(0, kept) };
  };
  const scaled = (M, factor) => M.map((row) => row.map((a) => a * factor));
  const add = (P, Q) => P.map((row, i) => row.map((a, k) => a + Q[i][k]));
  const advance = (process, x, u, t) => {
    let known = process.moves?.get(t);
    if (!known) {
      known = held(process, t);
      (process.moves ??= new Map()).set(t, known);
    }
    return add(product(known.Phi, x), scaled(known.Gamma, u));
  };

  nrdob.kinds.sampled = {
    loopOf,
    stabilizing,
    step,
    curves: nrdob.kinds.lags.curves,
    counted: "FH",
    bar: "lambda",
    said: "The sampled loop is stable for these λ:",
  };
})();
