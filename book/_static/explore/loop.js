/* An NR-DOB loop in the browser: verdict, margins, stabilising filters and step responses, from the
   same formulas as the package, which a test holds against it. Polynomials are arrays of
   coefficients in descending powers; s is in rad/s, times are in seconds.

   p_B = q + r exp(-θs) with q = D Ñ (Df - Nf), r = N D̃ Nf; as a rule F = Nf/Df = 1/(λs + 1)^n. */
(() => {
  "use strict";

  // --- Complex numbers are pairs [re, im]; polynomials ---------------------------------------

  const mul = (a, b) => [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]];
  const div = (a, b) => {
    const size = b[0] * b[0] + b[1] * b[1];
    return [(a[0] * b[0] + a[1] * b[1]) / size, (a[1] * b[0] - a[0] * b[1]) / size];
  };
  const add = (a, b) => [a[0] + b[0], a[1] + b[1]];
  const minus = (a, b) => [a[0] - b[0], a[1] - b[1]];
  const abs = (a) => Math.hypot(a[0], a[1]);
  const arg = (a) => Math.atan2(a[1], a[0]);
  const turn = (angle) => [Math.cos(angle), Math.sin(angle)];

  const times = (...factors) =>
    factors.reduce((p, q) => {
      const product = new Array(p.length + q.length - 1).fill(0);
      p.forEach((a, i) => q.forEach((b, k) => (product[i + k] += a * b)));
      return product;
    });
  /* A leading coefficient is gone where it cancels, not where the unit of time makes it small. */
  const plus = (p, q) => {
    const n = Math.max(p.length, q.length);
    const at = (r, i) => r[i - n + r.length] ?? 0;
    const sum = Array.from({ length: n }, (_, i) => at(p, i) + at(q, i));
    const first = sum.findIndex((a, i) => Math.abs(a) > 1e-13 * (Math.abs(at(p, i)) + Math.abs(at(q, i))));
    return first < 0 ? [0] : sum.slice(first);
  };
  const trimmed = (p) => {
    const first = p.findIndex((a) => a !== 0);
    return first < 0 ? [0] : p.slice(first);
  };
  const value = (p, s) => p.reduce((sum, a) => add(mul(sum, s), [a, 0]), [0, 0]);

  /* All roots at once, by Aberth's iteration in a unit of time that makes them of size one. */
  const roots = (given) => {
    let p = trimmed(given);
    const found = [];
    while (p.length > 1 && p[p.length - 1] === 0) {
      p = p.slice(0, -1);
      found.push([0, 0]);
    }
    const n = p.length - 1;
    if (n < 1) return found;
    const unit = Math.abs(p[n] / p[0]) ** (1 / n);
    p = p.map((a, i) => a * unit ** (n - i));
    p = p.map((a) => a / p[0]);
    const slope = p.slice(0, -1).map((a, i) => a * (n - i));
    let z = Array.from({ length: n }, (_, k) => turn((2 * Math.PI * k) / n + 0.4).map((x) => x * (1 + 0.1 * k / n)));
    for (let round = 0; round < 200; round++) {
      let moved = 0;
      z = z.map((at, i) => {
        const f = value(p, at);
        if (abs(f) === 0) return at;
        const newton = div(f, value(slope, at));
        const pull = z.reduce((sum, other, k) => {
          if (k === i) return sum;
          const gap = minus(at, other);
          return abs(gap) ? add(sum, div([1, 0], gap)) : sum;
        }, [0, 0]);
        const step = div(newton, minus([1, 0], mul(newton, pull)));
        if (!Number.isFinite(step[0] + step[1])) return at;
        moved = Math.max(moved, abs(step) / (abs(at) + 1e-300));
        return minus(at, step);
      });
      if (moved < 1e-14) break;
    }
    return found.concat(z.map((at) => at.map((x) => x * unit)));
  };

  // --- The loop ------------------------------------------------------------------------------

  const binomial = (n, lambda) => {
    let p = [1];
    for (let k = 0; k < n; k++) p = times(p, [lambda, 1]);
    return p;
  };
  const lessOne = (p) => [...p.slice(0, -1), p[p.length - 1] - 1];
  const lags = ({ order, lambda }) => {
    const Df = binomial(order, lambda);
    return { Nf: [1], Df, E: lessOne(Df) };
  };

  /* The plant as the sliders make it. */
  const plantOf = ({ plant, gain = 1, lag = 0, zero = 0, delay = 0 }) => ({
    N: times(plant.N.map((a) => a * gain), zero ? [-zero, 1] : [1]),
    D: times(plant.D, lag ? [lag, 1] : [1]),
    theta: plant.delay + delay,
  });

  /* Coefficients of everything, from a plant, the other blocks, and Nf, Df and E = Df - Nf. A factor
     s of both q and r cancels within the block (1 - F)G̃, and is left out of everything. */
  const joined = ({ N, D, theta }, { Nm, Dm, Nc, Dc }, { Nf, Df, E }) => {
    const model = plus(times(Dm, Dc), times(Nm, Nc));
    const whole = {
      q: times(D, Nm, E),
      r: times(N, Dm, Nf),
      fromR: times(N, Nc, Nm, Dm, Df),
      fromDelta: times(N, Nm, E),
    };
    while (whole.q[whole.q.length - 1] === 0 && whole.r[whole.r.length - 1] === 0) {
      for (const name of Object.keys(whole)) whole[name] = whole[name].slice(0, -1);
    }
    return { N, D, theta, Nm, Dm, Nf, Df, model, ...whole };
  };
  const loopOf = (at) => ({ ...joined(plantOf(at), at.plant, lags(at)), lambda: at.lambda, order: at.order });

  const late = (loop, omega) => turn(-omega * loop.theta);
  const characteristic = (loop, omega) => {
    const s = [0, omega];
    return add(value(loop.q, s), mul(value(loop.r, s), late(loop, omega)));
  };
  const FR = (loop, omega) => {
    const s = [0, omega];
    const before = times(loop.N, loop.Dm);
    const behind = times(loop.D, loop.Nm);
    return mul(mul(div(value(before, s), value(behind, s)), F(loop, omega)), late(loop, omega));
  };
  const F = (loop, omega) => div(value(loop.Nf, [0, omega]), value(loop.Df, [0, omega]));
  /* F·H with H = R - 1, and the plant's loop L = F R/(1 - F). */
  const FH = (loop, omega) => minus(FR(loop, omega), F(loop, omega));
  const H = (loop, omega) => div(FH(loop, omega), F(loop, omega));
  const L = (loop, omega) => {
    const s = [0, omega];
    return mul(div(value(loop.r, s), value(loop.q, s)), late(loop, omega));
  };

  const logspace = (low, high, count) => {
    const step = Math.log(high / low) / (count - 1);
    return Array.from({ length: count }, (_, k) => low * Math.exp(step * k));
  };
  /* Frequencies around everything that the loop knows of. */
  const frequencies = (loop, count) => {
    const speeds = [loop.D, loop.Nm, loop.N, loop.Dm].flatMap((p) => roots(p).map(abs));
    speeds.push(1 / loop.lambda);
    if (loop.theta) speeds.push(1 / loop.theta);
    const finite = speeds.filter((x) => x > 0);
    return logspace(Math.min(...finite) / 300, Math.max(...finite) * 300, count);
  };

  /* Roots of p_B in the right half plane, by the argument of p_B along the axis. */
  const countRight = (loop) => {
    const { q, r } = loop;
    const ratio = r.length > q.length ? Infinity : r.length === q.length ? Math.abs(r[0] / q[0]) : 0;
    if (loop.theta && ratio >= 1) return ratio > 1 ? Infinity : NaN;
    const whole = loop.theta ? q : plus(q, r);
    const alone = (omega) => value(whole, [0, omega]);
    const at = (omega) => add(alone(omega), loop.theta ? mul(value(r, [0, omega]), late(loop, omega)) : [0, 0]);
    const follow = (f, theta, low, fLow, high, fHigh, depth) => {
      const middle = (low + high) / 2;
      const fMiddle = f(middle);
      const first = arg(div(fMiddle, fLow));
      const second = arg(div(fHigh, fMiddle));
      const fits = Math.abs(first) + Math.abs(second) < 0.8 && (high - low) * theta < 1.5;
      if (fits || depth > 40) return first + second;
      return (
        follow(f, theta, low, fLow, middle, fMiddle, depth + 1) +
        follow(f, theta, middle, fMiddle, high, fHigh, depth + 1)
      );
    };
    // Above the last frequency at which the late term is half of the other, it turns nothing.
    const grid = frequencies(loop, 300);
    let bound = loop.theta ? grid.length - 1 : 0;
    while (bound > 0 && abs(value(r, [0, grid[bound]])) < 0.5 * abs(alone(grid[bound]))) bound--;
    let total = 0;
    let before = 0;
    let fBefore = at(0);
    grid.forEach((omega, i) => {
      const f = i <= bound + 1 && loop.theta ? at : alone;
      const here = f(omega);
      total += follow(f, f === at ? loop.theta : 0, before, fBefore, omega, here, 0);
      before = omega;
      fBefore = here;
      if (f === at && i === bound + 1) {
        fBefore = alone(omega);
        total += arg(div(fBefore, here));
      }
    });
    // Beyond the last frequency only the leading term is left.
    const leading = mul([whole[0], 0], powerOfJ(whole.length - 1));
    total += arg(div(leading, fBefore));
    return Math.round((whole.length - 1) / 2 - total / Math.PI);
  };
  const powerOfJ = (k) => [[1, 0], [0, 1], [-1, 0], [0, -1]][k % 4];

  const onTheRight = (p) => roots(p).filter((z) => z[0] > 1e-9 * (1 + abs(z))).length;

  /* N, P and Z of Lemma 1, and Ms where the loop is stable. */
  const judge = (loop) => {
    const Z = countRight(loop);
    const P = onTheRight(loop.D) + onTheRight(loop.Nm);
    const fromModel = onTheRight(loop.model);
    const stable = Z === 0 && fromModel === 0;
    return { N: Z - P, P, Z, stable, modelStable: fromModel === 0, Ms: stable ? peak(loop) : NaN };
  };

  /* Largest |S| = |q/p_B|. */
  const peak = (loop) => {
    const S = (x) => {
      const omega = Math.exp(x);
      return abs(div(value(loop.q, [0, omega]), characteristic(loop, omega)));
    };
    const grid = frequencies(loop, 1200).map(Math.log);
    const seen = grid.map(S);
    let best = Math.max(...seen, loop.theta ? 0 : atInfinity(loop.q, plus(loop.q, loop.r)));
    for (let k = 1; k + 1 < grid.length; k++) {
      if (seen[k] < seen[k - 1] || seen[k] < seen[k + 1] || seen[k] < 0.9 * best) continue;
      best = Math.max(best, golden(S, grid[k - 1], grid[k + 1]));
    }
    return best;
  };
  /* |p/q| where s is without bound. */
  const atInfinity = (p, q) => {
    const [above, below] = [trimmed(p), trimmed(q)];
    return above.length < below.length ? 0 : above.length > below.length ? Infinity : Math.abs(above[0] / below[0]);
  };
  const golden = (f, low, high) => {
    const share = (Math.sqrt(5) - 1) / 2;
    let [a, b] = [high - share * (high - low), low + share * (high - low)];
    let [fa, fb] = [f(a), f(b)];
    for (let round = 0; round < 40; round++) {
      if (fa > fb) {
        [high, b, fb] = [b, a, fa];
        a = high - share * (high - low);
        fa = f(a);
      } else {
        [low, a, fa] = [a, b, fb];
        b = low + share * (high - low);
        fb = f(b);
      }
    }
    return Math.max(fa, fb);
  };

  /* Of the values that a parameter would need for a root of p_B at jω, those that are real and
     positive: `solved` gives all of them, complex, and one after the other is followed, from one
     frequency to the next where it is worth it. */
  const crossed = (omegas, worth, solved) => {
    const found = [];
    let last = null;
    for (const omega of omegas) {
      if (!worth(omega)) {
        last = null;
        continue;
      }
      const roots = last ? inOrder(solved(omega), last.roots) : solved(omega);
      (last ? roots : []).forEach((x, k) => {
        if (last.roots[k][1] * x[1] >= 0 || Math.max(last.roots[k][0], x[0]) <= 0) return;
        let [a, b, old] = [last.omega, omega, last.roots];
        for (let round = 0; round < 60 && b - a > 1e-14 * b; round++) {
          const m = (a + b) / 2;
          const middle = inOrder(solved(m), old);
          if (old[k][1] * middle[k][1] <= 0) b = m;
          else [a, old] = [m, middle];
        }
        const [real, off] = inOrder(solved((a + b) / 2), old)[k];
        if (real > 0 && Math.abs(off) < 1e-6 * real) found.push(real);
      });
      last = { omega, roots };
    }
    return found;
  };
  /* Begin with another of the roots, so that each is nearest to what it was. */
  const inOrder = (roots, old) => {
    const from = (shift) => old.map((_, k) => roots[(k + shift) % roots.length]);
    const apart = (shift) => from(shift).reduce((sum, z, k) => sum + (z[0] - old[k][0]) ** 2 + (z[1] - old[k][1]) ** 2, 0);
    const away = old.map((_, shift) => apart(shift));
    return from(away.indexOf(Math.min(...away)));
  };
  const sorted = (found, low, high) => [...new Set(found.filter((x) => x > low && x < high))].sort((x, y) => x - y);

  /* The plant over the model, without the filter: R = W, of which p_B makes (1 + jωλ)^n = 1 - W. */
  const overModel = (loop) => {
    const [before, behind] = [times(loop.N, loop.Dm), times(loop.D, loop.Nm)];
    const ratio = (omega) => mul(div(value(before, [0, omega]), value(behind, [0, omega])), late(loop, omega));
    return { before: trimmed(before), behind: trimmed(behind), ratio };
  };

  /* Every λ in a range at which p_B has a root on the axis. Beyond |R| = (1 + ω²λ²)^(n/2) - 1 none is
     as large as the least λ asked for. */
  const criticalTimeConstants = (loop, low, high) => {
    const { order: n } = loop;
    const { before, behind, ratio } = overModel(loop);
    const worth = (omega) => abs(ratio(omega)) >= ((1 + (omega * low) ** 2) ** (n / 2) - 1) / 2;
    const solved = (omega) => {
      const W = minus([1, 0], ratio(omega));
      const size = abs(W) ** (1 / n);
      return Array.from({ length: n }, (_, k) => {
        const angle = (arg(W) + 2 * Math.PI * k) / n;
        return [(size * Math.sin(angle)) / omega, (1 - size * Math.cos(angle)) / omega];
      });
    };
    const found = crossed(turning({ ...loop, lambda: Math.sqrt(low * high) }, worth), worth, solved);
    // A root goes through infinity where the leading terms cancel: λ^n = -R/s^n.
    const c = -before[0] / behind[0];
    if (!loop.theta && before.length - behind.length === n && c > 0) found.push(c ** (1 / n));
    return sorted(found, low, high);
  };
  /* Frequencies at which nothing turns by much from one to the next, with the dead time. */
  const turning = function* (loop, worth, count = 800) {
    let before = 0;
    for (const omega of frequencies(loop, count)) {
      const parts = worth(omega) ? Math.min(200, Math.ceil(((omega - before) * loop.theta) / 0.25)) : 1;
      for (let k = 1; k < parts; k++) yield before + ((omega - before) * k) / parts;
      yield omega;
      before = omega;
    }
  };

  /* The stable intervals between two bounds: one count between each two critical values. */
  const between = (critical, low, high, loopAt) => {
    const ends = [low, ...critical, high];
    const found = [];
    for (let i = 1; i < ends.length; i++) {
      if (ends[i] / ends[i - 1] < 1 + 1e-9) continue;
      if (countRight(loopAt(Math.sqrt(ends[i - 1] * ends[i]))) !== 0) continue;
      const last = found[found.length - 1];
      if (last && last[1] === ends[i - 1]) last[1] = ends[i];
      else found.push([ends[i - 1], ends[i]]);
    }
    return found;
  };
  const stabilizing = (given, low, high) => {
    const loopAt = (lambda) => loopOf({ ...given, lambda });
    return between(criticalTimeConstants(loopAt(low), low, high), low, high, loopAt);
  };

  // --- Step responses --------------------------------------------------------------------------

  /* y after a unit step of R, d, δ or η: num/(den (q + r exp(-θs))), late by θ where the way is. */
  const MAPS = {
    R: (loop) => ({ num: loop.fromR, den: loop.model, late: 1 }),
    d: (loop) => ({ num: loop.q, den: [1], late: 0 }),
    delta: (loop) => ({ num: loop.fromDelta, den: [1], late: 1 }),
    eta: (loop) => ({ num: loop.r.map((a) => -a), den: [1], late: 1 }),
  };

  const MOST_STEPS = 6000;

  const expm = (A) => {
    const n = A.length;
    const norm = Math.max(...A.map((row) => row.reduce((sum, x) => sum + Math.abs(x), 0)));
    const halvings = Math.max(0, Math.ceil(Math.log2(norm || 1)) + 4);
    const small = A.map((row) => row.map((x) => x / 2 ** halvings));
    const unit = A.map((_, i) => A.map((_, k) => +(i === k)));
    let total = unit;
    let term = unit;
    for (let k = 1; k <= 12; k++) {
      term = product(term, small).map((row) => row.map((x) => x / k));
      total = total.map((row, i) => row.map((x, j) => x + term[i][j]));
    }
    for (let k = 0; k < halvings; k++) total = product(total, total);
    return total;
  };
  const product = (A, B) =>
    A.map((row) => B[0].map((_, k) => row.reduce((sum, x, i) => sum + x * B[i][k], 0)));

  /* March x with Q x = u - r x(t - θ), Q = den q, and give y = num x at `count` times up to `last`.
     The matrix exponential is exact for inputs that are linear within a step. */
  const step = (loop, input, last, count = 401) => {
    const map = MAPS[input](loop);
    let Q = times(map.den, loop.q);
    let back = times(map.den, loop.r);
    if (!loop.theta) [Q, back] = [plus(Q, back), [0]];
    let num = map.num;
    const n = Q.length - 1;
    // A unit of time in which the coefficients are of one size.
    const unit = Math.abs(Q[0] / (Q.find((a, i) => i === n && a) || Q[n - 1] || Q[0])) ** (1 / n) || 1;
    const scaled = (p) => {
      const full = [...new Array(n + 1 - p.length).fill(0), ...p];
      return full.map((a, i) => (a * unit ** i) / Q[0]);
    };
    [num, back, Q] = [scaled(num), scaled(back), scaled(Q)];
    const theta = loop.theta / unit;
    let h = last / unit / (count - 1);
    if (theta) {
      // What comes back is linear within a step: fine against the filter, and a part of θ.
      h = Math.max(Math.min(h, loop.lambda / unit / 15), last / unit / MOST_STEPS);
      h = theta / Math.ceil(theta / h);
    }
    const steps = Math.ceil(last / unit / h - 1e-9);
    if (steps > 4 * MOST_STEPS) return null; // a dead time too short to be seen here
    // Augmented with the input and its slope: [x, u, u'].
    const A = Array.from({ length: n + 2 }, (_, i) => {
      const row = new Array(n + 2).fill(0);
      if (i < n - 1) row[i + 1] = h;
      else if (i === n - 1) {
        for (let k = 0; k < n; k++) row[k] = -Q[n - k] * h;
        row[n] = h;
      } else if (i === n) row[n + 1] = h;
      return row;
    });
    const Phi = expm(A);
    const parts = theta ? Math.round(theta / h) : 0;
    let x = new Array(n).fill(0);
    const past = []; // what comes back after θ
    const y = [];
    const returned = (k) => (k < 0 ? 0 : past[k]);
    const force = (k) => 1 - returned(k - parts);
    for (let k = 0; k <= steps; k++) {
      const u = theta ? force(k) : 1;
      const highest = u - x.reduce((sum, value, i) => sum + Q[n - i] * value, 0);
      const all = [...x, highest];
      y.push(all.reduce((sum, value, i) => sum + num[n - i] * value, 0));
      if (theta) past.push(all.reduce((sum, value, i) => sum + back[n - i] * value, 0));
      const next = theta ? force(k + 1) : 1;
      const state = [...x, u, (next - u) / h];
      x = Array.from({ length: n }, (_, i) => Phi[i].reduce((sum, value, j) => sum + value * state[j], 0));
    }
    const shift = map.late ? parts : 0;
    const time = Array.from({ length: steps + 1 }, (_, k) => k * h * unit);
    const output = time.map((_, k) => (k < shift ? 0 : y[k - shift]));
    return { time, y: output };
  };

  window.nrdob = {
    loopOf, judge, stabilizing, step, FH, H, L, roots, frequencies, countRight,
    // For loops of another kind.
    parts: { abs, add, arg, between, criticalTimeConstants, crossed, div, expm, joined, lags, late, minus, mul, overModel, plantOf, plus, product, sorted, times, turn, turning, value },
  };
  /* What a page can move: how a loop is made, judged and answers, and what its bar is a set of. */
  window.nrdob.kinds = {
    // N counts turns of `counted` around -1.
    lags: { loopOf, stabilizing, step, counted: "FH", bar: "lambda", said: "Filters for which the loop is stable, by λ:" },
  };
})();
