/* Formulas that are wider than their place are set a little smaller, as far as they can be read, or
   else scroll, and those in a line of text get a line of their own for it; what scrolls can be
   reached with the Tab key. */
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

  // How wide an inline formula is, and how wide it may be beside the marks that are tied to it.
  const widths = (formula) => {
    const box = boxAround(formula);
    const drawn = formula.querySelector("mjx-container")?.offsetWidth;
    if (!box || !drawn) return [0, Infinity];
    const marks = (formula.closest(".tied") ?? formula).offsetWidth - formula.offsetWidth;
    if (drawn + marks <= box.clientWidth / 2) return [drawn, Infinity];
    const { paddingLeft, paddingRight } = getComputedStyle(box);
    const room = box.clientWidth - parseFloat(paddingLeft) - parseFloat(paddingRight);
    return [drawn, Math.floor(room - marks)];
  };

  const fit = () => {
    const formulas = [...document.querySelectorAll("span.math")];
    const displayed = [...document.querySelectorAll("div.math mjx-container")];
    for (const formula of formulas) formula.classList.remove("wide");
    for (const formula of [...formulas, ...displayed]) formula.classList.remove("smaller");
    // All widths first, then all changes: the page is laid out once.
    const inline = formulas.map(widths);
    const shares = displayed.map((formula) => formula.clientWidth / formula.scrollWidth);
    formulas.forEach((formula, k) => {
      const [drawn, room] = inline[k];
      const smaller = room < drawn && SMALLEST * drawn <= room;
      formula.classList.toggle("smaller", smaller);
      formula.classList.toggle("wide", room < SMALLEST * drawn);
      if (smaller) formula.style.setProperty("--room", `${room}px`);
    });
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
