/* The filter of the ledger: by verdict, by part of the paper, by words.
   It reads everything from the page; without it the page shows every claim. */
(() => {
  "use strict";

  const place = document.querySelector(".claims-filter");
  if (!place) return;

  const sections = [...document.querySelectorAll("section")].filter(
    (section) => section.querySelector(":scope > .claim"),
  );
  // Runs before the formulas are set, so that they are found as they were written.
  const claims = sections.flatMap((section) =>
    [...section.querySelectorAll(":scope > .claim")].map((element) => ({
      element,
      section,
      verdict: element.querySelector(".verdict").textContent,
      text: element.textContent.toLowerCase(),
    })),
  );

  const make = (tag, properties = {}, ...children) => {
    const element = Object.assign(document.createElement(tag), properties);
    element.append(...children);
    return element;
  };

  const chosen = { verdicts: new Set(), parts: new Set() };
  const search = make("input", { type: "search", id: "claims-search", autocomplete: "off" });
  const count = make("p", { className: "claims-count" });
  count.setAttribute("role", "status");
  count.setAttribute("aria-live", "polite");
  const cards = make("button", { type: "button", className: "claims-cards" });
  const reset = make("button", { type: "button", className: "claims-reset" }, "Show all");

  const buttons = [];
  const group = (label, set, choices) => {
    const row = make("div", { className: "claims-choices" });
    row.setAttribute("role", "group");
    row.setAttribute("aria-label", label);
    row.append(make("span", { className: "claims-label", ariaHidden: "true" }, label));
    for (const [value, text, look] of choices) {
      const button = make("button", { type: "button", className: look }, text);
      button.setAttribute("aria-pressed", "false");
      button.addEventListener("click", () => {
        if (!set.delete(value)) set.add(value);
        show();
      });
      buttons.push([button, set, value]);
      row.append(button);
    }
    return row;
  };

  const show = () => {
    const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const { element, section, verdict, text } of claims) {
      const fits =
        (!chosen.verdicts.size || chosen.verdicts.has(verdict)) &&
        (!chosen.parts.size || chosen.parts.has(section)) &&
        words.every((word) => text.includes(word));
      element.hidden = !fits;
      shown += fits;
    }
    for (const section of sections) {
      section.hidden = !section.querySelector(":scope > .claim:not([hidden])");
    }
    for (const [button, set, value] of buttons) {
      button.setAttribute("aria-pressed", String(set.has(value)));
    }
    reset.disabled = !words.length && !chosen.verdicts.size && !chosen.parts.size;
    count.textContent =
      shown === claims.length
        ? `All ${claims.length} claims are shown.`
        : `${shown} of ${claims.length} claims ${shown === 1 ? "is" : "are"} shown.`;
  };

  const showAll = () => {
    search.value = "";
    chosen.verdicts.clear();
    chosen.parts.clear();
    show();
  };

  // A link to a claim must lead to it, whatever is filtered, and opens its card.
  const reveal = () => {
    const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (!target?.matches(".claim")) return;
    if (target.closest("[hidden]")) showAll();
    target.open = true;
    target.scrollIntoView();
  };

  // In the order in which the page explains them; none without a claim.
  const verdicts = [...document.querySelectorAll("dt .verdict")]
    .filter((badge) => claims.some((claim) => claim.verdict === badge.textContent))
    .map((badge) => [badge.textContent, badge.textContent, badge.className]);
  const parts = sections.map((section) => {
    const title = section.querySelector("h2").firstChild.textContent;
    return [section, title.split(":")[0], ""];
  });
  const label = make("label", { htmlFor: search.id, className: "claims-label" }, "Words");

  search.addEventListener("input", show);
  reset.addEventListener("click", () => {
    showAll();
    search.focus(); // the button is now disabled and must not keep the focus
  });
  // All cards at once: those that are shown are opened, or closed again.
  let opened = false;
  const turn = () => {
    cards.textContent = opened ? "Close all cards" : "Open all cards";
  };
  cards.addEventListener("click", () => {
    opened = !opened;
    for (const { element } of claims) element.open = opened && !element.hidden;
    turn();
  });
  turn();
  window.addEventListener("hashchange", reveal);
  window.addEventListener("load", reveal);

  place.replaceChildren(
    group("Verdict", chosen.verdicts, verdicts),
    group("Part", chosen.parts, parts),
    make("div", { className: "claims-choices" }, label, search, reset, cards),
    count,
  );
  show();
})();
