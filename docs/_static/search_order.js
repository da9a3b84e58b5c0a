// Order of what a search finds: the guide and the tutorial first, pages of errors last. The other numbers are those of Sphinx.
var Scorer = {
  score: (result) => {
    const [page, , , , score] = result;
    if (page.startsWith("guide/") || page === "tutorial") return score + 10;
    if (page.startsWith("errors/")) return score - 20;
    return score;
  },
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
