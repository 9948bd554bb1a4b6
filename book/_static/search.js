/* The search of the site: Sphinx's index finds the pages, this puts them in order and shows what
   they say. A student is led to the chapter that introduces a word, then to those that speak of it
   most; names of the package, pages for teachers and lists come after, and in a chapter its
   literature and exercises. A word that stands nowhere is taken for the nearest one that does.
   Nothing is fetched, so that it works from a disk, too. */
(() => {
  "use strict";

  const { pages, terms } = window.TEXTS ?? { pages: {}, terms: {} };
  const FIRST = 30;
  const SHOWN = 240;
  const LAST = /^(Known, and new here|Try it|Compute|Prove|Design|Summary)$/;
  const OF_KIND = { chapter: 1, page: 0.45, names: 0.35, teaching: 0.3 };
  // Words of a question that say nothing of what is asked.
  const EMPTY = new Set("a an and are be can do does find for how i in is it my of on or or should the to use what when where which why with".split(" "));
  const LETTERS = { lambda: "λ", omega: "ω", eta: "η", delta: "δ", theta: "θ" };

  // The stem of a word, near enough: "choose" and "choosing" are one.
  const stem = (word) => LETTERS[word] ?? (word.length > 5 ? word.replace(/(ing|es|ed|e|s)$/, "") : word);

  const wordsOf = (query) => {
    const all = query.toLowerCase().split(/[^\p{L}\p{N}_]+/u).filter(Boolean).map(stem);
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
      score: (LAST.test(heading) ? 0.2 : 1) * (2 * said(heading, patterns) + said(`${heading} ${text}`, patterns)),
    }));
    const best = judged.reduce((a, b) => (b.score > a.score ? b : a), judged[0]);
    const whole = sections.filter(([, heading]) => !LAST.test(heading)).map(([, heading, text]) => `${heading} ${text}`).join(" ");
    let score = 3 * said(title, patterns) + said(whole, patterns) + (best?.score ?? 0);
    score *= OF_KIND[kind];
    // The glossary knows which chapter introduces a word.
    for (const [term, chapter] of Object.entries(terms)) {
      if (chapter !== page) continue;
      const ofTerm = wordsOf(term);
      if (ofTerm.join(" ") === words.join(" ")) score += 6;
      else if (words.every((word) => ofTerm.includes(word))) score += 3 * words.length / ofTerm.length;
      else if (ofTerm.every((word) => words.includes(word))) score += 3 * ofTerm.length / words.length;
    }
    return { page, title, score, ...best, score };
  };

  /* Every word of the site, and how often it stands there; words of titles and of the glossary count more. */
  const vocabulary = () => {
    const counts = new Map();
    const put = (text, weight) => {
      for (const word of text.toLowerCase().match(/\p{L}{3,}/gu) ?? []) counts.set(word, (counts.get(word) ?? 0) + weight);
    };
    for (const { title, sections } of Object.values(pages)) {
      put(title, 10);
      for (const [, heading, text] of sections) put(`${heading} ${text}`, 1);
    }
    for (const term of Object.keys(terms)) put(term, 10);
    return counts;
  };

  /* Letters to be left out, put in, changed or exchanged with their neighbour to make b of a; or more than `most`. */
  const apart = (a, b, most) => {
    if (Math.abs(a.length - b.length) > most) return most + 1;
    let [before, last] = [[], Array.from({ length: b.length + 1 }, (_, j) => j)];
    for (let i = 1; i <= a.length; i++) {
      const row = [i];
      for (let j = 1; j <= b.length; j++) {
        row[j] = Math.min(last[j] + 1, row[j - 1] + 1, last[j - 1] + (a[i - 1] === b[j - 1] ? 0 : 1));
        if (i > 1 && j > 1 && a[i - 1] === b[j - 2] && a[i - 2] === b[j - 1]) row[j] = Math.min(row[j], before[j - 2] + 1);
      }
      [before, last] = [last, row];
    }
    return last[b.length];
  };

  /* The query with each word that stands nowhere replaced by the nearest one that does. */
  const nearest = (query) => {
    const counts = vocabulary();
    const known = [...counts.keys()];
    return query.replace(/\p{L}{4,}/gu, (given) => {
      const word = given.toLowerCase();
      const [beginning, most] = [stem(word), word.length > 6 ? 2 : 1];
      if (LETTERS[word] || EMPTY.has(word) || known.some((each) => each.startsWith(beginning))) return given;
      const near = known
        .map((each) => ({ each, off: apart(word, each, most) - Math.min(0.9, 0.1 * Math.log(counts.get(each))) }))
        .filter(({ off }) => off <= most)
        .sort((a, b) => a.off - b.off);
      return near.length ? near[0].each : given;
    });
  };

  const ranked = (query, listed = new Set()) => {
    const words = wordsOf(query);
    const patterns = words.map(finder);
    return Object.keys(pages)
      .map((page) => judge(page, patterns, words))
      .map((each) => ({ ...each, score: each.score + (listed.has(each.page) ? 0.05 : 0) }));
  };

  const inOrder = (found) => found.filter(({ score }) => score > 0).sort((a, b) => b.score - a.score).slice(0, FIRST);

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

  const show = (asked) => {
    const query = asked.includes("_") ? asked : nearest(asked);
    const patterns = wordsOf(query).map(finder);
    const results = indexed(query);
    const listed = new Set(results.map(([page]) => page));
    const found = inOrder(ranked(query, listed).concat(named(results, query.toLowerCase().trim())));
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
      ? `${query === asked ? "" : `“${asked}” stands nowhere. `}${found.length} page${found.length === 1 ? "" : "s"} for “${query}”, the best first.`
      : `Nothing was found for “${query}”. Try fewer words, or look into the glossary.`;
  };

  Search.query = show;
  Search.best = (asked) => inOrder(ranked(nearest(asked)));
})();
