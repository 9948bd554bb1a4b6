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
  /* The same at s = jω, where most of the time is spent. */
  const along = (p, omega) => {
    let [re, im] = [0, 0];
    for (let i = 0; i < p.length; i++) [re, im] = [p[i] - im * omega, re * omega];
    return [re, im];
  };
  const drained = (work) => {
    for (;;) {
      const { value: result, done } = work.next();
      if (done) return result;
    }
  };

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
  const joined = ({ N, D, theta, held = 0 }, { Nm, Dm, Nc, Dc }, { Nf, Df, E }) => {
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
    return { N, D, theta, held, Nm, Dm, Nf, Df, model, ...whole };
  };
  const loopOf = (at) => ({ ...joined(plantOf(at), at.plant, lags(at)), lambda: at.lambda, order: at.order });

  /* How far the dead time turns: ωθ, or of a processor's k samples, which are ((1 - w)/(1 + w))^k. */
  const phase = ({ theta, held }, omega) => omega * theta + (held ? 2 * held * Math.atan(omega) : 0);
  const late = (loop, omega) => turn(-phase(loop, omega));
  const characteristic = (loop, omega) => add(along(loop.q, omega), mul(along(loop.r, omega), late(loop, omega)));
  const FR = (loop, omega) => {
    loop.before ??= times(loop.N, loop.Dm, loop.Nf);
    loop.behind ??= times(loop.D, loop.Nm, loop.Df);
    return mul(div(along(loop.before, omega), along(loop.behind, omega)), late(loop, omega));
  };
  const F = (loop, omega) => div(along(loop.Nf, omega), along(loop.Df, omega));
  /* F·H with H = R - 1, and the plant's loop L = F R/(1 - F). */
  const FH = (loop, omega) => minus(FR(loop, omega), F(loop, omega));
  const H = (loop, omega) => div(FH(loop, omega), F(loop, omega));
  const L = (loop, omega) => mul(div(along(loop.r, omega), along(loop.q, omega)), late(loop, omega));

  const logspace = (low, high, count) => {
    const step = Math.log(high / low) / (count - 1);
    return Array.from({ length: count }, (_, k) => low * Math.exp(step * k));
  };
  /* Frequencies around everything that the loop knows of. */
  const frequencies = (loop, count) => {
    if (!loop.speeds) {
      const speeds = [loop.D, loop.Nm, loop.N, loop.Dm].flatMap((p) => roots(p).map(abs));
      loop.speeds = speeds.concat(1 / loop.lambda, loop.theta ? 1 / loop.theta : [], loop.held || []).filter((x) => x > 0);
    }
    return logspace(Math.min(...loop.speeds) / 300, Math.max(...loop.speeds) * 300, count);
  };

  /* By how much the argument of f grows between two frequencies. */
  const grown = (f, low, fLow, high, fHigh, depth = 0) => {
    const middle = (low + high) / 2;
    const fMiddle = f(middle);
    const first = arg(div(fMiddle, fLow));
    const second = arg(div(fHigh, fMiddle));
    if (Math.abs(first) + Math.abs(second) < 0.8 || depth > 40) return first + second;
    return grown(f, low, fLow, middle, fMiddle, depth + 1) + grown(f, middle, fMiddle, high, fHigh, depth + 1);
  };
  const SLOW = 0.5; // rad of dead time between two frequencies that are looked at one by one

  /* The same for q + r exp(-jψ). Where one term is the larger all the way, the sum turns as it does,
     but for the angle between the two at the ends, however often the smaller one goes round. */
  const grownSum = (loop, a, b, depth = 0) => {
    const turned = b.psi - a.psi;
    if (turned < SLOW || depth > 60) {
      return grown((omega) => placeAt(loop, omega).sum, a.omega, a.sum, b.omega, b.sum);
    }
    const middle = placeAt(loop, (a.omega + b.omega) / 2);
    const sizes = [a.size, middle.size, b.size];
    const nearest = Math.min(...sizes.map(Math.abs));
    const side = Math.sign(a.size);
    const bent = Math.abs(middle.size - (a.size + b.size) / 2);
    if (sizes.every((size) => Math.sign(size) === side) && bent < nearest / 2) {
      const of = side > 0 ? "r" : "q";
      const smooth = grown((omega) => along(loop[of], omega), a.omega, a[of], b.omega, b[of]);
      const beside = (p) => arg(div(p.sum, side > 0 ? p.late : p.q));
      return smooth - (side > 0 ? turned : 0) + beside(b) - beside(a);
    }
    return grownSum(loop, a, middle, depth + 1) + grownSum(loop, middle, b, depth + 1);
  };
  const placeAt = (loop, omega) => {
    const [q, r, psi] = [along(loop.q, omega), along(loop.r, omega), phase(loop, omega)];
    const behind = mul(r, turn(-psi));
    return { omega, q, r, psi, late: behind, sum: add(q, behind), size: Math.log(abs(r) / abs(q)) };
  };
  /* |r/q| where s is without bound. */
  const ratioAtInfinity = ({ q, r }) => (r.length > q.length ? Infinity : r.length === q.length ? Math.abs(r[0] / q[0]) : 0);

  /* Roots of p_B in the right half plane, by the argument of p_B along the axis. */
  const countRight = (loop) => {
    const { q, r, theta, held } = loop;
    const ratio = ratioAtInfinity(loop);
    if (theta && ratio >= 1) return ratio > 1 ? Infinity : NaN;
    const whole = theta ? q : plus(q, held % 2 ? r.map((a) => -a) : r);
    const grid = frequencies(loop, 300);
    let total = 0;
    let end;
    if (theta || held) {
      let before = placeAt(loop, 0);
      before.size = Infinity; // q is 0 there
      for (const omega of grid) {
        const here = placeAt(loop, omega);
        total += grownSum(loop, before, here);
        before = here;
      }
      // Beyond the last frequency what is late by θ turns nothing any more.
      if (theta) total -= arg(div(before.sum, before.q));
      end = theta ? before.q : before.sum;
    } else {
      const at = (omega) => along(whole, omega);
      let [before, fBefore] = [0, at(0)];
      for (const omega of grid) {
        const here = at(omega);
        total += grown(at, before, fBefore, omega, here);
        [before, fBefore] = [omega, here];
      }
      end = fBefore;
    }
    // Beyond the last frequency only the leading term is left.
    const leading = mul([whole[0], 0], powerOfJ(whole.length - 1));
    total += arg(div(leading, end));
    return Math.round((whole.length - 1) / 2 - total / Math.PI);
  };

  /* How much more dead time a stable loop tolerates: at each frequency of |L| = 1, what its phase leaves. */
  const delayMargin = (loop) => {
    const grid = frequencies(loop, 600);
    const size = (omega) => Math.log(abs(along(loop.r, omega)) / abs(along(loop.q, omega)));
    let least = !loop.theta && ratioAtInfinity(loop) >= 1 ? 0 : Infinity;
    for (let k = 1, before = size(grid[0]); k < grid.length; k++) {
      const here = size(grid[k]);
      if (before * here < 0) {
        let [low, high] = [grid[k - 1], grid[k]];
        for (let round = 0; round < 50; round++) {
          const middle = (low + high) / 2;
          if (size(middle) * before > 0) low = middle;
          else high = middle;
        }
        const left = arg(L(loop, low)) - Math.PI;
        least = Math.min(least, (left - 2 * Math.PI * Math.floor(left / (2 * Math.PI))) / low);
      }
      before = here;
    }
    return least;
  };
  const powerOfJ = (k) => [[1, 0], [0, 1], [-1, 0], [0, -1]][k % 4];

  const onTheRight = (p) => roots(p).filter((z) => z[0] > 1e-9 * (1 + abs(z))).length;

  /* N, P and Z of Lemma 1, and Ms where the loop is stable. */
  const judge = (loop) => {
    const Z = countRight(loop);
    const P = onTheRight(loop.D) + onTheRight(loop.Nm);
    const fromModel = onTheRight(loop.model);
    const stable = Z === 0 && fromModel === 0;
    return {
      N: Z - P, P, Z, stable, modelStable: fromModel === 0, Ms: stable ? peak(loop) : NaN,
      delayMargin: stable && !loop.at ? delayMargin(loop) : NaN, // between samples it is another
    };
  };

  /* Largest |S| = |q/p_B|. */
  const peak = (loop) => {
    const S = (x) => {
      const omega = Math.exp(x);
      return abs(along(loop.q, omega)) / abs(characteristic(loop, omega));
    };
    const grid = frequencies(loop, 1200).map(Math.log);
    const seen = grid.map(S);
    let best = Math.max(...seen, loop.theta ? 0 : atInfinity(loop.q, plus(loop.q, loop.held % 2 ? loop.r.map((a) => -a) : loop.r)));
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
     positive, with the way of the root where the parameter grows: `right` is 1 into the right half
     plane and -1 out of it. `solved` gives all values, complex; one after the other is followed, from
     one frequency to the next where it is worth it. At a root ds/dx = j/(dx/dω), so that the sign of
     its real part is that of the imaginary part of dx/dω. Yields now and then, so that a page may answer. */
  const crossed = function* (omegas, worth, solved) {
    const found = [];
    let last = null;
    let looked = 0;
    for (const omega of omegas) {
      if (++looked % 200 === 0) yield;
      if (!worth(omega)) {
        last = null;
        continue;
      }
      const roots = last ? inOrder(solved(omega), last.roots) : solved(omega);
      for (const [k, x] of (last ? roots : []).entries()) {
        if (last.roots[k][1] * x[1] >= 0 || Math.max(last.roots[k][0], x[0]) <= 0) continue;
        let [a, b, old] = [last.omega, omega, last.roots];
        for (let round = 0; round < 60 && b - a > 1e-14 * b; round++) {
          const m = (a + b) / 2;
          const middle = inOrder(solved(m), old);
          if (old[k][1] * middle[k][1] <= 0) b = m;
          else [a, old] = [m, middle];
        }
        const [real, off] = inOrder(solved((a + b) / 2), old)[k];
        if (real > 0 && Math.abs(off) < 1e-6 * real) found.push({ x: real, right: Math.sign(x[1]) });
      }
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
  const sorted = (found, low, high) => found.filter(({ x }) => x > low && x < high).sort((a, b) => a.x - b.x);

  /* The plant over the model, without the filter and without the dead time. */
  const overModel = (loop) => {
    const [before, behind] = [times(loop.N, loop.Dm), times(loop.D, loop.Nm)];
    return { before: trimmed(before), behind: trimmed(behind), ratio: (omega) => div(along(before, omega), along(behind, omega)) };
  };

  /* The roots z of (1 + z)^n = 1, and ln|E| and the angle of E(x) = (1 + jx)^n - 1 at x = exp(u), and how
     fast each grows with u. ln|E| grows with u for n < 7. */
  const zerosOf = (n) => Array.from({ length: n }, (_, k) => minus(turn((2 * Math.PI * k) / n), [1, 0]));
  const logarithm = (zeros, u) => {
    const x = Math.exp(u);
    const found = { size: 0, angle: 0, growth: 0, turn: 0 };
    for (let k = 0; k < zeros.length; k++) {
      const [a, b] = [-zeros[k][0], x - zeros[k][1]];
      const square = a * a + b * b;
      found.size += Math.log(square) / 2;
      found.angle += Math.atan2(b, a);
      found.growth += (x * b) / square;
      found.turn += (x * a) / square;
    }
    return found;
  };
  /* Newton's steps towards the place where what rises is 0, and halves where they lead outside. */
  const risen = (rising, low, high) => {
    let u = (low + high) / 2;
    for (let round = 0; round < 60; round++) {
      const [off, slope] = rising(u);
      if (off > 0) high = u;
      else low = u;
      const newton = u - off / slope;
      const next = newton > low && newton < high ? newton : (low + high) / 2;
      if (Math.abs(next - u) < 1e-15 * (1 + Math.abs(u))) break;
      u = next;
    }
    return u;
  };

  /* Every λ in a range at which p_B has a root on the axis, and the way of the root. With x = ωλ and the
     plant over its model R exp(-jψ), p_B has the root jω where E(x) = -R exp(-jψ). The size gives x at each
     ω, and what the angles then differ by is a multiple of 2π at a root. As ω grows past it, this difference
     falls where a root goes to the right as λ grows. */
  const criticalTimeConstants = function* (loop, low, high) {
    const { order: n } = loop;
    const { before, behind, ratio } = overModel(loop);
    const zeros = zerosOf(n);
    const found = [];
    let looked = 0;
    const placed = (omega, near) => {
      looked += 1;
      const R = ratio(omega);
      const size = Math.log(abs(R));
      const angle = arg([-R[0], -R[1]]);
      const psi = angle + 2 * Math.PI * Math.round((near - angle) / (2 * Math.PI));
      const [first, last] = [Math.log(omega * low), Math.log(omega * high)];
      let [E, side, u] = [logarithm(zeros, first), 0, first];
      if (E.size > size) side = -1;
      else {
        const top = logarithm(zeros, last);
        if (top.size < size) [E, side, u] = [top, 1, last];
        else {
          u = risen((v) => {
            E = logarithm(zeros, v);
            return [E.size - size, E.growth];
          }, first, last);
        }
      }
      return { omega, psi, side, lambda: Math.exp(u) / omega, apart: (E.angle - psi + phase(loop, omega)) / (2 * Math.PI) };
    };
    /* Between two places, each of which is on its side of a multiple. */
    const crossing = (a, b, m) => {
      let [p, q, fp, fq] = [a, b, a.apart - m, b.apart - m];
      for (let round = 0; round < 80 && q.omega - p.omega > 1e-15 * q.omega; round++) {
        const share = round % 3 === 2 ? 0.5 : Math.min(0.999, Math.max(0.001, fp / (fp - fq)));
        const middle = placed(p.omega + share * (q.omega - p.omega), (p.psi + q.psi) / 2);
        const f = middle.apart - m;
        if (Math.abs(f) < 1e-13 * (1 + Math.abs(m))) return middle;
        if (f > 0 === fp > 0) [p, fp] = [middle, f];
        else [q, fq] = [middle, f];
      }
      return p;
    };
    const between = function* (a, b, depth) {
      if (a.side && a.side === b.side) return;
      const middle = placed(Math.sqrt(a.omega * b.omega), (a.psi + b.psi) / 2);
      const rises = b.apart > a.apart;
      const astray = (middle.apart > a.apart) !== rises || (b.apart > middle.apart) !== rises;
      if (depth && (astray || a.side || b.side || Math.abs(b.psi - a.psi) > 0.5)) {
        yield* between(a, middle, depth - 1);
        yield* between(middle, b, depth - 1);
        return;
      }
      const [least, most] = [a.apart, b.apart].sort((x, y) => x - y);
      for (let m = Math.ceil(least); m <= most; m++) {
        if (looked > 300) {
          looked = 0;
          yield;
        }
        if (m === a.apart && a.omega !== b.omega) continue; // it was the end of the one before
        const at = crossing(a, b, m);
        if (at.side === 0) found.push({ x: at.lambda, right: rises ? -1 : 1 });
      }
    };
    let last = null;
    for (const omega of frequencies({ ...loop, speeds: undefined, lambda: Math.sqrt(low * high) }, 800)) {
      if (looked > 300) {
        looked = 0;
        yield;
      }
      const here = placed(omega, last ? last.psi : 0);
      if (last) yield* between(last, here, 6);
      last = here;
    }
    // A root goes through infinity where the leading terms cancel: λ^n = -R/s^n; with a dead time it is
    // infinitely many from there on. How many are left is counted again.
    const c = (loop.held % 2 ? 1 : -1) * (before[0] / behind[0]);
    if (before.length - behind.length === n && (c > 0 || loop.theta)) found.push({ x: Math.abs(c) ** (1 / n), right: NaN });
    return sorted(found, low, high);
  };
  /* Frequencies at which nothing turns by much from one to the next, with the dead time. */
  const turning = function* (loop, worth, count = 800) {
    let before = 0;
    for (const omega of frequencies(loop, count)) {
      const turned = phase(loop, omega) - phase(loop, before);
      const parts = worth(omega) ? Math.min(200, Math.ceil(turned / 0.25)) : 1;
      for (let k = 1; k < parts; k++) yield before + ((omega - before) * k) / parts;
      yield omega;
      before = omega;
    }
  };

  /* The stable intervals between two bounds: roots are counted once, and at each critical value those
     that cross are added. What is left at the end is counted again; should it differ, all are counted. */
  const between = function* (critical, low, high, loopAt) {
    const ends = [low, ...critical.map(({ x }) => x), high];
    const wide = (i) => ends[i] / ends[i - 1] > 1 + 1e-9;
    const counted = (i) => countRight(loopAt(Math.sqrt(ends[i - 1] * ends[i])));
    const carried = [];
    let sure = NaN;
    for (let i = 1; i < ends.length; i++) {
      const { right = NaN } = critical[i - 2] ?? {};
      sure += 2 * right;
      if (!Number.isFinite(sure) && wide(i)) {
        yield;
        sure = counted(i);
      }
      carried.push(sure);
    }
    let last = ends.length - 1;
    while (last > 1 && !wide(last)) last--;
    const agrees = carried[last - 1] === counted(last) && carried.every((Z) => !(Z < 0));
    const found = [];
    for (let i = 1; i < ends.length; i++) {
      if (!wide(i)) continue;
      if (!agrees) yield;
      if ((agrees ? carried[i - 1] : counted(i)) !== 0) continue;
      const before = found[found.length - 1];
      if (before && before[1] > ends[i - 1] * (1 - 2e-9)) before[1] = ends[i];
      else found.push([ends[i - 1], ends[i]]);
    }
    return found;
  };
  const stabilizing = function* (given, low, high) {
    const loopAt = (lambda) => loopOf({ ...given, lambda });
    return yield* between(yield* criticalTimeConstants(loopAt(low), low, high), low, high, loopAt);
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
    const rows = Phi.slice(0, n).map((row) => Float64Array.from(row));
    let x = new Float64Array(n + 2); // the states, the input and its slope
    let next = new Float64Array(n + 2);
    const past = new Float64Array(steps + 1); // what comes back after θ
    const y = new Float64Array(steps + 1);
    const force = (k) => 1 - (k < parts ? 0 : past[k - parts]);
    for (let k = 0; k <= steps; k++) {
      const u = theta ? force(k) : 1;
      let highest = u;
      for (let i = 0; i < n; i++) highest -= Q[n - i] * x[i];
      let [out, behind] = [num[0] * highest, back[0] * highest];
      for (let i = 0; i < n; i++) {
        out += num[n - i] * x[i];
        behind += back[n - i] * x[i];
      }
      y[k] = out;
      past[k] = behind;
      x[n] = u;
      x[n + 1] = ((theta ? force(k + 1) : 1) - u) / h;
      for (let i = 0; i < n; i++) {
        let sum = 0;
        for (let j = 0; j < n + 2; j++) sum += rows[i][j] * x[j];
        next[i] = sum;
      }
      [x, next] = [next, x];
    }
    const shift = map.late ? parts : 0;
    const time = Array.from({ length: steps + 1 }, (_, k) => k * h * unit);
    const output = time.map((_, k) => (k < shift ? 0 : y[k - shift]));
    return { time, y: output };
  };

  /* The same plant under the same controller, without an observer. */
  const plain = (loop, { Nc, Dc }) => ({ ...loop, q: times(loop.D, Dc), r: times(loop.N, Nc), fromDelta: times(loop.N, Dc) });

  window.nrdob = {
    characteristic, loopOf, judge, stabilizing, step, F, FH, H, L, roots, frequencies, countRight, delayMargin, drained, onTheRight, plain,
    // For loops of another kind.
    parts: { abs, add, along, arg, between, criticalTimeConstants, crossed, div, expm, joined, lags, late, logarithm, minus, mul, overModel, phase, plantOf, plus, product, risen, sorted, times, turn, turning, value, zerosOf },
  };
  /* What a page can move: how a loop is made, judged and answers, and what its bar is a set of. */
  window.nrdob.kinds = {
    // N counts turns of `counted` around -1. Of the curves the first is drawn at first.
    lags: {
      loopOf,
      stabilizing,
      step,
      curves: { FH: "F·H", H: "H", L: "L" },
      counted: "FH",
      bar: "lambda",
      said: "The loop is stable for these λ:",
    },
  };
})();
