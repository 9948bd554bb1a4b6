/* A formula in a line of text that is wider than the page gets a line of its own, and scrolls. */
(() => {
  "use strict";

  const LINES = "p, li, td, dd, summary, figcaption, div";

  // The nearest box around a formula that has a width: a paragraph set inline has none.
  const boxAround = (formula) => {
    let box = formula.closest(LINES);
    while (box && !box.clientWidth) box = box.parentElement?.closest(LINES);
    return box;
  };

  const fit = () => {
    const formulas = [...document.querySelectorAll("span.math")];
    for (const formula of formulas) formula.classList.remove("wide");
    // All widths first, then all changes: the page is laid out once.
    const wide = formulas.filter((formula) => {
      const drawn = formula.querySelector("mjx-container");
      const room = boxAround(formula);
      return drawn && room && drawn.offsetWidth > room.clientWidth + 1;
    });
    for (const formula of wide) formula.classList.add("wide");
  };

  window.addEventListener("load", () => {
    window.MathJax?.startup?.promise.then(fit);
    let waiting;
    window.addEventListener("resize", () => {
      clearTimeout(waiting);
      waiting = setTimeout(fit, 150);
    });
  });
})();
