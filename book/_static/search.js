/* The search of the site: Sphinx's index finds the pages, this puts them in order and shows what
   they say. A student is led to the chapter that introduces a word, then to those that speak of it
   most; names of the package, pages for teachers and lists come after. Nothing is fetched, so that
   it works from a disk, too. */
(() => {
  "use strict";

  const { pages, terms } = window.TEXTS ?? { pages: {}, terms: {} };
  const FIRST = 30;
  const SHOWN = 240;
  const OF_KIND = { chapter: 1, page: 0.45, names: 0.35, teaching: 0.3 };
  // Words of a question that say nothing of what is asked.
  const EMPTY = new Set("a an and are be can do does find for how i in is it my of on or or should the to use what when where which why with".split(" "));
  const LETTERS = { lambda: "λ", omega: "ω", eta: "η", delta: "δ", theta: "θ" };

  // The stem of a word, near enough: "choose" and "choosing" are one.
  const stem = (word) => LETTERS[word] ?? (word.length > 5 ? word.replace(/(ing|es|ed|e|s)$/, "") : word);

  const wordsOf = (query) => {
    const all = query.toLowerCase().split(/[^\p{L}\p{N}_-]+/u).filter(Boolean).map(stem);
    const telling = all.filter((word) => !EMPTY.has(word));
    return telling.length ? telling : all;
  };

  const escaped = (word) => word.replace(/[.*+?^${}()|[\]\\]/g, "\\$&");

  // The beginning of a word is enough: "filter" finds "filters".
  const finder = (word) =>
    new RegExp(word.length > 1 ? `(?<![\\p{L}\\p{N}])${escaped(word)}` : escaped(word), "giu");

  const times = (text, pattern) => (text.match(pattern) ?? []).length;

  // How much a text says of the words: each counts, and more the oftener it comes, but ever less.
  const said = (text, patterns) => {
    const counts = patterns.map((pattern) => times(text, pattern));
    if (!counts.some(Boolean)) return 0;
    const complete = counts.filter(Boolean).length / counts.length;
    return complete ** 2 * counts.reduce((sum, n) => sum + n / (n + 3), 0) / counts.length;
  };

  const judge = (page, patterns, words) => {
    const { kind, title, sections } = pages[page];
    const judged = sections.map(([id, heading, text], place) => ({
      id: place ? id : "", heading: place ? heading : "", text,
      score: 2 * said(heading, patterns) + said(`${heading} ${text}`, patterns),
    }));
    const best = judged.reduce((a, b) => (b.score > a.score ? b : a), judged[0]);
    const whole = sections.map(([, heading, text]) => `${heading} ${text}`).join(" ");
    let score = 3 * said(title, patterns) + said(whole, patterns) + (best?.score ?? 0);
    score *= OF_KIND[kind];
    // The glossary knows which chapter introduces a word.
    for (const [term, chapter] of Object.entries(terms)) {
      if (chapter !== page) continue;
      const ofTerm = wordsOf(term);
      if (ofTerm.join(" ") === words.join(" ")) score += 6;
      else if (words.every((word) => ofTerm.includes(word))) score += 3 * words.length / ofTerm.length;
    }
    return { page, title, score, ...best, score };
  };

  const make = (tag, properties = {}, ...children) => {
    const element = Object.assign(document.createElement(tag), properties);
    element.append(...children);
    return element;
  };

  // What stands around the first of the words, with the words marked.
  const snippet = (text, patterns) => {
    const first = Math.min(...patterns.map((pattern) => {
      const at = text.search(pattern);
      return at < 0 ? Infinity : at;
    }));
    const from = Number.isFinite(first) && first > SHOWN / 2
      ? text.indexOf(" ", first - SHOWN / 3) + 1 : 0;
    const piece = text.slice(from, from + SHOWN);
    const line = make("p", { className: "context" }, from ? "… " : "");
    const any = new RegExp(patterns.map((pattern) => pattern.source).join("|"), "giu");
    let done = 0;
    for (const found of piece.matchAll(any)) {
      line.append(piece.slice(done, found.index), make("mark", {}, found[0]));
      done = found.index + found[0].length;
    }
    line.append(piece.slice(done), from + SHOWN < text.length ? " …" : "");
    return line;
  };

  // What Sphinx finds in the whole of the pages, of which the texts here are only the beginnings,
  // and the names of the package that are asked for by name.
  const indexed = (query) => Search._performSearch(...Search._parseQuery(query));
  const named = (results, query) => results
    .filter(([, name, , , , , kind]) => kind === "object"
      && `.${name.toLowerCase()}`.endsWith(`.${query}`))
    .map(([page, name, anchor, descr]) => ({
      page, title: name, id: anchor.slice(1), heading: "", text: descr,
      score: query.includes("_") ? 20 : 0.2,
    }));

  const show = (query) => {
    const words = wordsOf(query);
    const asked = query.toLowerCase().trim();
    const patterns = words.map(finder);
    const results = indexed(query);
    const listed = new Set(results.map(([page]) => page));
    const found = Object.keys(pages)
      .map((page) => judge(page, patterns, words))
      .map((each) => ({ ...each, score: each.score + (listed.has(each.page) ? 0.05 : 0) }))
      .concat(named(results, asked))
      .filter(({ score }) => score > 0)
      .sort((a, b) => b.score - a.score)
      .slice(0, FIRST);
    for (const { page, title, id, heading, text } of found) {
      const link = make("a", { href: `${page}.html${id ? `#${id}` : ""}` },
        heading ? `${title} › ${heading}` : title);
      const entry = make("li", { className: `kind-${pages[page].kind}` }, link);
      if (text) entry.append(snippet(text, patterns));
      Search.output.append(entry);
    }
    Search.stopPulse();
    Search.title.textContent = "What was found";
    Search.status.textContent = found.length
      ? `${found.length} page${found.length === 1 ? "" : "s"} for “${query}”, the best first.`
      : `Nothing was found for “${query}”. Try fewer words, or look into the glossary.`;
  };

  Search.query = show;
})();
