/* Formulas that are wider than their place are set a little smaller, as far as they can be read, or
   else scroll, and those in a line of text get a line of their own for it; what scrolls can be
   reached with the Tab key. */
(() => {
  "use strict";

  const LINES = "p, li, td, dd, summary, figcaption, div";
  const SMALLEST = 0.75;

  const width = (element) => element.getBoundingClientRect().width;

  // The nearest box around a formula that has a width: a paragraph set inline has none.
  const boxAround = (formula) => {
    let box = formula.closest(LINES);
    while (box && !box.clientWidth) box = box.parentElement?.closest(LINES);
    return box;
  };

  // What part of a formula in a line of text has room beside the marks that are tied to it; short
  // ones go into the next line.
  const inlineShare = (formula) => {
    const box = boxAround(formula);
    const drawn = width(formula.firstElementChild);
    const marks = (formula.closest(".tied") ?? formula).offsetWidth - formula.offsetWidth;
    if (!box || !drawn || drawn + marks <= box.clientWidth / 2) return 1;
    const { paddingLeft, paddingRight } = getComputedStyle(box);
    return (box.clientWidth - parseFloat(paddingLeft) - parseFloat(paddingRight) - marks) / drawn;
  };
  const displayedShare = (formula) => {
    const drawn = width(formula.querySelector("math"));
    return drawn ? formula.clientWidth / Math.max(drawn, formula.scrollWidth) : 1;
  };

  const fit = () => {
    const formulas = [...document.querySelectorAll(".math")];
    for (const formula of formulas) {
      formula.classList.remove("wide");
      formula.style.removeProperty("font-size");
    }
    // All widths first, then all changes: the page is laid out once.
    const shares = formulas.map((formula) => (formula.matches("span") ? inlineShare : displayedShare)(formula));
    formulas.forEach((formula, k) => {
      if (shares[k] >= 1) return;
      if (shares[k] < SMALLEST) formula.classList.add("wide");
      else formula.style.fontSize = `${Math.floor(1000 * shares[k] - 5) / 10}%`;
    });
    for (const formula of formulas) {
      const scrolls = formula.classList.contains("wide") && formula.scrollWidth > formula.clientWidth;
      formula.toggleAttribute("tabindex", scrolls);
      if (scrolls) formula.tabIndex = 0;
    }
  };

  document.fonts.ready.then(fit);
  let waiting;
  const again = () => {
    clearTimeout(waiting);
    waiting = setTimeout(fit, 150);
  };
  window.addEventListener("resize", again);
  document.addEventListener("toggle", again, true); // what is folded has no width yet
})();
