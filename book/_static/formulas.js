/* Formulas that are wider than their place. In a line of text: they get a line of their own, and
   scroll. Displayed: they are set a little smaller, as far as they can be read, or else scroll; and
   what scrolls can be reached with the Tab key. */
(() => {
  "use strict";

  const LINES = "p, li, td, dd, summary, figcaption, div";
  const SMALLEST = 0.75;

  // The nearest box around a formula that has a width: a paragraph set inline has none.
  const boxAround = (formula) => {
    let box = formula.closest(LINES);
    while (box && !box.clientWidth) box = box.parentElement?.closest(LINES);
    return box;
  };

  const fit = () => {
    const formulas = [...document.querySelectorAll("span.math")];
    const displayed = [...document.querySelectorAll("div.math mjx-container")];
    for (const formula of formulas) formula.classList.remove("wide");
    for (const formula of displayed) formula.classList.remove("smaller");
    // All widths first, then all changes: the page is laid out once.
    const wide = formulas.filter((formula) => {
      const drawn = formula.querySelector("mjx-container");
      const room = boxAround(formula);
      return drawn && room && drawn.offsetWidth > room.clientWidth + 1;
    });
    const shares = displayed.map((formula) => formula.clientWidth / formula.scrollWidth);
    for (const formula of wide) formula.classList.add("wide");
    displayed.forEach((formula, k) => {
      const scrolls = 0 < shares[k] && shares[k] < SMALLEST;
      formula.classList.toggle("smaller", SMALLEST <= shares[k] && shares[k] < 1);
      formula.toggleAttribute("tabindex", scrolls);
      if (scrolls) formula.tabIndex = 0;
    });
    for (const formula of formulas) {
      if (!formula.classList.contains("wide")) formula.removeAttribute("tabindex");
      else if (formula.scrollWidth > formula.clientWidth) formula.tabIndex = 0;
    }
  };

  window.addEventListener("load", () => {
    window.MathJax?.startup?.promise.then(fit);
    let waiting;
    const again = () => {
      clearTimeout(waiting);
      waiting = setTimeout(fit, 150);
    };
    window.addEventListener("resize", again);
    document.addEventListener("toggle", again, true); // what is folded has no width yet
  });
})();
