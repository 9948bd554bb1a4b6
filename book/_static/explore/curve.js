/* A Nyquist curve in points as close as it bends: between two neighbours it leaves the line by less
   than a part of a pixel, so that a dead time's spiral is round. Where its turns lie closer together
   than a pixel what they fill is given instead. */
(() => {
  "use strict";

  const { phase } = nrdob.parts;

  const OFF = 0.15; // px between curve and line
  const TURN = 0.7; // rad of dead time between two points
  const PITCH = 0.8; // px between two turns
  const MOST = 6000; // points
  const DEEPEST = 18;

  /* Runs of points [re, im] within `reach` of 0, with `scale` pixels to 1; `discs` are those that turns
     without number fill, [centre, radius], `hollow` where they are rings. */
  const traced = (loop, map, name, reach, scale) => {
    const near = (z) => Math.hypot(...z) < reach;
    const base = nrdob.frequencies(loop, 200);
    const runs = [];
    const discs = [];
    let run = null;
    let count = 0;
    const put = (z) => {
      if (!near(z)) run = null;
      else if (run) run.push(z);
      else runs.push((run = [z]));
      count += 1;
    };
    const spot = (omega) => ({ omega, z: map(loop, omega), psi: phase(loop, omega) });
    const follow = (a, b, depth) => {
      const far = !near(a.z) && !near(b.z);
      if (depth === DEEPEST || count > MOST || (far && b.psi - a.psi < TURN && depth > 1)) return put(b.z);
      const middle = spot(Math.sqrt(a.omega * b.omega));
      const [dx, dy] = [b.z[0] - a.z[0], b.z[1] - a.z[1]];
      const [ex, ey] = [middle.z[0] - a.z[0], middle.z[1] - a.z[1]];
      const along = Math.max(0, Math.min(1, (ex * dx + ey * dy) / (dx * dx + dy * dy || 1)));
      const off = scale * Math.hypot(ex - along * dx, ey - along * dy);
      const all = far && !near(middle.z) && Math.abs(Math.hypot(...a.z) + Math.hypot(...b.z)) > 4 * reach;
      if (all || (off < OFF && b.psi - a.psi < TURN)) return put(b.z);
      follow(a, middle, depth + 1);
      follow(middle, b, depth + 1);
    };
    /* The centre and the radius of the turns at a frequency. */
    const turns = (omega) => {
      if (name === "L") return [[0, 0], Math.hypot(...nrdob.L(loop, omega))];
      const F = nrdob.F(loop, omega);
      const H = nrdob.FH(loop, omega);
      const [centre, round] = [[-F[0], -F[1]], Math.hypot(H[0] + F[0], H[1] + F[1])];
      return name === "FH" ? [centre, round] : [[-1, 0], round / Math.hypot(...F)];
    };
    let last = spot(base[0]);
    put(last.z);
    for (let k = 1; k < base.length; k++) {
      const turned = loop.theta * (base[k] - base[k - 1]);
      if (turned > 20) {
        const [[x, y], from] = turns(base[k - 1]);
        const [[u, v], to] = turns(base[k]);
        const moved = scale * (Math.abs(to - from) + Math.hypot(u - x, v - y));
        if ((moved * 2 * Math.PI) / turned < PITCH) {
          for (let rest = k - 1; rest < base.length; rest++) {
            const [centre, radius] = turns(base[rest]);
            if (scale * radius > 1 && radius < 3 * reach) discs.push([centre, radius]);
          }
          break;
        }
      }
      const here = spot(base[k]);
      follow(last, here, 0);
      last = here;
    }
    return { runs: runs.filter((each) => each.length > 1), discs, hollow: name === "H", spots: [runs[0]?.[0], last.z] };
  };

  nrdob.traced = traced;
})();
