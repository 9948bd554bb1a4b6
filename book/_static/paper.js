/* On paper no answer stands under its question: while a page is printed, the answers to the
   prediction and to the exercises stand at the end of the chapter. */
(() => {
  "use strict";

  const moved = [];

  // What stays: of a choice its line; of a solution nothing.
  const standIn = (answer) => {
    if (answer.matches(".solution")) return document.createComment("");
    const choice = answer.cloneNode();
    choice.append(answer.querySelector(":scope > summary").cloneNode(true));
    return choice;
  };

  const gather = () => {
    for (const chapter of document.querySelectorAll("article.bd-article")) {
      const answers = [...chapter.querySelectorAll(".prediction > details, .solution")];
      if (!answers.length) continue;
      const title = document.createElement("p");
      title.className = "rubric";
      title.textContent = "Answers";
      const end = document.createElement("section");
      end.className = "answers";
      end.append(title);
      for (const answer of answers) {
        const left = standIn(answer);
        answer.replaceWith(left);
        end.append(answer);
        moved.push([answer, left]);
      }
      chapter.append(end);
    }
  };

  const putBack = () => {
    for (const [answer, left] of moved.splice(0)) left.replaceWith(answer);
    for (const end of document.querySelectorAll("section.answers")) end.remove();
  };

  window.addEventListener("beforeprint", gather);
  window.addEventListener("afterprint", putBack);
})();
